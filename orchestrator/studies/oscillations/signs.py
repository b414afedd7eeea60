"""Powers of a record beside what the case's units feed: signs that are turned, and other operating points."""

from __future__ import annotations

from collections.abc import Container, Iterator
from typing import TYPE_CHECKING

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
        seen = _megawatts(place, measured.base)
        if own is not None and abs(own) >= _LEAST_MW and abs(seen + own) < _ALIKE * abs(own):
            yield (
                place.name,
                f"{place.name}: its P is {seen:+.4g} MW in the record and {own:+.4g} MW in the case: is the sign of "
                "its P and Q turned? P and Q count into the grid; the energy that flows from it counts with this sign",
            )


def _megawatts(place: Site, base: float) -> float:
    return float(place.p.mean()) * 100 / base
