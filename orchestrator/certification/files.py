"""What a damping test leaves behind: the page, the figures as JSON, the responses as NetCDF."""

import json
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.certification.criteria import ModeVerdict, damping_ratio
from orchestrator.certification.report import page
from orchestrator.certification.study import WITH, WITHOUT, Certification, PointVerdict, TimeVerdict
from orchestrator.certification.swings import Swing, SwingTest
from orchestrator.report.pdf import print_pdf


def save(certification: Certification, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Write ``certificate.html``, ``certificate.json`` and ``responses.nc``, on request ``certificate.pdf``."""
    html, figures, responses = (folder / name for name in ("certificate.html", "certificate.json", "responses.nc"))
    html.write_text(page(certification), encoding="utf-8")
    content = json.dumps(certification_json(certification), indent=1, ensure_ascii=False)
    figures.write_text(content + "\n", encoding="utf-8")
    responses_dataset(certification).to_netcdf(responses, engine="scipy")
    return [html, figures, responses, *([print_pdf(html, folder / "certificate.pdf")] if pdf else [])]


def certification_json(c: Certification) -> dict[str, Any]:
    """All verdicts with their figures."""
    return {
        "norm": "Norma técnica de supervisión 631 v2.0 (2020), section 5.10",
        "tool": f"gfor-cosim {version('gfor-cosim')}",
        "fmu": {"file": c.request.fmu.name, "model": c.description.model_name, "guid": c.description.guid},
        "binding": c.request.binding.name if c.request.binding else None,
        "values": dict(c.request.values),
        "pod": c.pod,
        "signal": c.signal,
        "linearised": c.linearised,
        "fit_errors": c.fit_errors,
        "passed": c.passed,
        "sentence": c.sentence(),
        "points": [_point_json(c, v) for v in c.verdicts],
    }


def _point_json(c: Certification, v: PointVerdict) -> dict[str, Any]:
    without = c.points[WITHOUT, v.X_L].modes
    return {
        "X_L": v.X_L,
        "accepted": v.accepted,
        "faults": list(v.faults),
        "modes": [_mode_json(m) for m in v.modes],
        "modes_without": [] if without is None else [_eigenvalue_json(x) for x in without.eigenvalues.tolist()],
        "growth": {name: c.points[name, v.X_L].growth for name in (WITHOUT, WITH)},
        "time": None if v.time is None else _time_json(v.time),
        "time_without": None if v.base_time is None else _time_json(v.base_time),
    }


def _mode_json(m: ModeVerdict) -> dict[str, Any]:
    without = None if m.before is None else _eigenvalue_json(m.before)
    return _eigenvalue_json(m.eigenvalue) | {
        "without": without,
        "likeness": m.similarity,
        "components": m.components,
        "accepted": m.accepted,
        "reason": m.reason,
    }


def _eigenvalue_json(value: complex) -> dict[str, float]:
    return {"real": value.real, "imag": value.imag, "frequency_hz": value.imag / (2 * np.pi),
            "damping_percent": 100 * damping_ratio(value)}  # fmt: skip


def _time_json(time: TimeVerdict) -> dict[str, Any]:
    modal = [_eigenvalue_json(m.eigenvalue) | {"amplitude": m.amplitude} for m in time.modal.modes]
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


def _swing_json(s: Swing) -> dict[str, Any]:
    points = {"P": s.before, "M": s.minimum, "P_next": s.after}
    return {"k": s.number, "line": s.line, "depth": s.depth} | {n: [p.time, p.value] for n, p in points.items()}


def responses_dataset(c: Certification) -> xr.Dataset:
    """Recorded signals over scenario, X_L and time; NaN where a run ended early."""
    whole = max(c.points.values(), key=lambda p: len(p.times))
    names = dict.fromkeys(name for point in c.points.values() for name in point.signals)
    reactances, scenarios = list(c.request.reactances), [WITHOUT, WITH]
    data = {}
    for name in names:
        values = np.full((2, len(reactances), len(whole.times)), np.nan)
        for i, scenario in enumerate(scenarios):
            for k, X_L in enumerate(reactances):
                signal = c.points[scenario, X_L].signals.get(name, np.empty(0))
                values[i, k, : len(signal)] = signal
        unit = next(p.units[name] for p in c.points.values() if name in p.units)
        data[name] = (
            ("scenario", "X_L", "time"),
            values.astype(np.float32 if name != c.signal else float),
            {"units": unit},
        )
    coordinates = {"scenario": scenarios, "X_L": ("X_L", reactances, {"units": "pu"}),
                   "time": ("time", whole.times, {"units": "s"})}  # fmt: skip
    return xr.Dataset(data, coords=coordinates, attrs={"sentence": c.sentence(), "source": "gfor certify"})
