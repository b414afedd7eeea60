"""The verdict of a certificate, judged again from its own figures and responses."""

import math
from collections.abc import Iterator
from typing import Any

import xarray as xr

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.case_file import WITH, WITHOUT
from orchestrator.certification.criteria import is_judged, judge_mode, stability_fault
from orchestrator.certification.judgement import RATED_POWER, judge_response, watched
from orchestrator.certification.motion import motion_faults, not_judged
from orchestrator.certification.request import missing_reactances
from orchestrator.certification.verdict import FAILS, INCOMPLETE, PASSES

_SAME = 1e-9
"""Largest relative difference of a figure from its derivation from other figures."""


def rejudge(content: dict[str, Any], responses: xr.Dataset) -> list[str]:
    """Verdicts that do not follow from the figures."""
    faults = []
    if content["signal"] != watched(content["pod"]):
        faults.append(f"the signal {content['signal']} is not the one that is watched with POD {content['pod']!r}")
    for point in content["points"]:
        faults += [f"X_L = {point['X_L']:g} pu: {text}" for text in _of_point(point, content, responses)]
    return faults + _of_whole(content)


def _of_whole(content: dict[str, Any]) -> list[str]:
    points = content["points"]
    missing = missing_reactances(p["X_L"] for p in points if p["judged"])
    wanted = INCOMPLETE if missing or content["departures"] else PASSES
    if any(p["judged"] and not p["accepted"] for p in points):
        wanted = FAILS
    faults = []
    if content["verdict"] != wanted:
        faults.append(f"the verdict is {content['verdict']!r}; its points come to {wanted!r}")
    if content["passed"] is not (wanted == PASSES):
        faults.append(f"'passed' is {content['passed']}; its points come to {wanted!r}")
    if wanted not in content["sentence"]:
        faults.append(f"the sentence does not say {wanted!r}, to which its points come")
    report = content["acceptance"]
    if report is not None and report["trusted"] is any(r["verdict"] == "fail" for r in report["checks"]):
        faults.append("the acceptance tests say otherwise than their sum")
    return faults


def _of_point(point: dict[str, Any], content: dict[str, Any], responses: xr.Dataset) -> Iterator[str]:
    if not point["judged"]:
        return
    bad = not point["modes"]
    for mode in point["modes"]:
        yield from _of_mode(mode)
        accepted, _ = judge_mode(_value(mode), None if mode["without"] is None else _value(mode["without"]))
        if accepted is not mode["accepted"] or not is_judged(mode["frequency_hz"]):
            yield f"the mode at {mode['frequency_hz']:.3f} Hz is not judged as its figures say"
        bad |= not accepted
    for mode in (*point["modes_beside"], *point["modes_without"]):
        yield from _of_mode(mode)
    growth, stability = point["growth"], point["stability"]
    having, lacking = (math.nan if growth[name] is None else float(growth[name]) for name in (WITH, WITHOUT))
    bad |= stability_fault(having, lacking, stability[WITH], stability[WITHOUT]) is not None
    power = point["power"]
    bad |= power is None or not abs(power - RATED_POWER) <= 0.01 * RATED_POWER
    recorded = responses.sel(scenario=WITH, X_L=point["X_L"])
    signals = {str(name): values.values for name, values in recorded.items()}
    findings = point.get("findings", {}).get(WITH, ())
    bad |= any(motion_faults(responses["time"].values, signals, content["event_time"], findings))
    time = point["time"]
    if time is None:
        bad = True
    else:
        y = signals[content["signal"]]
        again = judge_response(responses["time"].values, y, content["signal"], content["event_time"])
        ratio = again.swings.ratio
        if again.accepted is not time["accepted"] or not _same(ratio, time["swings"]["ratio"]):
            yield f"the response gives {again.swings.reason}, and {time['swings']['reason']} is stated"
        bad |= not again.accepted
    if point["accepted"] and not_judged(findings):
        yield "it is stated as accepted, and the watch did not judge its whole response"
    if bad and point["accepted"]:
        yield "it is stated as accepted, and its figures do not meet the criteria"
    if point["accepted"] is bool(point["faults"]):
        yield "its faults and its verdict contradict each other"


def _of_mode(mode: dict[str, Any]) -> Iterator[str]:
    """A mode whose figures contradict each other."""
    value = _value(mode)
    derived = (value.imag / (2 * math.pi), 100 * damping_ratio(value))
    if not all(_same(a, mode[b]) for a, b in zip(derived, ("frequency_hz", "damping_percent"), strict=True)):
        yield f"the figures of the mode at {mode['frequency_hz']:.3f} Hz contradict each other"


def _value(mode: dict[str, Any]) -> complex:
    return complex(mode["real"], mode["imag"])


def _same(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=_SAME, abs_tol=1e-12)
