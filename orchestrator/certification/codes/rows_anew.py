"""Rows of a code's certificate, computed anew and compared with what was certified."""

import random
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.cases.case import load_case
from orchestrator.certification.case_file import BINDING, FMU, lay_files
from orchestrator.certification.codes.all_codes import code_for
from orchestrator.certification.codes.bench_case import case_name, write_row
from orchestrator.certification.codes.bench_point import BenchResult, BenchTask, compute_row
from orchestrator.certification.codes.row import CodeRow, GridCode
from orchestrator.certification.codes.row_verdict import judge_row
from orchestrator.certification.files import RESPONSES
from orchestrator.certification.points_anew import differ_signal
from orchestrator.certification.request import CertificationRequest
from orchestrator.certification.verification import Verification
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import StudyCase
from orchestrator.watch.finding import UNSTABLE

DRAWN = 1  # so many rows are drawn by chance beside the one with the narrowest margin


def chosen_rows(content: dict[str, Any], wanted: Sequence[str] = (), *, every: bool = False) -> list[str]:
    """Names of the rows that are computed anew.

    ``wanted``: Names that were asked for; where empty, the row with the narrowest margin that is met, and `DRAWN`
    others that chance draws, so that nobody knows them beforehand."""
    known = [stated["row"] for stated in content["rows"] if not stated["unknown"]]
    if unknown := [name for name in wanted if name not in known]:
        raise InputError(f"--rows: the certificate has no row {unknown[0]!r}; it has: {', '.join(known)}")
    if every or wanted:
        return list(wanted) or known
    margins = [
        (criterion["margin"], stated["row"])
        for stated in content["rows"] if stated["accepted"]
        for criterion in stated["criteria"] if criterion["margin"] is not None
    ]  # fmt: skip
    narrowest = [min(margins)[1]] if margins else known[:1]
    others = [name for name in known if name not in narrowest]
    return narrowest + random.SystemRandom().sample(others, min(DRAWN, len(others)))


def verify_rows(
    folder: Path, content: dict[str, Any], names: Sequence[str], executor: Executor, report: CountReport = nobody
) -> Verification:
    """Compute rows anew, from the code's table and the FMU in the folder, and compare them with what was certified."""
    found = Verification()
    code = code_for(content["code"], content["declared"])
    rows = {row.name: row for row in code.rows}
    chosen = [rows[name] for name in names if _as_the_table(folder, content, code, rows[name], found)]
    cases = [load_case(folder / case_name(row.name)) for row in chosen]
    tasks = [BenchTask(StudyCase.of(case.prepare()[0]), row.name) for row, case in zip(chosen, cases, strict=True)]
    with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
        for index, again in Work(executor, report=report).each(compute_row, tasks):
            row = chosen[index]
            fault, agreed = _compared(row, content, data, again)
            (found.faults if fault else found.agreed).append(f"row {row.name}{f': {fault}' if fault else agreed}")
    return found


def _as_the_table(folder: Path, content: dict[str, Any], code: GridCode, row: CodeRow, found: Verification) -> bool:
    """Whether the case file of a row is the one that the code's table and the certificate's values give."""
    binding = folder / BINDING if content["binding"] else None
    request = CertificationRequest(folder / FMU, binding, content["values"])
    with TemporaryDirectory(prefix="verify_") as place:
        lay_files(request, Path(place))
        made = write_row(request, row.name, row.title, row.programme(content["f_n"]), content["f_n"], Path(place))
        same = made.read_text(encoding="utf-8") == (folder / case_name(row.name)).read_text(encoding="utf-8")
    if not same:
        found.faults.append(
            f"{case_name(row.name)}: it is not what the table of {code.key} and the certified values give"
        )
    return same


def _compared(row: CodeRow, content: dict[str, Any], data: xr.Dataset, again: BenchResult) -> tuple[str, str]:
    """A fault, or otherwise words on what agrees."""
    if again.failure:
        return f"it cannot be computed again: {again.failure}", ""
    stated = next(entry for entry in content["rows"] if entry["row"] == row.name)
    kinds = [sorted({f["kind"] for f in findings} & UNSTABLE) for findings in (stated["findings"], again.findings)]
    if kinds[0] != kinds[1]:
        words = [", ".join(kind).replace("_", " ") or "nothing" for kind in kinds]
        return f"the watch finds {words[1]}, and {words[0]} was certified", ""
    until = min((float(f["time"]) for f in again.findings if f["kind"] in UNSTABLE), default=np.inf)
    times = data[f"time_{row.name}"].values
    before, part = int(np.sum(again.times < until)), int(np.sum(times < until))
    worst: list[str] = []
    for signal, values in again.signals.items():
        kept = data.data_vars.get(f"{row.name}.{signal}")
        fault = (
            f"{RESPONSES} does not hold it" if kept is None else differ_signal(kept.values[:part], values[:before])[0]
        )
        worst += [f"{signal}: {fault}"] if fault else []
    if worst:
        return "; ".join(worst), ""
    judged = judge_row(row, again, content["f_n"], stated["criteria"])
    criteria = [(f.criterion, bool(f.accepted)) for f in judged.findings]
    if criteria != [(entry["criterion"], bool(entry["accepted"])) for entry in stated["criteria"]]:
        return "its criteria come out otherwise than certified", ""
    said = "its response" if until == np.inf else f"its response to t = {until:g} s, from where on it fails"
    return "", f", computed anew: {said}, and its criteria"
