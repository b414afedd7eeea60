"""Rows of a code, judged again from what a folder keeps of them, and computed anew."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from orchestrator.cases.case import load_case
from orchestrator.core.errors import ErrorKind, InputError
from orchestrator.core.late import xr
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.simulation.watch.finding import BENCH_RESONANCE, UNSTABLE
from orchestrator.studies.certification.case_file import lay_files
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.bench_point import (
    BenchResult,
    BenchTask,
    case_name,
    declared_limit,
    write_row,
)
from orchestrator.studies.certification.codes.known import code_for, tables
from orchestrator.studies.certification.codes.row import CodeRow, GridCode
from orchestrator.studies.certification.codes.row_verdict import judge_row
from orchestrator.studies.certification.compared import (
    Compared,
    Content,
    Verification,
    differ_signal,
    issued_by,
    request_of,
)
from orchestrator.studies.certification.files import RESPONSES
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.task import StudyCase

DRAWN = 1  # so many rows are drawn by chance beside the one with the narrowest margin


def later(content: Content) -> tuple[str, ...]:
    """Rows that the code's table has, and had not in the version of this program that issued the record."""
    return code_for(content["code"], content["declared"]).later(issued_by(content))


def _table(content: Content) -> GridCode[CodeRow]:
    return code_for(content["code"], content["declared"]).of_version(issued_by(content))


def rebuilt(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certificate:
    code, request = _table(content), request_of(folder, content)
    stated = {row["row"]: row for row in content["rows"]}
    rows = [
        row for row in code.rows if row.name in stated or f"time_{row.name}" in responses.coords
    ]
    if not rows:
        raise InputError(
            f"the table of {code.key} has none of the rows that the record and {RESPONSES} have"
        )
    description = bound_fmu(request.fmu, request.binding)
    results = {row.name: _response(row.name, stated.get(row.name), responses) for row in rows}
    for result in results.values():
        result.current_limit = declared_limit(description)
    verdicts = [
        judge_row(row, results[row.name], content["f_n"], stated.get(row.name, {}).get("criteria"))
        for row in rows
    ]
    case = folder / case_name(rows[0].name)
    return Certificate(
        request,
        description,
        code=code,
        f_n=content["f_n"],
        verdicts=verdicts,
        results=results,
        case=case,
    )


def _response(row: str, stated: dict[str, Any] | None, responses: xr.Dataset) -> BenchResult:
    said = stated or {"unknown": "", "findings": []}
    why = said["unknown"]
    if why:
        return BenchResult(
            row, findings=said["findings"], failure=Failure(ErrorKind.OTHER, why, False)
        )
    prefix = f"{row}."
    signals = {
        str(n).removeprefix(prefix): v.values
        for n, v in responses.data_vars.items()
        if str(n).startswith(prefix)
    }
    return BenchResult(row, responses[f"time_{row}"].values, signals, said["findings"])


def faults(folder: Path, content: dict[str, Any], data: xr.Dataset) -> list[str]:
    """Rows of the record against the code's table, the files and the responses: `gfor certify` writes all of a table.

    Row files of another code may lie in the folder, from an earlier certificate; those of the record's files may not.
    """
    code = _table(content)
    codes = [*tables().values(), code]
    recorded, table = [row["row"] for row in content["rows"]], [row.name for row in code.rows]
    own = {*content["files"], *(case_name(row.name) for code in codes for row in code.rows)}
    files = [
        name.removeprefix("row_").removesuffix(".toml")
        for name in content["files"]
        if name.startswith("row_")
    ]
    kept = [str(name).removeprefix("time_") for name in data.coords]
    of_record = {
        "rows of the code's table that the record has not": table,
        "files of rows that the record has not": files,
        f"rows of {RESPONSES} that the record has not": kept,
    }
    compared = [
        (what, [name for name in names if name not in recorded])
        for what, names in of_record.items()
    ]
    strangers = sorted(path.name for path in folder.glob("row_*.toml") if path.name not in own)
    faults = [f"{what}: {', '.join(names)}" for what, names in compared if names]
    faults += [
        f"{name}: the record does not know it; take it away, or certify anew" for name in strangers
    ]
    return faults + [
        f"{case_name(name)}: it is not what the table of {code.key} and the certified values give"
        for name in _otherwise(folder, content, code)
    ]


def _otherwise(folder: Path, content: Content, code: GridCode[CodeRow]) -> list[str]:
    """Rows whose case file is not the one that the code's table and the certificate's values give."""
    request, f_n = request_of(folder, content), content["f_n"]
    rows = [row for row in code.rows if (folder / case_name(row.name)).is_file()]
    with TemporaryDirectory(prefix="verify_") as place:
        lay_files(request, Path(place))
        made = {
            row.name: write_row(request, row.name, row.title, row.programme(f_n), f_n, Path(place))
            for row in rows
        }
        return [
            name
            for name, path in made.items()
            if path.read_bytes() != (folder / path.name).read_bytes()
        ]


def choose(content: Content, wanted: Sequence[str] = (), *, every: bool = False) -> list[str]:
    """Names of the rows that are computed anew.

    ``wanted``: Names that were asked for; where empty, the row with the narrowest margin that is met, and `DRAWN`
    others that chance draws, so that nobody knows them beforehand."""
    known = [stated["row"] for stated in content["rows"] if not stated["unknown"]]
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise InputError(f"the certificate has no row {unknown[0]!r}; it has: {', '.join(known)}")
    if every or wanted:
        return list(wanted) or known
    margins = [
        (criterion["margin"], stated["row"])
        for stated in content["rows"]
        if stated["accepted"]
        for criterion in stated["criteria"]
        if criterion["margin"] is not None
    ]
    narrowest = [min(margins)[1]] if margins else known[:1]
    others = [name for name in known if name not in narrowest]
    return narrowest + random.SystemRandom().sample(others, min(DRAWN, len(others)))


def tasks(folder: Path, _content: Content, names: Sequence[str], _found: Verification) -> list[Any]:
    return [
        BenchTask(StudyCase.of(load_case(folder / case_name(name)).prepare()[0]), name)
        for name in names
    ]


def compare(content: Content, task: BenchTask, again: BenchResult, data: xr.Dataset) -> Compared:
    row = next(
        row for row in code_for(content["code"], content["declared"]).rows if row.name == task.row
    )
    until = min((float(f["time"]) for f in again.findings if f["kind"] in UNSTABLE), default=np.inf)
    fault = _fault_of_row(content, row, again, data, until)
    if fault:
        yield f"row {row.name}: {fault}", ""
    else:
        said = (
            "its response"
            if until == np.inf
            else f"its response to t = {until:g} s, from where on it fails"
        )
        yield "", f"row {row.name}, computed anew: {said}, and its criteria"


def _fault_of_row(
    content: Content, row: CodeRow, again: BenchResult, data: xr.Dataset, until: float
) -> str:
    """Why it does not come out as certified; responses are compared until something goes wrong in them [s]."""
    if again.failure:
        return f"it cannot be computed again: {again.failure}"
    stated = next(entry for entry in content["rows"] if entry["row"] == row.name)
    kinds = [
        sorted({f["kind"] for f in findings} & {*UNSTABLE, BENCH_RESONANCE})
        for findings in (stated["findings"], again.findings)
    ]
    if kinds[0] != kinds[1]:
        words = [", ".join(kind).replace("_", " ") or "nothing" for kind in kinds]
        return f"the watch finds {words[1]}, and {words[0]} was certified"
    before, part = (
        int(np.sum(again.times < until)),
        int(np.sum(data[f"time_{row.name}"].values < until)),
    )
    worst = []
    for signal, values in again.signals.items():
        kept = data.data_vars.get(f"{row.name}.{signal}")
        fault = f"{RESPONSES} does not hold it"
        if kept is not None:
            fault, _ = differ_signal(kept.values[:part], values[:before])
        worst += [f"{signal}: {fault}"] if fault else []
    judged = judge_row(row, again, content["f_n"], stated["criteria"])
    criteria = [(f.criterion, bool(f.accepted)) for f in judged.findings]
    if not worst and criteria != [
        (entry["criterion"], bool(entry["accepted"])) for entry in stated["criteria"]
    ]:
        return "its criteria come out otherwise than certified"
    return "; ".join(worst)
