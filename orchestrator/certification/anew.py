"""Parts of a certificate, computed anew and compared with what was certified: points of the damping test, or rows of
another code."""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.analysis.modes import damping_ratio
from orchestrator.arrays import Numbers
from orchestrator.cases.case import load_case
from orchestrator.certification.case_file import BINDING, CASE, FMU, WITH, WITHOUT, lay_files
from orchestrator.certification.codes.all_codes import code_for
from orchestrator.certification.codes.bench_point import BenchResult, BenchTask, case_name, compute_row, write_row
from orchestrator.certification.codes.row import CodeRow, GridCode
from orchestrator.certification.codes.row_verdict import judge_row
from orchestrator.certification.files import RESPONSES
from orchestrator.certification.form import NORM
from orchestrator.certification.pod_effect import off_values
from orchestrator.certification.point import CONVERTER, CertificatePointTask, PointResult, compute_point
from orchestrator.certification.request import CertificationRequest, same_reactance
from orchestrator.certification.verification import Verification, read_certificate, verify_files
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import StudyCase, Task
from orchestrator.watch.finding import UNSTABLE

TOLERANCE = 1e-5
"""Largest difference of a recomputed eigenvalue relative to its size, and of a signal relative to its range. Different
processors round differently."""

TOLERANCE_IDENTIFIED = 1e-3
"""Largest relative difference of an eigenvalue if the system contains an identified model, whose fit amplifies
rounding."""

DRAWN = 1  # so many rows are drawn by chance beside the one with the narrowest margin

Content = Mapping[str, Any]
Compared = Iterator[tuple[str, str]]  # faults, or otherwise sentences on what agrees, one of both empty


@dataclass
class Parts:
    one: str  # what a part is called
    task: type[Task]
    times: int  # so many tasks each
    choose: Callable[..., list[Any]]  # from content, wishes and ``every``: the parts that are computed anew
    # tasks of the chosen parts of a folder; a verification takes what speaks against one before
    tasks: Callable[[Path, Content, Sequence[Any], Verification], Sequence[Any]]
    compute: Callable[[Any], Any]
    compare: Callable[[Content, Any, Any, xr.Dataset], Compared]  # with content, task, what was computed, responses

    def chosen(self, folder: Path, content: Content, wanted: Sequence[Any], *, every: bool) -> list[Any]:
        """Line reactances, or names of rows; ``wanted``: those that were asked for."""
        named = any(isinstance(one, str) for one in wanted)
        if self is POINTS and named:
            raise InputError(f"--rows: {folder} is the certificate of a damping test, which has points; give --points, "
                             "with line reactances")  # fmt: skip
        if wanted and self is ROWS and not named:
            raise InputError(f"--points: {folder} is the certificate of a grid code, which has rows; give --rows, with "
                             "their names")  # fmt: skip
        return self.choose(content, wanted, every=every)

    def verify(
        self, folder: Path, content: Content, chosen: Sequence[Any], executor: Executor, report: CountReport = nobody
    ) -> Verification:
        found = Verification()
        tasks = self.tasks(folder, content, chosen, found)
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            for index, again in Work(executor, report=report).each(self.compute, tasks):
                for fault, said in self.compare(content, tasks[index], again, data):
                    (found.faults if fault else found.agreed).append(fault or said)
        return found


def chosen_points(content: Content, wanted: Sequence[float] = (), *, every: bool = False) -> list[float]:
    """Reactances of the points that are computed anew [pu]; without a wish the one with the least damped mode."""
    points = content["points"]
    if not wanted:
        known = [p for p in points if p["modes"]] or points
        least = min(known, key=lambda p: min((m["damping_percent"] for m in p["modes"]), default=0.0))
        return [p["X_L"] for p in (points if every else [least])]
    chosen = []
    for X_L in wanted:
        match = [p["X_L"] for p in points if same_reactance(p["X_L"], X_L)]
        if not match:
            there = ", ".join(f"{p['X_L']:g}" for p in points)
            raise InputError(f"--points: the certificate has no X_L = {X_L:g} pu; it has: {there}")
        chosen += match
    return chosen


def _point_tasks(folder: Path, content: Content, reactances: Sequence[float], _: Verification) -> list[Any]:
    """Each point with and without the converter."""
    case = load_case(folder / CASE)
    study = {name: StudyCase.of(case.prepare([name], {"grid.X_L": reactances[0]})[0]) for name in (WITHOUT, WITH)}
    off = off_values(content["pod"]) if all(p.get("pod", {}).get("modes_off") for p in content["points"]) else ()
    return [task for X_L in reactances for task in (
        CertificatePointTask(study[WITHOUT], X_L),
        CertificatePointTask(study[WITH], X_L, bool(content["black_box"]), off),
    )]  # fmt: skip


def _compare_point(content: Content, task: CertificatePointTask, again: PointResult, data: xr.Dataset) -> Compared:
    point, scenario, signal = (
        next(p for p in content["points"] if p["X_L"] == task.X_L),
        task.scenario,
        content["signal"],
    )
    where = f"X_L = {task.X_L:g} pu, {scenario} the converter"
    if again.failure or again.modes is None:
        yield f"{where}: it cannot be computed again: {again.failure or 'there are no modes'}", ""
        return
    stated = point["modes_without"] if scenario == WITHOUT else [*point["modes"], *point["modes_beside"]]
    identified = scenario == WITH and point["converter_model"]["source"] == "identified"
    tolerance = TOLERANCE_IDENTIFIED if identified else TOLERANCE
    yield from ((f"{where}: {text}", "") for text in _differ_figures(point, scenario, again, tolerance))
    values = [complex(m["real"], m["imag"]) for m in stated]
    kept = data[signal].sel(scenario=scenario, X_L=task.X_L).values
    compared = [("modes", _differ_modes(values, again.modes.eigenvalues.tolist(), tolerance)),
                (signal, _differ_signal(kept, again.signals.get(signal, np.empty(0))))]  # fmt: skip
    if task.off:
        off = [complex(*x) for x in point["pod"]["modes_off"]], [] if again.off is None else again.off.tolist()
        compared.append(("modes with POD off", _differ_modes(*off, tolerance)))
    for what, (fault, said) in compared:
        yield (f"{where}: {what}: {fault}", "") if fault else ("", f"{where}: {what}: {said}")


def _differ_figures(point: Content, scenario: str, again: PointResult, tolerance: float) -> Iterator[str]:
    stated, growth = point["growth"][scenario], again.growth
    known = np.nan if stated is None else float(stated)
    if not (np.isnan(known) and np.isnan(growth)) and not abs(known - growth) <= tolerance * max(1.0, abs(growth)):
        yield f"a largest growth rate of {growth:.6g} 1/s comes out and {known:.6g} 1/s was certified"
    verdicts = [s and s["stable"] for s in (point["stability"][scenario], again.stability)]
    if verdicts[0] != verdicts[1]:
        yield f"stable = {verdicts[1]} comes out and {verdicts[0]} was certified"
    if scenario == WITHOUT:
        return
    power = [np.nan if p is None else float(p) for p in (point["power"], again.power)]
    if not np.isnan(power).all() and not abs(power[0] - power[1]) <= TOLERANCE * max(1.0, abs(power[1])):
        yield f"it feeds in {power[1]:.6g} MW at the start and {power[0]:.6g} MW was certified"
    model = point["converter_model"]
    if (model["source"], model["order"]) != (again.linearised.get(CONVERTER), again.identified):
        yield f"its linear model is {again.linearised.get(CONVERTER)!r} and {model['source']!r} was certified"


def _differ_modes(stated: list[complex], again: list[complex], tolerance: float) -> tuple[str, str]:
    if len(stated) != len(again):
        return f"{len(again)} come out and {len(stated)} were certified", ""
    first, second = (sorted(values, key=lambda v: (round(v.imag, 4), v.real)) for values in (stated, again))
    differences = [(abs(a - b) / max(abs(a), 1e-9), a, b) for a, b in zip(first, second, strict=True)]
    worst = max(differences, key=lambda d: np.inf if np.isnan(d[0]) else d[0], default=(0.0, 0j, 0j))
    if not worst[0] <= tolerance:
        return f"{_shown(worst[2])} comes out and {_shown(worst[1])} was certified", ""
    return "", _said(worst[0], tolerance)


def _shown(value: complex) -> str:
    return f"{value.imag / (2 * np.pi):.4f} Hz with {100 * damping_ratio(value):.4f} %"


def _differ_signal(kept: Numbers, again: Numbers) -> tuple[str, str]:
    if kept.shape != again.shape:
        return f"{len(again)} instants come out and {len(kept)} were certified", ""
    span = float(np.ptp(kept)) or 1.0
    worst = float(np.abs(kept - again).max(initial=0.0)) / span
    if not worst <= TOLERANCE:
        return f"it differs by up to {worst:.1e} of its range; {TOLERANCE:g} is allowed", ""
    return "", _said(worst, TOLERANCE)


def _said(difference: float, tolerance: float) -> str:
    if difference == 0.0:
        return "the same to the last digit"
    return f"the digits differ, by {difference:.1e} at most; {tolerance:g} is allowed"


def chosen_rows(content: Content, wanted: Sequence[str] = (), *, every: bool = False) -> list[str]:
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


def _row_tasks(folder: Path, content: Content, names: Sequence[str], found: Verification) -> list[Any]:
    """Rows whose case file is the one that the code's table and the certificate's values give."""
    code = code_for(content["code"], content["declared"])
    rows = {row.name: row for row in code.rows}
    chosen = [name for name in names if _as_the_table(folder, content, code, rows[name], found)]
    return [BenchTask(StudyCase.of(load_case(folder / case_name(name)).prepare()[0]), name) for name in chosen]


def _as_the_table(folder: Path, content: Content, code: GridCode, row: CodeRow, found: Verification) -> bool:
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


def _compare_row(content: Content, task: BenchTask, again: BenchResult, data: xr.Dataset) -> Compared:
    row = next(row for row in code_for(content["code"], content["declared"]).rows if row.name == task.row)
    until = min((float(f["time"]) for f in again.findings if f["kind"] in UNSTABLE), default=np.inf)
    if fault := _fault_of_row(content, row, again, data, until):
        yield f"row {row.name}: {fault}", ""
    else:
        said = "its response" if until == np.inf else f"its response to t = {until:g} s, from where on it fails"
        yield "", f"row {row.name}, computed anew: {said}, and its criteria"


def _fault_of_row(content: Content, row: CodeRow, again: BenchResult, data: xr.Dataset, until: float) -> str:
    """Why it does not come out as certified; responses are compared until something goes wrong in them [s]."""
    if again.failure:
        return f"it cannot be computed again: {again.failure}"
    stated = next(entry for entry in content["rows"] if entry["row"] == row.name)
    kinds = [sorted({f["kind"] for f in findings} & UNSTABLE) for findings in (stated["findings"], again.findings)]
    if kinds[0] != kinds[1]:
        words = [", ".join(kind).replace("_", " ") or "nothing" for kind in kinds]
        return f"the watch finds {words[1]}, and {words[0]} was certified"
    before, part = int(np.sum(again.times < until)), int(np.sum(data[f"time_{row.name}"].values < until))
    worst = []
    for signal, values in again.signals.items():
        kept = data.data_vars.get(f"{row.name}.{signal}")
        fault = f"{RESPONSES} does not hold it"
        if kept is not None:
            fault, _ = _differ_signal(kept.values[:part], values[:before])
        worst += [f"{signal}: {fault}"] if fault else []
    judged = judge_row(row, again, content["f_n"], stated["criteria"])
    criteria = [(f.criterion, bool(f.accepted)) for f in judged.findings]
    if not worst and criteria != [(entry["criterion"], bool(entry["accepted"])) for entry in stated["criteria"]]:
        return "its criteria come out otherwise than certified"
    return "; ".join(worst)


POINTS = Parts("point", CertificatePointTask, 2, chosen_points, _point_tasks, compute_point, _compare_point)
ROWS = Parts("row", BenchTask, 1, chosen_rows, _row_tasks, compute_row, _compare_row)


def parts_of(content: Content) -> Parts:
    return POINTS if content["format"] == NORM else ROWS


@dataclass(kw_only=True)
class Verified(Verification):
    """A certificate with what was said of it; ``computed`` are the parts that were computed anew."""

    content: Content
    parts: Parts
    chosen: list[Any]
    computed: list[Any]


def verified(
    place: Path, wanted: Sequence[Any] | None, executor: Callable[[list[str]], Executor], report: CountReport = nobody,
    *, every: bool = False,
) -> Verified:  # fmt: skip
    """Verify the files of a certificate, and, if they hold, parts computed anew: by default those that count most.

    ``wanted``: no part where it is empty and ``every`` is not asked for; ``executor``: made of a worker's imports."""
    folder, content = read_certificate(place)
    parts = parts_of(content)
    chosen = [] if wanted == () and not every else parts.chosen(folder, content, wanted or (), every=every)
    files = verify_files(folder, content)
    found = Verified(
        faults=files.faults, agreed=files.agreed, content=content, parts=parts, chosen=chosen,
        computed=chosen if files.holds else [],
    )  # fmt: skip
    if found.computed:
        with closing(executor([parts.task.__module__])) as workers:
            again = parts.verify(folder, content, chosen, workers, report)
        found.faults, found.agreed = found.faults + again.faults, found.agreed + again.agreed
    return found
