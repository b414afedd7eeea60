"""A study at a cut: which two sides, in which units and frames, and what is found."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.black_box.port import start_of
from orchestrator.studies.immittance.belonging import beside_modes, check_pair, check_size
from orchestrator.studies.immittance.cut import Cut, cut_of
from orchestrator.studies.immittance.judgement import CutJudgement, NyquistVerdict, judge_loop
from orchestrator.studies.immittance.loop import NO_MODES, CutLoop, SeriesCapacitors, common_range
from orchestrator.studies.immittance.margins import NyquistMargins, margins_json
from orchestrator.studies.immittance.measured import scan_fmu
from orchestrator.studies.immittance.placing import (
    at_ports,
    in_one_frame,
    in_unit,
    place_scan,
    sampled,
    scans_in,
)
from orchestrator.studies.immittance.scan import PER_UNIT, SIEMENS, Scan, check_sign
from orchestrator.studies.immittance.scan_files import ENDINGS, read_scan
from orchestrator.studies.immittance.sides import Sampled, Side
from orchestrator.studies.immittance.strength import Critical, SourceBehind, critical, strengths_of


@dataclass(frozen=True)
class CutRequest:
    # device, network: A scan's file, an FMU or DLL; for the network a scan's file or a scenario. The network of a
    # scenario alone is what remains of it; None where a short-circuit ratio stands for it.
    device: Path | None
    network: Path | PreparedScenario | None
    frequency: float = 50.0
    # series capacitors, as share of the network's reactance at the rated frequency
    compensation: float = 0.0
    # of the device's frame before the network's [rad]; None where the files or the sides state it.
    angle: float | None = None
    bus: str | None = None
    components: tuple[str, ...] = ()
    kilovolt: float | None = None  # rated voltage of what is in per unit
    # sides whose files count currents out of them: ``device``, ``network``
    generator: frozenset[str] = frozenset()
    per_unit: frozenset[str] = frozenset()  # sides whose files are in per unit of the system base
    units_checked: bool = False
    # scr, x_r: of the source behind R + jX that stands for the network; rating_mva: of the device, whose SCR is asked.
    scr: float | None = None
    x_r: float = 10.0
    rating_mva: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    binding: Path | None = None
    step_size: float = 1e-4
    excitation: Excitation = field(default_factory=Excitation)


@dataclass(frozen=True)
class CutResult:
    """Findings at a cut. ``scans`` are those that were read or measured, by side."""

    request: CutRequest
    loop: CutLoop
    judgement: CutJudgement
    scans: dict[str, Scan]
    cut: Cut | None
    unit: str
    questions: tuple[str, ...]
    # short_circuit, rating: of the network at the cut and of the device [MVA]; None where they are not known
    rating: float | None = None
    short_circuit: float | None = None
    # ratios, gscr: SCR of the converters at a bus of the case, and generalised ratio of all of them
    ratios: Mapping[str, float] = field(default_factory=dict)
    gscr: float | None = None

    @property
    def scr(self) -> float | None:
        return self.short_circuit / self.rating if self.short_circuit and self.rating else None

    @property
    def scr_limit(self) -> float | None:
        """SCR at which a stable loop is lost as the whole impedance of the network grows; 0 where it never is."""
        up = self.judgement.margins.gain_up
        if self.scr is None or self.verdict is not NyquistVerdict.STABLE:
            return None
        return 0.0 if up is None else self.scr / up.value

    @property
    def verdict(self) -> NyquistVerdict:
        return self.judgement.verdict

    @property
    def margins(self) -> NyquistMargins | None:
        """None where the verdict is not known: nothing is then left over of what is not there."""
        return None if self.judgement.reasons else self.judgement.margins

    @cached_property
    def critical(self) -> list[Critical]:
        """Where the loop of a case comes near −1, and who takes part."""
        if self.cut is None or self.scans or self.judgement.reasons:
            return []
        return critical(self.loop, self.judgement, self.cut)

    @property
    def because(self) -> str:
        j = self.judgement
        if j.reasons:
            return "; ".join(j.reasons)
        low, high = j.range_hz
        around = f"−1 is encircled {j.encirclements} times by the determinant and by the eigenloci"
        poles = f", with {len(j.open_loop)} unstable poles of the open loop" if j.open_loop else ""
        return f"{around}{poles}, " + (
            "at all frequencies" if self.loop.is_exact else f"from {low:.3g} to {high:.4g} Hz"
        )

    @property
    def difference(self) -> dict[str, float] | None:
        """Largest difference of a device from the case's own, or its scan, in its place, relative."""
        device = self.loop.device
        if self.cut is None or self.request.device is None or not isinstance(device, Sampled):
            return None
        low, high = common_range(device, self.cut.device, (0.0, 0.0))
        inside = (device.frequencies >= low) & (device.frequencies <= high)
        f, own = (
            device.frequencies[inside],
            self.cut.device.at(2j * np.pi * device.frequencies[inside]),
        )
        if not len(f):
            return None
        apart = np.linalg.norm(device.values[inside] - own, ord=2, axis=(1, 2)) / np.linalg.norm(
            own, 2, axis=(1, 2)
        )
        return {"largest_relative": float(apart.max()), "frequency_hz": float(f[np.argmax(apart)])}

    def as_json(self) -> dict[str, Any]:
        """Verdict and figures as JSON's types."""
        j = self.judgement
        points = {
            s: {p: vars(v) for p, v in scan.points.items()}
            for s, scan in self.scans.items()
            if scan.points
        }
        of, about = self.request.network, {}
        if isinstance(of, PreparedScenario):
            about = {"models": of.models, "basis": of.basis}
        poles = [{"real": p.real, "imag": p.imag} for p in j.open_loop]
        crossings = [{"real": c.real, "frequency_hz": c.frequency_hz} for c in j.crossings]
        active = {side: [list(band) for band in bands] for side, bands in j.active.items()}
        return about | {
            "verdict": str(self.verdict),
            "reasons": list(j.reasons),
            "sentence": f"{self.verdict}: {self.because}",
            "device": self.loop.device.name,
            "network": self.loop.network.name,
            "unit": self.unit,
            "compensation_percent": 100 * self.request.compensation,
            "range_hz": list(j.range_hz),
            "growing_modes": j.growing,
            "encirclements": {"determinant": j.encirclements, "eigenloci": j.by_loci},
            "open_loop_unstable_poles": poles,
            "modes_stable": None if self.cut is None or self.scans else self.cut.modes_stable,
            "crossings": crossings,
            "margins": margins_json(self.margins),
            "buses": self._buses_json(),
            "critical": list(map(vars, self.critical)),
            "strength": {
                "short_circuit_mva": self.short_circuit,
                "scr": self.scr,
                "scr_limit": self.scr_limit,
                "gscr": self.gscr,
            },
            "difference_from_case": self.difference,
            "active_hz": active,
            "small_gain_hz": list(map(list, j.small_gain)),
            "operating_points": points,
            "questions": list(self.questions),
        }

    def _buses_json(self) -> list[dict[str, Any]]:
        """The closed system judged at each bus of several: `BusJudgement` with its bus, and the SCR there."""
        if self.cut is None or self.judgement.reasons:
            return []
        found = []
        for one in self.judgement.buses:
            bus, devices = self.cut.ports[one.port]
            found.append(
                {
                    "bus": bus,
                    "devices": list(devices),
                    "verdict": str(self.verdict),
                    "encirclements": {"determinant": one.encirclements, "eigenloci": one.by_loci},
                    "growing_modes_without": one.without,
                    "margins": margins_json(one.margins),
                    "scr": self.ratios.get(bus.rpartition(".")[2]),
                }
            )
        return found


def study_cut(request: CutRequest, report: Callable[[str], None] | None = None) -> CutResult:
    """Bring both sides into one unit and one frame, and judge their loop."""
    sides = _sides(request, report)
    request, cut, scans = sides.request, sides.cut, sides.scans
    rating = _rating(request, cut)
    base = _base_of_unit(sides)
    loop = _loop(sides, rating, base)
    closed = cut if not scans and not request.compensation and request.scr is None else None
    judgement = judge_loop(
        loop, frames_known=sides.frames_known, modes=closed.eigenvalues if closed else NO_MODES
    )
    if closed is not None:
        judgement = beside_modes(judgement, closed)
    prepared = (
        request.network
        if isinstance(request.network, PreparedScenario) and request.scr is None
        else None
    )
    strengths = strengths_of(
        loop.network, request.frequency, base, prepared, cut.bus if cut else ""
    )
    questions = _questions(sides, rating)
    return CutResult(
        request, loop, judgement, scans, cut, sides.unit, questions, rating, *strengths
    )


@dataclass(frozen=True)
class _CutSides:
    """Both sides of a cut in one unit, as a case or scans give them.

    ``request``: with the rated frequency of the case.
    ``frames_known``: whether the angle between the sides' frames is stated.
    ``lead``: what a free angle makes of the loop at rest, as `CutLoop` has it."""

    request: CutRequest
    cut: Cut | None = None
    scans: dict[str, Scan] = field(default_factory=dict)
    frames_known: bool = True
    unit: str = PER_UNIT
    lead: float = 0.0


def _sides(request: CutRequest, report: Callable[[str], None] | None) -> _CutSides:
    """Read or measure both sides, and bring scans into one unit and, where it is known, into one frame."""
    sides = _CutSides(request)
    if isinstance(request.network, PreparedScenario):
        sides = _opened(request, request.network)
    request, cut, scans = sides.request, sides.cut, sides.scans
    known, unit = sides.frames_known, PER_UNIT
    if request.device is not None:
        if cut is not None and len(cut.devices) > 1:
            raise InputError(
                f"the cut holds {', '.join(cut.devices)}; name the one that the scan is of by "
                + Option.COMPONENT
            )
        scans = {"device": _side(request, request.device, cut, report)}
    if isinstance(request.network, Path):
        scans["network"] = _read(request, "network", request.network)
    if cut is None:
        units = {scan.unit for scan in scans.values()}
        unit = units.pop() if len(units) == 1 else SIEMENS
        scans = {side: in_unit(scan, unit, request.kilovolt) for side, scan in scans.items()}
        known = in_one_frame(scans, request.angle)
    elif request.device is not None:
        scans["device"], known = place_scan(
            scans["device"], cut, cut.devices[0], request.kilovolt, request.angle
        )
    return replace(sides, scans=scans, frames_known=known, unit=unit)


def _questions(sides: _CutSides, rating: float | None) -> tuple[str, ...]:
    """Doubts of the scans and of the cut, and scans beyond the device's rating."""
    questions = [q for scan in sides.scans.values() for q in scan.questions]
    if sides.cut is not None:
        questions += sides.cut.warnings
    questions += [
        f"{scan.source} was scanned at {point.megawatt:g} MW, and the device is rated at {rating:g} MVA; do both hold?"
        for side, scan in sides.scans.items()
        for point in scan.points.values()
        if side != "network" and rating and abs(point.megawatt or 0.0) > 1.1 * rating
    ]
    return tuple(questions)


def _base_of_unit(sides: _CutSides) -> float | None:
    """The power [MVA] of an impedance of 1; None for ohms where no rated voltage is known."""
    if sides.unit == PER_UNIT:
        return SYSTEM_BASE_MVA
    stated = [point.kilovolt for scan in sides.scans.values() for point in scan.points.values()]
    kilovolt = sides.request.kilovolt or next(filter(None, stated), None)
    return kilovolt**2 if kilovolt else None


def _loop(sides: _CutSides, rating: float | None, base: float | None) -> CutLoop:
    """The loop of both sides, which must belong together, with the capacitors that are asked for."""
    request, cut, scans = sides.request, sides.cut, sides.scans
    device: Side | None = cut.device if cut else None
    device = sampled(scans["device"]) if "device" in scans else device
    network: Side | None = cut.network if cut else None
    network = sampled(scans["network"], inverse=True) if "network" in scans else network
    if request.scr is not None:
        network = _source(request, rating, base)
    assert device is not None
    assert network is not None
    if "network" in scans:
        check_pair(scans["device"], scans["network"])
    lead = sides.lead if scans and request.scr is None else 0.0
    loop = CutLoop(device, network, lead=lead)
    if ("network" in scans or (scans and request.scr)) and not request.units_checked:
        check_size(loop, *common_range(device, network, (0.0, 0.0)))
    if request.compensation:
        loop = replace(loop, capacitors=_capacitors(loop, request))
    return loop


def _opened(request: CutRequest, case: PreparedScenario) -> _CutSides:
    """The case cut where it is asked for, or at its scans."""
    held, scans, sure = scans_in(case), dict[str, Scan](), [True]
    cut = cut_of(case, request.bus, request.components or (() if request.bus else tuple(held)))
    if held and set(cut.devices) != set(held):
        raise InputError(
            f"{', '.join(held)}: of a case with scans the two sides are all scans and all "
            f"else, and the cut is at {', '.join(cut.devices)}; leave "
            + Option.BUS
            + " and "
            + Option.COMPONENT
            + " out"
        )
    request = replace(request, frequency=cut.rated_hz or request.frequency)
    for name, table in held.items():
        scan = _read(request, "device", case.case.directory / str(table.scan))
        scans[name], known = place_scan(
            scan, cut, name, table.voltage or request.kilovolt, request.angle
        )
        sure.append(known)
    lead = CutLoop(cut.device, cut.network).lead_at_rest
    if held:
        cut = replace(cut, device=at_ports(scans, cut))
    return _CutSides(request, cut, scans, frames_known=all(sure), lead=lead)


def _read(request: CutRequest, side: str, path: Path) -> Scan:
    if side == "network" and path.suffix.lower() not in ENDINGS:
        raise InputError(
            f"{path}: the network is a scan's file or a case; an FMU can be the device"
        )
    scan, kv = read_scan(path, request.frequency, network=side == "network"), request.kilovolt
    off = [
        p.kilovolt
        for p in scan.points.values()
        if p.kilovolt and kv and not 0.8 < p.kilovolt / kv < 1.25
    ]
    if off:
        raise InputError(
            f"{path.name} was scanned at {off[0]:g} kV, and "
            + Option.VOLTAGE
            + f" is {kv:g} kV; leave the option out"
        )
    scan = scan.scaled(1.0, PER_UNIT) if side in request.per_unit else scan
    scan = scan.turned_sign() if side in request.generator else scan
    check_sign(scan, (Option.GENERATOR + f" {side}"))
    return scan


def _side(
    request: CutRequest, path: Path, cut: Cut | None, report: Callable[[str], None] | None
) -> Scan:
    if path.suffix.lower() in ENDINGS:
        return _read(request, "device", path)
    values = dict(request.values)
    if cut is not None:  # at the case's own operating point
        (name,) = cut.devices
        v = cut.voltages[name]
        values = {"v_0": abs(v), "theta_0": float(np.angle(v))} | values
    return scan_fmu(path, request.binding, values, request.step_size, request.excitation, report)


def _rating(request: CutRequest, cut: Cut | None) -> float | None:
    """Return the rating of the device [MVA], as it is given or as the device has it."""
    if (
        request.rating_mva is None
        and cut is not None
        and isinstance(request.network, PreparedScenario)
    ):
        plans = [request.network.system.components[name] for name in cut.devices]
        return (
            sum(plan.number("S_n") for plan in plans if "S_n" in plan.description.variables) or None
        )
    if (
        request.rating_mva is None
        and request.device
        and request.device.suffix.lower() not in ENDINGS
    ):
        return (
            float(
                request.values.get(
                    "S_n", start_of(bound_fmu(request.device, request.binding), "S_n")
                )
            )
            or None
        )
    return request.rating_mva


def _source(request: CutRequest, rating: float | None, base: float | None) -> SourceBehind:
    if not (request.scr and request.scr > 0 and request.x_r > 0):
        raise InputError(
            Option.SCR
            + f" {request.scr:g}, "
            + Option.X_R
            + f" {request.x_r:g}: both must exceed 0"
        )
    if rating is None or base is None:
        missing = (
            ("its rating by " + Option.RATING + " '100 MVA'")
            if rating is None
            else ("the rated voltage by " + Option.VOLTAGE + " '230 kV'")
        )
        raise InputError(
            Option.SCR
            + f": a scan states no rating; give {missing}, to which the short-circuit ratio "
            "relates"
        )
    X = base / (request.scr * rating) / math.hypot(1.0, 1 / request.x_r)
    return SourceBehind(
        f"a source of SCR {request.scr:g}", X / request.x_r, X, 2 * np.pi * request.frequency
    )


def _capacitors(loop: CutLoop, request: CutRequest) -> SeriesCapacitors:
    low = loop.network.frequencies[:1] if not loop.network.is_exact else np.array([1e-3])
    Z = loop.network.at(2j * np.pi * low)[0]
    X = float((Z[1, 0] - Z[0, 1]).real / 2)
    if len(Z) != 2 or X <= 0:
        raise InputError(
            Option.COMPENSATION
            + f": {loop.network.name} has no inductive reactance at one port to be "
            "compensated"
        )
    return SeriesCapacitors(request.compensation * X, 2 * np.pi * request.frequency)
