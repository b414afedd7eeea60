"""The contents of a certificate as JSON: the verdicts with their figures, and the data that a verification needs."""

import math
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.case_file import WITH, WITHOUT
from orchestrator.certification.criteria import ModeVerdict
from orchestrator.certification.environment import environment
from orchestrator.certification.judgement import PointVerdict, TimeVerdict
from orchestrator.certification.parameters import parameter_rows
from orchestrator.certification.point import CONVERTER, PointResult
from orchestrator.certification.recompute import commands
from orchestrator.certification.request import REACTANCES
from orchestrator.certification.study import Certification
from orchestrator.certification.swings import RecordedSwing, SwingTest
from orchestrator.fmi.origin import read_origin
from orchestrator.results.mode_json import eigenvalue_json

FORMAT = 2


def certification_json(c: Certification) -> dict[str, Any]:
    """All verdicts with their figures, and the description of the test."""
    return {
        "format": FORMAT,
        "norm": "Norma técnica de supervisión 631 v2.0 (2020), section 5.10",
        "tool": f"gfor-cosim {version('gfor-cosim')}",
        "verdict": c.verdict,
        "passed": c.passed,
        "sentence": c.sentence(),
        "judged": f"{len(REACTANCES) - len(c.missing)} of {len(REACTANCES)}",
        "missing": list(c.missing),
        "departures": list(c.request.departures),
        "details": asdict(c.details),
        "fmu": {"file": c.request.fmu.name, "model": c.description.model_name, "guid": c.description.guid}
        | asdict(read_origin(c.description.path)),
        "binding": c.request.binding.name if c.request.binding else None,
        "values": dict(c.request.values),
        "study_values": dict(c.request.study_values),
        "black_box": c.request.black_box,
        "pod": c.pod,
        "pod_source": c.controllers.source,
        "pod_values": dict(c.controllers.settings),
        "parameters": [asdict(row) for row in parameter_rows(c)],
        "acceptance": None if c.acceptance is None else dict(c.acceptance.report),
        "signal": c.signal,
        "event_time": c.event_time,
        "linearised": c.linearised,
        "fit_errors": c.fit_errors,
        "environment": environment(),
        "points": [_point_json(c, v) for v in c.verdicts],
    }


def _point_json(c: Certification, v: PointVerdict) -> dict[str, Any]:
    points = {name: c.points[name, v.X_L] for name in (WITHOUT, WITH)}
    having, without = points[WITH], points[WITHOUT].modes
    return {
        "X_L": v.X_L,
        "accepted": v.accepted,
        "judged": v.judged,
        "faults": list(v.faults),
        "unknown": v.unknown,
        "modes": [mode_json(m) for m in v.modes],
        "modes_beside": [mode_json(m) for m in v.neighbours],
        "modes_without": [] if without is None else [_figures(x) for x in without.eigenvalues.tolist()],
        "lowered": [_lowered_json(m) for m in v.lowered],
        "growth": {name: number(p.growth) for name, p in points.items()},
        "stability": {name: p.stability for name, p in points.items()},
        "residual": {name: number(p.residual) for name, p in points.items()},
        "power": having.power,
        "findings": {name: p.findings for name, p in points.items()},
        "converter_model": _model_json(having),
        "warnings": {name: list(p.warnings) for name, p in points.items()},
        "time": None if v.time is None else time_json(v.time),
        "time_without": None if v.base_time is None else time_json(v.base_time),
        "again": {n: commands(v.X_L, n, identified=having.identified is not None) for n in points},
    }


def number(value: float) -> float | None:
    """Plain values for JSON, which has no NaN."""
    return value if math.isfinite(value) else None


def _model_json(point: PointResult) -> dict[str, Any]:
    error = point.fit_errors.get(CONVERTER)
    return {"source": point.linearised.get(CONVERTER), "order": point.identified, "fit_error": error}


def mode_json(m: ModeVerdict) -> dict[str, Any]:
    """A mode with the converter, and what it was without."""
    without = None if m.before is None else _figures(m.before)
    return _figures(m.eigenvalue) | {
        "without": without,
        "likeness": m.similarity,
        "components": m.components,
        "accepted": m.accepted,
        "reason": m.reason,
    }


def _lowered_json(m: ModeVerdict) -> dict[str, Any]:
    return {"frequency_hz": m.frequency_hz, "from_percent": m.before_percent, "to_percent": m.damping_percent}


def _figures(value: complex) -> dict[str, float]:
    """An eigenvalue [rad/s]."""
    return eigenvalue_json(value, 100 * damping_ratio(value))


def time_json(time: TimeVerdict) -> dict[str, Any]:
    """The time-domain criterion on one response."""
    modal = [_figures(m.eigenvalue) | {"amplitude": m.amplitude} for m in time.modal.modes]
    return {
        "signal": time.signal,
        "accepted": time.accepted,
        "swings": _swings_json(time.swings),
        "swings_with_first_extremum": _swings_json(time.other_reading),
        "modal": {"accepted": time.modal.accepted, "reason": time.modal.reason, "modes": modal},
    }


def _swings_json(test: SwingTest) -> dict[str, Any]:
    return {
        "accepted": test.accepted,
        "reason": test.reason,
        "ratio": test.ratio,
        "dropped": asdict(test.dropped) if test.dropped else None,
        "swings": [_swing_json(s) for s in test.swings],
    }


def _swing_json(s: RecordedSwing) -> dict[str, Any]:
    points = {"P": s.before, "M": s.minimum, "P_next": s.after}
    return {"k": s.number, "line": s.line, "depth": s.depth} | {n: [p.time, p.value] for n, p in points.items()}
