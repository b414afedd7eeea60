"""Whether a certificate still holds: its hashes, its verdict from its own figures, and its points computed anew."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.analysis.modes import damping_ratio
from orchestrator.arrays import Numbers
from orchestrator.cases.case import load_case
from orchestrator.certification.case_file import BINDING, CASE, FMU, WITH, WITHOUT
from orchestrator.certification.derivation import derived_faults
from orchestrator.certification.figures import FORMAT
from orchestrator.certification.files import HTML, JSON, RESPONSES, figures_hash, read_record, seal_of
from orchestrator.certification.form import check_form
from orchestrator.certification.point import CONVERTER, CertificatePointTask, PointResult, compute_point
from orchestrator.certification.rejudgement import rejudge
from orchestrator.certification.request import same_reactance
from orchestrator.errors import InputError
from orchestrator.points.executor import Executor, WorkerLostError
from orchestrator.points.key import fingerprint, key_of, reference_to
from orchestrator.safe_files import file_hash

TOLERANCE = 1e-5
"""Largest difference of a recomputed eigenvalue relative to its size, and of a signal relative to its range. Different
processors round differently."""

TOLERANCE_IDENTIFIED = 1e-3
"""Largest relative difference of an eigenvalue if the system contains an identified model, whose fit amplifies
rounding."""

_NEEDED = (FMU, CASE, RESPONSES, HTML)


@dataclass
class Verification:
    faults: list[str] = field(default_factory=list)
    agreed: list[str] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        return not self.faults


def read_certificate(path: Path) -> tuple[Path, dict[str, Any]]:
    """Folder and content of a certificate, from either the folder or ``certificate.json``."""
    file = path / JSON if path.is_dir() else path
    try:
        content = read_record(file)
    except OSError as error:
        raise InputError(
            f"{file}: the certificate cannot be read: {error.strerror}; give the folder that `gfor certify` wrote"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: it is not JSON: {error}; give the certificate.json of `gfor certify`") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else None
        raise InputError(
            f"{file}: it is no certificate of format {FORMAT} (found: {found}); older ones hold too little to be "
            "verified, make it anew with `gfor certify`"
        )
    check_form(file, content)
    return file.parent, content


def verify_files(folder: Path, content: dict[str, Any]) -> Verification:
    """Compare all hashes, and judge the certificate's own figures again."""
    found = Verification()
    if content.get("seal") != seal_of(content):
        found.faults.append(f"{JSON}: its figures or words are not those that were written: its own hash differs")
    else:
        found.agreed.append(f"{JSON}: its own hash")
    hashes = content.get("files") or {}
    names = [*_NEEDED, *([BINDING] if content.get("binding") else [])]
    for name in dict.fromkeys([*names, *hashes]):
        _compare_file(folder, name, hashes.get(name), found)
    _compare_page(folder / HTML, content, found)
    faults = _judged_again(folder, content) + derived_faults(folder, content)
    found.faults += faults
    found.agreed += [] if faults else ["the verdict, judged again from the figures and the responses"]
    return found


def _compare_page(page: Path, content: dict[str, Any], found: Verification) -> None:
    """Check that the page states the hash of its figures and the unchanged sentence of the verdict."""
    if not page.is_file():
        return
    text = page.read_text(encoding="utf-8", errors="replace")
    if f">{escape(content['sentence'])}</b>" not in text:
        found.faults.append(f"{HTML}: it does not hold the verdict's sentence of {JSON}")
    if figures_hash(content) not in text:
        found.faults.append(f"{HTML}: it was made of other figures than those of {JSON}: their hash is not on the page")
    else:
        found.agreed.append(f"{HTML}: the hash of the figures that it shows")


def _judged_again(folder: Path, content: dict[str, Any]) -> list[str]:
    file = folder / RESPONSES
    if not file.is_file():
        return [f"the verdict cannot be judged again without {RESPONSES}"]
    try:
        with xr.open_dataset(file, engine="scipy") as data:
            return rejudge(content, data)
    except (OSError, KeyError, ValueError, TypeError, IndexError):
        return [
            f"the verdict cannot be judged again: {RESPONSES} does not hold the signal {content['signal']!r} at all "
            f"points of {JSON}, with the event at t = {content['event_time']:g} s"
        ]


def _compare_file(folder: Path, name: str, wanted: str | None, found: Verification) -> None:
    path = folder / name
    if not path.is_file():
        found.faults.append(f"{name}: there is no such file beside {JSON}; it was removed or renamed")
    elif wanted is None:
        found.faults.append(f"{name}: {JSON} has no hash of it")
    elif file_hash(path) != wanted:
        found.faults.append(f"{name}: it is not the file that was certified: its SHA-256 differs")
    else:
        found.agreed.append(f"{name}: SHA-256")


def least_damped(content: dict[str, Any]) -> float:
    """Reactance of the point with the least damped judged mode [pu]."""
    points = [p for p in content["points"] if p["modes"]] or content["points"]
    return float(min(points, key=lambda p: min((m["damping_percent"] for m in p["modes"]), default=0.0))["X_L"])


def chosen_points(content: dict[str, Any], wanted: Sequence[float]) -> list[dict[str, Any]]:
    """Points of the certificate at some reactances."""
    chosen = []
    for X_L in wanted:
        match = [p for p in content["points"] if same_reactance(p["X_L"], X_L)]
        if not match:
            known = ", ".join(f"{p['X_L']:g}" for p in content["points"])
            raise InputError(f"--points: the certificate has no X_L = {X_L:g} pu; it has: {known}")
        chosen += match
    return chosen


def verify_points(
    folder: Path,
    content: dict[str, Any],
    points: Sequence[dict[str, Any]],
    executor: Executor,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Verification:
    """Compute points anew, with and without the converter, and compare them with what was certified."""
    found = Verification()
    case = load_case(folder / CASE)
    place, mark = reference_to(case), fingerprint(case)
    places = [(p, scenario) for p in points for scenario in (WITHOUT, WITH)]
    tasks = [
        CertificatePointTask(place, mark, scenario, p["X_L"], key_of({"verify": [mark, scenario, p["X_L"]]}),
                  bool(content["black_box"]) and scenario == WITH) for p, scenario in places
    ]  # fmt: skip
    with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
        for done, (index, outcome) in enumerate(executor.run(compute_point, tasks), start=1):
            point, scenario = places[index]
            again = PointResult.lost(tasks[index], outcome) if isinstance(outcome, WorkerLostError) else outcome
            _compare_point(point, scenario, again, data, str(content["signal"]), found)
            report(done, len(tasks))
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
    """Differences in stability at all frequencies, in the power fed in, and in the model that replaces the
    converter.
    """
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
    """A fault, or otherwise a sentence on the difference."""
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
