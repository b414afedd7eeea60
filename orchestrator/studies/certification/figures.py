"""The contents of a certificate as JSON: the verdicts with their figures, and the data that a verification needs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fmus.toolchain.extras import installed_version
from orchestrator.core.late import xr
from orchestrator.devices.fmi.archive import read_origin
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo
from orchestrator.devices.fmi.port_mapping import START, BoundDescription, without_binding
from orchestrator.devices.fmi.values import Scalar
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.studies.certification.case_file import CASE, WITH, WITHOUT
from orchestrator.studies.certification.certificate import (
    Certificate,
    DampingCertificate,
    missing_of,
)
from orchestrator.studies.certification.criteria import ModeVerdict
from orchestrator.studies.certification.form import NORM
from orchestrator.studies.certification.judgement import PointVerdict, TimeVerdict
from orchestrator.studies.certification.point import COMPUTED, CONVERTER
from orchestrator.studies.certification.request import REACTANCES
from orchestrator.studies.certification.swings import RecordedSwing, SwingTest


@dataclass(frozen=True)
class ParameterRow:
    name: str
    unit: str
    start: Scalar | None
    used: Scalar | None
    changed_by: str
    description: str


def parameter_rows(c: Certificate) -> list[ParameterRow]:
    """Parameters, and inputs that are held, in the order of the file."""
    values = {own: (value, by) for own, value, by in _values(c, c.description)}
    rows = []
    for info in without_binding(c.description).variables.values():
        if info.causality == "parameter" or info.name in values:
            start = _start(info)
            used, by = values.get(info.name, (start, ""))
            rows.append(ParameterRow(info.name, info.unit, start, used, by, info.description))
    return rows


def _start(info: VariableInfo) -> Scalar | None:
    """Return the start value as reports have it: all numbers as floats, items of an enumeration as text."""
    if info.start is None or isinstance(info.start, bool | str):
        return info.start
    return str(info.start) if info.type == "Enumeration" else float(info.start)


def _values(c: Certificate, description: FmuDescription) -> Iterator[tuple[str, Scalar, str]]:
    """The FMU's own name, the value and its origin, for every variable that is not left at its start value."""
    bound = description if isinstance(description, BoundDescription) else None
    given = {
        name.partition(".")[2]: v
        for name, v in c.values.items()
        if name.startswith(f"{CONVERTER}.")
    }
    if bound:
        for own, value in bound.port.settings.items():
            yield own, value, "the binding"
        rating = float(given.get("S_n", bound.port.rating)) / bound.port.rating
        for name, maps in bound.port.start.items():
            value = float(given.get(name, bound.variables[name].start_number))
            for m in maps:
                scale = rating if m.per_rating else 1.0
                yield (
                    m.variable,
                    scale * m.factor * value + m.offset,
                    f"{c.origin_of(name)}, {name} of the binding",
                )
    for name, passed in given.items():
        target = bound.inner_names.get(name) if bound else name
        if target is not None and not (bound and name in START):
            yield target, passed, c.origin_of(name)


def linearised_of(c: Certificate) -> dict[str, str]:
    having = [point for (name, _), point in c.results.items() if name == WITH]
    return {component: how for point in having for component, how in point.linearised.items()}


def fit_errors_of(c: Certificate) -> dict[str, float]:
    """The largest of each component."""
    found: dict[str, float] = {}
    for point in c.results.values():
        for component, error in point.fit_errors.items():
            found[component] = max(error, found.get(component, 0.0))
    return found


def damping_json(c: DampingCertificate) -> dict[str, Any]:
    missing = missing_of(c)
    acceptance = None if c.acceptance is None else dict(c.acceptance.report)
    return {
        "format": NORM,
        "norm": c.code.source,
        "tool": f"gfor-cosim {installed_version('gfor-cosim')}",
        "verdict": c.verdict,
        "passed": c.passed,
        "sentence": c.sentence(),
        "missing": list(missing),
        "judged": f"{len(REACTANCES) - len(missing)} of {len(REACTANCES)}",
        "departures": list(c.request.departures),
        "details": c.details.texts(),
        "fmu": {
            "file": c.fmu_name,
            "model": c.description.model_name,
            "guid": c.description.guid,
            **read_origin(c.description.path),
        },
        "binding": c.binding_name,
        "values": dict(c.request.values),
        "study_values": dict(c.request.study_values),
        "black_box": c.request.black_box,
        "pod": c.pod,
        "pod_source": c.controllers.source,
        "pod_values": dict(c.controllers.settings),
        "parameters": [asdict(row) for row in parameter_rows(c)],
        "acceptance": acceptance,
        "signal": c.signal,
        "event_time": c.event_time,
        "linearised": linearised_of(c),
        "fit_errors": fit_errors_of(c),
        "environment": dict(c.computed_on),
        "points": [_point_json(c, v) for v in c.verdicts],
    }


def _point_json(c: Certificate, v: PointVerdict) -> dict[str, Any]:
    points = {name: c.results[name, v.X_L] for name in (WITHOUT, WITH)}
    having, without = points[WITH], points[WITHOUT].modes
    modes_without = []
    if without is not None:
        modes_without = list(map(_figures, without.eigenvalues.tolist()))
    lowered = [
        {
            "frequency_hz": m.frequency_hz,
            "from_percent": m.before_percent,
            "to_percent": m.damping_percent,
        }
        for m in v.lowered
    ]
    growth = {name: number(p.growth) for name, p in points.items()}
    stability = {name: p.stability for name, p in points.items()}
    residual = {name: number(p.residual) for name, p in points.items()}
    findings = {name: p.findings for name, p in points.items()}
    warnings = {name: list(p.warnings) for name, p in points.items()}
    identified = having.identified is not None
    again = {name: commands(v.X_L, name, identified=identified) for name in points}
    content = {
        "X_L": v.X_L,
        "accepted": v.accepted,
        "judged": v.is_judged,
        "faults": list(v.faults),
        "unknown": v.unknown,
        "modes": list(map(mode_json, v.modes)),
        "modes_beside": list(map(mode_json, v.neighbours)),
        "modes_without": modes_without,
        "lowered": lowered,
        "growth": growth,
        "stability": stability,
        "residual": residual,
        "power": having.power,
        "findings": findings,
        "converter_model": {
            "source": having.linearised.get(CONVERTER),
            "order": having.identified,
            "fit_error": having.fit_errors.get(CONVERTER),
        },
        "warnings": warnings,
        "time": None if v.time is None else time_json(v.time),
        "time_without": None if v.base_time is None else time_json(v.base_time),
        "again": again,
    }
    if v.pod is not None:
        content["pod"] = v.pod.as_json()
    return content


def commands(X_L: float, scenario: str, *, identified: bool) -> dict[str, str]:
    """Commands for the modes and the response of a point, to be given in the certificate's folder."""
    which = f"{CASE} --scenario {scenario} --set grid.X_L={X_L!r}"
    low, high = COMPUTED
    modes = f"gfor modes {which} --range {low:g}:{high:g} --json"
    if identified and scenario == WITH:
        modes = f"gfor black-box {which} --component {CONVERTER} --json"
    return {"modes": modes, "response": f"gfor run {which} --out again"}


def number(value: float) -> float | None:
    """Plain values for JSON, which has no NaN."""
    return value if math.isfinite(value) else None


def mode_json(m: ModeVerdict) -> dict[str, Any]:
    without = None if m.before is None else _figures(m.before)
    return _figures(m.eigenvalue) | {
        "without": without,
        "likeness": m.similarity,
        "components": m.components,
        "accepted": m.accepted,
        "reason": m.reason,
        **({"doubt": m.doubt} if m.doubt else {}),
    }


def _figures(value: complex) -> dict[str, float]:
    return eigenvalue_json(value, 100 * damping_ratio(value))


def time_json(time: TimeVerdict) -> dict[str, Any]:
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
    return {"k": s.number, "line": s.line, "depth": s.depth} | {
        n: [p.time, p.value] for n, p in points.items()
    }


def damping_responses(c: DampingCertificate) -> xr.Dataset:
    """Recorded signals over scenario, X_L and time; NaN where a run ended early."""
    whole = max(c.results.values(), key=lambda p: len(p.times))
    names = dict.fromkeys(name for point in c.results.values() for name in point.signals)
    reactances, scenarios = list(c.request.reactances), [WITHOUT, WITH]
    data = {}
    for name in names:
        values = np.full((2, len(reactances), len(whole.times)), np.nan)
        for i, scenario in enumerate(scenarios):
            for k, X_L in enumerate(reactances):
                signal = c.results[scenario, X_L].signals.get(name, np.empty(0))
                values[i, k, : len(signal)] = signal
        unit = next(p.units[name] for p in c.results.values() if name in p.units)
        kept = values if name == c.signal else values.astype(np.float32)
        data[name] = (("scenario", "X_L", "time"), kept, {"units": unit})
    coordinates = {
        "scenario": scenarios,
        "X_L": ("X_L", reactances, {"units": "pu"}),
        "time": ("time", whole.times, {"units": "s"}),
    }
    return xr.Dataset(data, coords=coordinates, attrs={"source": "gfor certify"})
