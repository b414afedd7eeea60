"""Powers and angles of a record beside the case's own: turned signs, other units, other operating points."""

from __future__ import annotations

import cmath
import math
from collections.abc import Container, Iterator
from typing import TYPE_CHECKING

import numpy as np

from orchestrator.studies.oscillations.measurements import Measurements, Site
from orchestrator.studies.oscillations.models import UnitModels, fits, power_there

if TYPE_CHECKING:
    from orchestrator.cases.scenario.prepare import PreparedScenario

_ALIKE = 0.25
"""A mean power that is the case's with its sign turned differs from it by less than this part; a record is of another
hour than the case."""

_LEAST_MW = 10.0  # a smaller power may have either sign


_NEAR = 0.1
"""A power is the case's one in another unit, or with another sign, if it differs from that by less than this part."""

_UNITS = {
    1e-3: "is it in GW, or on a base that is 1000 times as large?",
    1e-2: "is it in pu where MW are written?",
    1e2: "is it in MW where pu are written?",
    1e3: "is it in kW?",
}
"""Factors of a power that is given in another unit."""


def turned_signs(measured: Measurements, prepared: PreparedScenario) -> dict[str, str]:
    """A remark on each unit whose P is the case's own with its sign turned, by name of the unit."""
    return dict(_turned(measured, prepared))


_THOUSAND = 1000.0
_SAME_HOUR = 1.5
"""Factor by which a power of another hour may be larger or smaller than the case's."""


def other_units(measured: Measurements, prepared: PreparedScenario) -> dict[str, str]:
    """A question on each unit whose P is 1000 times the case's, or a 1000th of it, by name of the unit."""
    return dict(_scaled(measured, prepared))


def _scaled(measured: Measurements, prepared: PreparedScenario) -> Iterator[tuple[str, str]]:
    for place, own in _beside_the_case(measured, prepared):
        seen = _megawatts(place, measured.base)
        ratio = seen / own
        if 1 / _SAME_HOUR < ratio * _THOUSAND < _SAME_HOUR:
            amount = "a 1000th of it"
            meant = "labelled kW and in MW"
        elif 1 / _SAME_HOUR < ratio / _THOUSAND < _SAME_HOUR:
            amount = "1000 times as much"
            meant = "labelled MW and in kW"
        else:
            continue
        yield (
            place.name,
            f"{place.name}: its P is {seen:+.4g} MW in the record and {own:+.4g} MW in the case, {amount}: is the "
            f"column {meant}? Then correct the unit behind its name; as it stands, {seen:+.4g} MW are taken, of "
            "another hour",
        )


_DEGREES = 180 / math.pi
_LEAST_SPREAD = 0.02  # of the case's angles [rad]: smaller ones tell no unit
_ANGLES_ALIKE = 0.8  # correlation from which on angles are the case's in another unit
_ANGLES_NEAR = 2.0  # factor by which they may be larger or smaller in another hour


def other_angles(measured: Measurements, prepared: PreparedScenario) -> list[str]:
    """A question on angles between places that are the case's times 57.3, or over it."""
    flow, network = prepared.power_flow, prepared.network
    if flow is None or network is None:
        return []
    buses = {port.name.casefold(): port.bus for port in network.ports}
    buses |= {bus.casefold(): bus for bus in flow.voltages}
    pairs = [
        (float(np.unwrap(place.angle).mean()), cmath.phase(flow.voltages[bus]))
        for place in measured.places
        if (bus := buses.get(place.bus.casefold())) in flow.voltages
    ]
    if len(pairs) < 2:
        return []
    seen, own = (np.array(each) - np.mean(each) for each in zip(*pairs, strict=True))
    spread = float(np.ptp(own))
    if spread < _LEAST_SPREAD or not float(np.ptp(seen)):
        return []
    alike = float(seen @ own) / float(np.linalg.norm(seen) * np.linalg.norm(own))
    ratio = float(seen @ own) / float(own @ own)
    if alike < _ANGLES_ALIKE:
        return []
    if not 1 / _ANGLES_NEAR < ratio * _DEGREES < _ANGLES_NEAR:
        return []
    there, here = _DEGREES * float(np.ptp(seen)), _DEGREES * spread
    return [
        f"angles between places go up to {there:.3g} degrees in the record and to {here:.3g} in the case, about 57.3 "
        f"times as far: are columns labelled [deg] in radians? Then write [rad] behind their names; as they stand, "
        f"{there:.3g} degrees are taken, of another hour"
    ]


def other_powers(
    measured: Measurements, models: UnitModels, without: Container[str] = ()
) -> list[str]:
    """A remark on each unit whose power is not the case's, so that its own model does not judge it."""
    units = {name.casefold(): (name, unit) for name, unit in models.units.items()}
    found = []
    for place in measured.places:
        _, model = units.get(place.name.casefold(), ("", None))
        if model is None or place.kind != "unit" or place.name in without:
            continue
        if not fits(model, place, measured.base):
            seen, wanted = (
                power_there(place, measured.base),
                model.voltage * model.current.conjugate(),
            )
            found.append(
                f"{place.name}: its own model does not judge it, since its power is {_mva(seen)} in the record and "
                f"{_mva(wanted)} in the case: {_meaning(seen, wanted)}"
            )
    return found


def _mva(power: complex) -> str:
    """A power on 100 MVA as MW and Mvar."""
    return f"{100 * power.real:+.4g} MW, {100 * power.imag:+.4g} Mvar"


def _meaning(seen: complex, wanted: complex) -> str:
    """The likeliest reason for a power that is not the case's."""

    def near(other: complex) -> bool:
        return abs(seen - other) < _NEAR * abs(other)

    if near(-wanted):
        return "is the sign of its P and Q turned?"
    if near(wanted.conjugate()):
        return "is the sign of its Q turned?"
    if near(complex(wanted.imag, wanted.real)):
        return "are its P and Q exchanged?"
    for factor, question in _UNITS.items():
        if near(factor * wanted):
            return question
    return (
        "is the record of another hour, or a converter beside it counted with it? Give a case with the powers of the "
        "record"
    )


def _turned(measured: Measurements, prepared: PreparedScenario) -> Iterator[tuple[str, str]]:
    for place, own in _beside_the_case(measured, prepared):
        seen = _megawatts(place, measured.base)
        if abs(seen + own) < _ALIKE * abs(own):
            yield (
                place.name,
                f"{place.name}: its P is {seen:+.4g} MW in the record and {own:+.4g} MW in the case: is the sign of "
                "its P and Q turned? P and Q count into the grid; the energy that flows from it counts with this sign",
            )


def _beside_the_case(
    measured: Measurements, prepared: PreparedScenario
) -> Iterator[tuple[Site, float]]:
    """Places of the case's units, each with what the unit feeds there [MW], as far as that is not about nothing."""
    if prepared.power_flow is None:
        return
    plans = prepared.system.components
    fed = {
        name.casefold(): power.real * plans[name].number("S_n")
        for name, power in prepared.power_flow.powers.items()
        if name in plans
    }
    for place in measured.places:
        own = fed.get(place.name.casefold()) if place.kind == "unit" else None
        if own is not None and abs(own) >= _LEAST_MW:
            yield place, own


def _megawatts(place: Site, base: float) -> float:
    return float(place.p.mean()) * 100 / base
