"""Points of a damping test, judged again from what a folder keeps of them, and computed anew."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.core.late import xr
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.certification.case_file import BASE, CASE, WITH, WITHOUT
from orchestrator.studies.certification.certificate import Certificate, DampingCertificate
from orchestrator.studies.certification.codes.nts631 import NTS
from orchestrator.studies.certification.compared import (
    TOLERANCE,
    TOLERANCE_IDENTIFIED,
    Compared,
    Content,
    Verification,
    differ_signal,
    request_of,
    said_of,
)
from orchestrator.studies.certification.criteria import ModeVerdict, judge_mode
from orchestrator.studies.certification.damping_controllers import (
    DampingControllers,
    damping_controllers,
)
from orchestrator.studies.certification.judgement import PointVerdict, judge
from orchestrator.studies.certification.pod_effect import kept_off, off_values, with_pod
from orchestrator.studies.certification.point import CONVERTER, CertificatePointTask, PointResult
from orchestrator.studies.certification.request import CertificationRequest, same_reactance
from orchestrator.studies.points.task import StudyCase


def rebuilt(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certificate:
    request = request_of(
        folder,
        content,
        reactances=responses["X_L"].values.tolist(),
        study_values=content["study_values"],
        black_box=content["black_box"],
    )
    description = bound_fmu(request.fmu, request.binding)
    controllers, event = _controllers(request, description, content), content["event_time"]
    points: dict[tuple[str, float], PointResult] = {}
    verdicts = []
    for point in content["points"]:
        having, lacking = (
            _point(point, scenario, content, responses) for scenario in (WITH, WITHOUT)
        )
        points |= {(result.scenario, result.X_L): result for result in (having, lacking)}
        verdicts.append(_verdict(point, having, lacking, controllers.pod, event))
    if any("pod" in point for point in content["points"]):  # until 0.3 they were not switched off
        verdicts = with_pod(verdicts, points, controllers, event)
    return DampingCertificate(
        request,
        description,
        code=NTS,
        f_n=NTS.f_n,
        verdicts=verdicts,
        results=points,
        case=folder / CASE,
        controllers=controllers,
        event_time=event,
    )


def _controllers(
    request: CertificationRequest, description: FmuDescription, content: dict[str, Any]
) -> DampingControllers:
    """Derived with ``--pod`` or without it; those that are stated where they follow from either."""
    found = []
    for given in (None, content["pod"]):
        try:
            again = CertificationRequest(request.fmu, request.binding, request.values, given)
            found.append(damping_controllers(description, again))
        except InputError:
            continue  # the switches contradict this one
    stated = (content["pod"], content["pod_source"], content["pod_values"])
    return next((one for one in found if (one.pod, one.source, one.settings) == stated), found[0])


def _point(
    point: dict[str, Any], scenario: str, content: dict[str, Any], responses: xr.Dataset
) -> PointResult:
    """Return what was computed of a point; its states' shapes are not kept, and so its modes have none."""
    having = scenario == WITH
    modes = [*point["modes"], *point["modes_beside"]] if having else point["modes_without"]
    kept = responses.sel(scenario=scenario, X_L=point["X_L"])
    signals = {
        str(name): values.values for name, values in kept.items() if not np.isnan(values).all()
    }
    shapes = np.empty((len(modes), 0), complex)
    values = np.array([_value(mode) for mode in modes], dtype=complex)
    result = PointResult(
        point["X_L"],
        scenario,
        ModeSet(values, shapes, shapes, ()),
        growth=_number(point["growth"][scenario]),
        stability=point["stability"][scenario],
        residual=_number(point.get("residual", {}).get(scenario)),
        times=responses["time"].values,
        signals=signals,
        warnings=tuple(point.get("warnings", {}).get(scenario, ())),
        findings=point.get("findings", {}).get(scenario, []),
        units={str(name): str(values.attrs.get("units", "")) for name, values in kept.items()},
    )
    return _with_converter(result, point, content) if having else result


def _number(stated: float | None) -> float:
    return np.nan if stated is None else stated


def _with_converter(
    result: PointResult, point: dict[str, Any], content: dict[str, Any]
) -> PointResult:
    """The result with the figures that only the point with the converter has."""
    model, sources = point["converter_model"], dict(content["linearised"])
    if model["source"] is not None:
        sources[CONVERTER] = model["source"]
    error = model["fit_error"]
    off = kept_off(point["pod"]) if "pod" in point else {}
    return replace(
        result,
        identified=model["order"],
        linearised=sources,
        fit_errors={} if error is None else {CONVERTER: error},
        power=point["power"],
        **off,
    )


def _verdict(
    point: dict[str, Any], having: PointResult, lacking: PointResult, pod: str, event: float
) -> PointVerdict:
    """Judged again; why it was not accepted or not judged is told in the words of then.

    Modes are matched by shapes, which are not kept: which mode was which without the converter is taken as stated. A
    point without a whole response failed or was not judged, and the reasons are taken as stated too."""
    again = judge(
        having,
        lacking,
        pod,
        event,
        [_matched(mode) for mode in (*point["modes"], *point["modes_beside"])],
    )
    if point["time_without"] is None:
        again = replace(again, base_time=None)
    faults, unknown = tuple(point["faults"]), point["unknown"]
    if point["time"] is None and (faults or unknown):
        return replace(again, time=None, faults=faults, unknown=unknown)
    same = (bool(again.faults), bool(again.unknown)) == (bool(faults), bool(unknown))
    stability = having.stability or {"stable": True}
    if again.unknown and faults and not unknown and stability["stable"] is None:
        same = True  # until 0.3 a point whose stability is not known was one that fails
    return replace(again, faults=faults, unknown=unknown) if same else again


def _matched(mode: dict[str, Any]) -> ModeVerdict:
    before = None if mode["without"] is None else _value(mode["without"])
    accepted, reason = judge_mode(_value(mode), before)
    told = mode["components"], mode.get("doubt", "")
    return ModeVerdict(_value(mode), before, mode["likeness"], accepted, reason, *told)


def _value(mode: dict[str, Any]) -> complex:
    return complex(mode["real"], mode["imag"])


def faults(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Iterator[str]:
    """Values of a damping test's case file that are others than the certificate's, and what it leaves out or adds."""
    stated = [point["X_L"] for point in content["points"]]
    left_out = [f"{X:g}" for X in responses["X_L"].values.tolist() if X not in stated]
    if left_out:
        yield f"the record has no points for the responses at X_L = {', '.join(left_out)} pu"
    for point in content["points"]:
        partners = [
            _value(mode["without"])
            for mode in (*point["modes"], *point["modes_beside"])
            if mode["without"]
        ]
        if not Counter(partners) <= Counter(_value(mode) for mode in point["modes_without"]):
            yield f"X_L = {point['X_L']:g} pu: a mode without the converter is none, or stands for two"
    own = {f"{CONVERTER}.{k}": v for k, v in {**content["values"], **content["pod_values"]}.items()}
    scenarios, base = (
        tomllib.loads(path.read_text(encoding="utf-8"))["scenarios"]
        for path in (folder / CASE, BASE)
    )
    for name, values in ((WITHOUT, {}), (WITH, own)):
        wanted = {**base[name].get("set", {}), **content["study_values"], **values}
        if scenarios[name].get("set", {}) != wanted:
            yield f"'values', 'study_values' or 'pod_values' are not those that {CASE} sets {name} the converter"


def choose(content: Content, wanted: Sequence[float] = (), *, every: bool = False) -> list[float]:
    """Reactances of the points that are computed anew [pu]; without a wish the one with the least damped mode."""
    points = content["points"]
    if not wanted:
        known = [p for p in points if p["modes"]] or points
        least = min(
            known, key=lambda p: min((m["damping_percent"] for m in p["modes"]), default=0.0)
        )
        return [p["X_L"] for p in (points if every else [least])]
    chosen = []
    for X_L in wanted:
        match = [p["X_L"] for p in points if same_reactance(p["X_L"], X_L)]
        if not match:
            there = ", ".join(f"{p['X_L']:g}" for p in points)
            raise InputError(f"the certificate has no point X_L = {X_L:g} pu; it has: {there}")
        chosen += match
    return chosen


def tasks(
    folder: Path, content: Content, reactances: Sequence[float], _: Verification
) -> list[Any]:
    """Each point with and without the converter."""
    case = load_case(folder / CASE)
    study = {
        name: StudyCase.of(case.prepare([name], {"grid.X_L": reactances[0]})[0])
        for name in (WITHOUT, WITH)
    }
    off = (
        off_values(content["pod"])
        if all(p.get("pod", {}).get("modes_off") for p in content["points"])
        else ()
    )
    return [
        task
        for X_L in reactances
        for task in (
            CertificatePointTask(study[WITHOUT], X_L),
            CertificatePointTask(study[WITH], X_L, bool(content["black_box"]), off),
        )
    ]


def compare(
    content: Content, task: CertificatePointTask, again: PointResult, data: xr.Dataset
) -> Compared:
    point = next(p for p in content["points"] if p["X_L"] == task.X_L)
    scenario, signal = task.scenario, content["signal"]
    where = f"X_L = {task.X_L:g} pu, {scenario} the converter"
    if again.failure or again.modes is None:
        yield f"{where}: it cannot be computed again: {again.failure or 'there are no modes'}", ""
        return
    stated = (
        point["modes_without"] if scenario == WITHOUT else [*point["modes"], *point["modes_beside"]]
    )
    identified = scenario == WITH and point["converter_model"]["source"] == "identified"
    tolerance = TOLERANCE_IDENTIFIED if identified else TOLERANCE
    yield from (
        (f"{where}: {text}", "") for text in _differ_figures(point, scenario, again, tolerance)
    )
    values = [complex(m["real"], m["imag"]) for m in stated]
    kept = data[signal].sel(scenario=scenario, X_L=task.X_L).values
    compared = [
        ("modes", _differ_modes(values, again.modes.eigenvalues.tolist(), tolerance)),
        (signal, differ_signal(kept, again.signals.get(signal, np.empty(0)))),
    ]
    if task.off:
        off = (
            [complex(*x) for x in point["pod"]["modes_off"]],
            [] if again.off is None else again.off.tolist(),
        )
        compared.append(("modes with POD off", _differ_modes(*off, tolerance)))
    for what, (fault, said) in compared:
        yield (f"{where}: {what}: {fault}", "") if fault else ("", f"{where}: {what}: {said}")


def _differ_figures(
    point: Content, scenario: str, again: PointResult, tolerance: float
) -> Iterator[str]:
    stated, growth = point["growth"][scenario], again.growth
    known = np.nan if stated is None else float(stated)
    if not (np.isnan(known) and np.isnan(growth)) and not abs(known - growth) <= tolerance * max(
        1.0, abs(growth)
    ):
        yield f"a largest growth rate of {growth:.6g} 1/s comes out and {known:.6g} 1/s was certified"
    verdicts = [s and s["stable"] for s in (point["stability"][scenario], again.stability)]
    if verdicts[0] != verdicts[1]:
        yield f"stable = {verdicts[1]} comes out and {verdicts[0]} was certified"
    if scenario == WITHOUT:
        return
    power = [np.nan if p is None else float(p) for p in (point["power"], again.power)]
    if not np.isnan(power).all() and not abs(power[0] - power[1]) <= TOLERANCE * max(
        1.0, abs(power[1])
    ):
        yield f"it feeds in {power[1]:.6g} MW at the start and {power[0]:.6g} MW was certified"
    model = point["converter_model"]
    if (model["source"], model["order"]) != (again.linearised.get(CONVERTER), again.identified):
        yield f"its linear model is {again.linearised.get(CONVERTER)!r} and {model['source']!r} was certified"


def _differ_modes(stated: list[complex], again: list[complex], tolerance: float) -> tuple[str, str]:
    if len(stated) != len(again):
        return f"{len(again)} come out and {len(stated)} were certified", ""
    first, second = (
        sorted(values, key=lambda v: (round(v.imag, 4), v.real)) for values in (stated, again)
    )
    differences = [
        (abs(a - b) / max(abs(a), 1e-9), a, b) for a, b in zip(first, second, strict=True)
    ]
    worst = max(
        differences, key=lambda d: np.inf if np.isnan(d[0]) else d[0], default=(0.0, 0j, 0j)
    )
    if not worst[0] <= tolerance:
        return f"{_mode_text(worst[2])} comes out and {_mode_text(worst[1])} was certified", ""
    return "", said_of(worst[0], tolerance)


def _mode_text(value: complex) -> str:
    return f"{value.imag / (2 * np.pi):.4f} Hz with {100 * damping_ratio(value):.4f} %"
