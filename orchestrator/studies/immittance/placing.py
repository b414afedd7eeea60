"""Scans in one unit and one frame, and at their places in a case."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.immittance.belonging import check_place
from orchestrator.studies.immittance.cut import Cut
from orchestrator.studies.immittance.scan import PER_UNIT, SIEMENS, Scan
from orchestrator.studies.immittance.sides import Sampled


def scans_in(prepared: PreparedScenario) -> dict[str, ComponentTable]:
    """The tables of a scenario's components that are known by scans."""
    tables, there = prepared.case.table.components, prepared.system.components
    return {
        name: table for name, table in tables.items() if table.scan is not None and name in there
    }


def in_unit(scan: Scan, unit: str, kilovolt: float | None) -> Scan:
    if scan.unit == unit:
        return scan
    if kilovolt is None:
        raise InputError(
            f"{scan.source} is in {scan.unit} and the other side in {unit}: give the "
            "rated voltage at the cut, as in "
            + Option.VOLTAGE
            + " '230 kV', of a scan in a case by voltage = \"230 kV\" (the base is 100 MVA)"
        )
    return (
        scan.in_siemens(kilovolt)
        if unit == SIEMENS
        else scan.scaled(kilovolt**2 / SYSTEM_BASE_MVA, unit)
    )


def in_one_frame(scans: dict[str, Scan], angle: float | None) -> bool:
    """Turn the scans of two files into the network's frame; whether it is known how."""
    if "device" not in scans:
        return True
    if angle is not None:
        scans["device"] = scans["device"].rotated([angle] * len(scans["device"].ports))
        return True
    stated = {
        side: [p.angle for p in scan.points.values() if p.angle is not None]
        for side, scan in scans.items()
    }
    if any(len(found) < len(scans[side].ports) for side, found in stated.items()):
        return False
    for side, found in stated.items():
        scans[side] = scans[side].rotated(found)
    return True


def place_scan(
    scan: Scan, cut: Cut, name: str, kilovolt: float | None, angle: float | None
) -> tuple[Scan, bool]:
    """A scan in per unit at a component's place, in the network's frame; whether it is known how that lies.

    The d axis of a scan that states an angle lies along the voltage of its bus, whatever that voltage's angle was."""
    check_place(scan, cut, name, kilovolt)
    scan = in_unit(scan, PER_UNIT, kilovolt)
    if not any(point.megawatt is not None for point in scan.points.values()):
        S = cut.voltages[name] * cut.currents[name].conjugate() * SYSTEM_BASE_MVA
        asked = f"{scan.source} states no operating point; was it scanned where {name} is here, at"
        scan = replace(
            scan, questions=(*scan.questions, f"{asked} {S.real:.4g} MW and {S.imag:.4g} Mvar?")
        )
    if angle is None and all(
        port in scan.points and scan.points[port].angle is not None for port in scan.ports
    ):
        angle = float(np.angle(cut.voltages[name]))
    return (scan, False) if angle is None else (scan.rotated([angle]), True)


def at_ports(scans: Mapping[str, Scan], cut: Cut) -> Sampled:
    """The scans of all devices at a cut, where they stand; those at one bus add up."""
    parts = {name: sampled(scan) for name, scan in scans.items()}
    if len(parts) == 1:
        return next(iter(parts.values()))
    low, high = (g(p.frequencies[k] for p in parts.values()) for g, k in ((max, 0), (min, -1)))
    f = np.unique(np.concatenate([p.frequencies for p in parts.values()]))
    f = f[(f >= low) & (f <= high) & (np.diff(f, prepend=-1.0) > 1e-6 * f)]
    if len(f) < 8:  # as `checked` asks of one
        raise InputError(
            f"{', '.join(s.source for s in scans.values())} have no common range of frequencies"
        )
    values, bounds = (
        np.zeros((len(f), 2 * len(cut.ports), 2 * len(cut.ports)), dtype=complex),
        np.zeros(len(f)),
    )
    for name, part in parts.items():
        rows = 2 * next(k for k, (_, here) in enumerate(cut.ports) if name in here) + np.arange(2)
        values[:, rows[:, None], rows] += part.at(2j * np.pi * f)
        bounds += part.error(2j * np.pi * f)
    return Sampled(", ".join(scans), f, values, bounds, parts=tuple(parts.values()))


def sampled(scan: Scan, *, inverse: bool = False) -> Sampled:
    if not inverse:
        return Sampled(scan.source, scan.frequencies, scan.values, scan.bounds)
    Z = scan.impedance
    return Sampled(
        scan.source, scan.frequencies, Z, scan.bounds * np.linalg.norm(Z, ord=2, axis=(1, 2)) ** 2
    )
