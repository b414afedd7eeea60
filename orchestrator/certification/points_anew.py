"""Points of a damping test, computed anew and compared with what was certified."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.analysis.modes import damping_ratio
from orchestrator.arrays import Numbers
from orchestrator.cases.case import load_case
from orchestrator.certification.case_file import CASE, WITH, WITHOUT
from orchestrator.certification.files import RESPONSES
from orchestrator.certification.point import CONVERTER, CertificatePointTask, PointResult, compute_point
from orchestrator.certification.request import same_reactance
from orchestrator.certification.verification import Verification
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport, Work, nobody
from orchestrator.points.task import StudyCase

TOLERANCE = 1e-5
"""Largest difference of a recomputed eigenvalue relative to its size, and of a signal relative to its range. Different
processors round differently."""

TOLERANCE_IDENTIFIED = 1e-3
"""Largest relative difference of an eigenvalue if the system contains an identified model, whose fit amplifies
rounding."""


def chosen_points(content: dict[str, Any], wanted: Sequence[float] = (), *, every: bool = False) -> list[float]:
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


def verify_points(
    folder: Path, content: dict[str, Any], reactances: Sequence[float], executor: Executor, report: CountReport = nobody
) -> Verification:
    found = Verification()
    case = load_case(folder / CASE)
    study = {name: StudyCase.of(case.prepare([name], {"grid.X_L": reactances[0]})[0]) for name in (WITHOUT, WITH)}
    points = {p["X_L"]: p for p in content["points"]}
    tasks = [CertificatePointTask(study[scenario], X_L, bool(content["black_box"]) and scenario == WITH)
             for X_L in reactances for scenario in (WITHOUT, WITH)]  # fmt: skip
    with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
        for index, again in Work(executor, report=report).each(compute_point, tasks):
            task = tasks[index]
            _compare_point(points[task.X_L], task.scenario, again, data, str(content["signal"]), found)
    return found


def _compare_point(
    point: dict[str, Any], scenario: str, again: PointResult, data: xr.Dataset, signal: str, found: Verification
) -> None:
    where = f"X_L = {point['X_L']:g} pu, {scenario} the converter"
    if again.failure or again.modes is None:
        found.faults.append(f"{where}: it cannot be computed again: {again.failure or 'there are no modes'}")
        return
    stated = [complex(m["real"], m["imag"]) for m in _stated_modes(point, scenario)]
    identified = scenario == WITH and point["converter_model"]["source"] == "identified"
    tolerance = TOLERANCE_IDENTIFIED if identified else TOLERANCE
    modes = _differ_modes(stated, again.modes.eigenvalues.tolist(), tolerance)
    kept = data[signal].sel(scenario=scenario, X_L=point["X_L"]).values
    response = differ_signal(kept, again.signals.get(signal, np.empty(0)))
    found.faults += [f"{where}: {text}" for text in _differ_figures(point, scenario, again, tolerance)]
    for what, (fault, said) in (("modes", modes), (signal, response)):
        (found.faults if fault else found.agreed).append(f"{where}: {what}: {fault or said}")


def _differ_figures(point: dict[str, Any], scenario: str, again: PointResult, tolerance: float) -> Iterator[str]:
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


def _stated_modes(point: dict[str, Any], scenario: str) -> list[dict[str, Any]]:
    return list(point["modes_without"] if scenario == WITHOUT else [*point["modes"], *point["modes_beside"]])


def _differ_modes(stated: list[complex], again: list[complex], tolerance: float) -> tuple[str, str]:
    if len(stated) != len(again):
        return f"{len(again)} come out and {len(stated)} were certified", ""
    pairs = zip(_sorted(stated), _sorted(again), strict=True)
    differences = [(abs(a - b) / max(abs(a), 1e-9), a, b) for a, b in pairs]
    worst = max(differences, key=lambda d: np.inf if np.isnan(d[0]) else d[0], default=(0.0, 0j, 0j))
    if not worst[0] <= tolerance:
        return f"{_shown(worst[2])} comes out and {_shown(worst[1])} was certified", ""
    return "", _said(worst[0], tolerance)


def _sorted(values: list[complex]) -> list[complex]:
    return sorted(values, key=lambda v: (round(v.imag, 4), v.real))


def _shown(value: complex) -> str:
    hz, ratio = value.imag / (2 * np.pi), damping_ratio(value)
    return f"{hz:.4f} Hz with {100 * ratio:.4f} %"


def differ_signal(kept: Numbers, again: Numbers) -> tuple[str, str]:
    """A fault, or otherwise a sentence on the difference, of a signal that was certified and of the same anew."""
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
