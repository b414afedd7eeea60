"""Effect of the active damping controllers at a point: its modes with them off, and whether the response shows it."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.signals.identification import identify_modes
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.output.report.html.elements import number, table
from orchestrator.studies.certification.case_file import WITH
from orchestrator.studies.certification.criteria import AGREED, NAMES, PodEffect
from orchestrator.studies.certification.damping_controllers import DampingControllers, variable
from orchestrator.studies.certification.judgement import PointVerdict
from orchestrator.studies.certification.point import CONVERTER, POWER, PointResult
from orchestrator.studies.certification.swings import slow_part

# by so many points they have to raise the electromechanical mode's damping, where it is least
# without
RAISED = 0.1
# a response that the modes without them fit so many times better is not that of the modes with them
TWICE = 2.0
# change of the frequency up to which it is known to be the same mode, in parts of it
_RELATED = 0.3
_WINDOW = (0.5, 10.5)  # of the response, after the event [s]
_EVERY = 10  # so many samples apart are those that are fitted
_SLOW = (0.0, 0.1, 1.0)  # decay of what does not swing [1/s]


def off_values(pod: str) -> tuple[tuple[str, bool], ...]:
    return tuple((f"{CONVERTER}.{variable(letter)}", False) for letter in pod.removeprefix("none"))


def kept_off(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a certificate states, as a `PointResult` has it."""
    if stated["unknown"]:
        return {"off_failure": stated["unknown"]}
    modal = [stated["modal"][k] for k in ("off", "on")]
    named = [complex(x["real"], x["imag"]) if x else np.nan for x in modal]
    return {
        "off": np.array([complex(*x) for x in stated["modes_off"]]),
        "swings": np.array(named, dtype=complex),
    }


def with_pod(
    verdicts: Sequence[PointVerdict],
    points: Mapping[Any, PointResult],
    controllers: DampingControllers,
    event: float,
) -> list[PointVerdict]:
    """The verdicts with what the active controllers change.

    They have to damp where the mode needs it most, and in the response as at the eigenvalues."""
    name = " and ".join(f"POD-{letter.upper()}" for letter in controllers.pod.removeprefix("none"))
    if not name:
        return list(verdicts)
    why = (
        ""
        if controllers.can_be_off
        else "no switch turns it off; name the FMU's under [signals] of a binding"
    )
    effects = [_effect(points[WITH, v.X_L], event, why) for v in verdicts]
    known = [damping_percent(pod.modes["off"]) if "off" in pod.modes else np.inf for pod in effects]
    judged = []
    for v, pod, least in zip(verdicts, effects, known, strict=True):
        said = []
        if (pod.better_off or 0.0) > TWICE:
            said = [
                f"{name} acts otherwise in the response than at the eigenvalues: the modes without it fit {POWER} "
                f"{pod.better_off:.3g} times better"
            ]
        by = pod.apart("on", "off") or 0.0
        if least == min(known) < np.inf and by < RAISED:
            told = f"{least:.2f} % without, {by:+.2f} points with it"
            said.append(f"{name} does not damp the electromechanical mode: {told}")
        faults = tuple(dict.fromkeys((*v.faults, *said)))
        unknown = v.unknown or (
            f"what {name} changes is not known: {pod.unknown}" if pod.unknown else ""
        )
        judged.append(replace(v, faults=faults, unknown="" if faults else unknown, pod=pod))
    return judged


def _effect(point: PointResult, event: float, why: str) -> PodEffect:
    modes: dict[str, complex] = {}
    if point.off is None or point.modes is None:
        why = point.off_failure or why or str(point.failure or "it has no modes")
        return PodEffect(np.empty(0, complex), modes, None, why)
    if (
        np.ptp(point.swings.imag) <= _RELATED * point.swings[0].imag
        and not np.isnan(point.swings).any()
    ):
        listed = zip(("off", "on"), (point.off, point.modes.eigenvalues), point.swings, strict=True)
        modes |= {name: complex(own[np.abs(own - x).argmin()]) for name, own, x in listed}
    window = (point.times >= event + _WINDOW[0]) & (point.times <= event + _WINDOW[1])
    signal = point.signals.get(POWER)
    if point.failure or signal is None or not np.isfinite(signal).all() or window.sum() < 99:
        return PodEffect(point.off, modes)
    # as it is kept
    t, y = (
        point.times[window],
        slow_part(point.times, signal.astype(np.float32).astype(float))[window],
    )
    with suppress(AnalysisError):  # it does not swing
        found = (
            [m.eigenvalue for m in identify_modes(t, y) if m.eigenvalue.imag > 0] if modes else []
        )
        if found:
            modes["response"] = complex(min(found, key=lambda x: abs(x - modes["on"])))
    with_it, without = (
        _misfit(t[::_EVERY] - t[0], y[::_EVERY], x) for x in (point.modes.eigenvalues, point.off)
    )
    return PodEffect(point.off, modes, with_it / without if without > 0 else None)


def _misfit(t: Numbers, y: Numbers, eigenvalues: Complex) -> float:
    """Return what is left of a signal when swings of these eigenvalues, and slow decays, are taken away."""
    swings = np.exp(np.outer(t, eigenvalues))
    columns = np.hstack([np.exp(-np.outer(t, _SLOW)), swings.real, swings.imag])
    columns /= np.linalg.norm(columns, axis=0)
    return float(np.linalg.norm(y - columns @ np.linalg.lstsq(columns, y, rcond=1e-6)[0]))


def pod_section(verdicts: Sequence[PointVerdict]) -> str:
    rows = []
    for X_L, pod in ((f"{v.X_L:g}", v.pod) for v in verdicts if v.pod):
        named = {
            k: f"{x.imag / (2 * np.pi):.3f} Hz, {number(damping_percent(x), 2)} %"
            for k, x in pod.modes.items()
        }
        change, better = (
            "–" if x is None else number(x, 2) for x in (pod.apart("on", "off"), pod.better_off)
        )
        said = {None: "–", True: "<b>yes</b>", False: "no"}[pod.disagrees]
        rows.append([X_L, *(named.get(k, "–") for k in NAMES), said, change, better])
    columns = [
        "X_L [pu]",
        "Off",
        "On",
        "In SG1's power",
        "It disagrees",
        "Raised by [points]",
        "Off fits better",
    ]
    note = (
        f"<p>Where it is damped least with them off they have to raise it by {RAISED:g} points; nowhere may the "
        f"modes with them off fit SG1's power more than {TWICE:g} times better. More than {AGREED:g} points "
        "between the dampings of eigenvalue and power are a finding. A dash: it is not known.</p>"
    )
    return (
        table("The electromechanical mode", columns, rows) + note
        if rows
        else "<p>None is active.</p>"
    )
