"""Loads and capacitors of a network's source that are most unusual beside the others."""

from collections.abc import Iterator, Mapping

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_values import value_of

_FAR = 20.0
"""A capacitor or a load that is smaller than the next one by this factor is questioned where 100 times as much is
usual: a figure in per cent or in hundreds."""


def load_doubts(draft: Draft, grid: str, where: str) -> Iterator[UnusualValue]:
    """Ask about loads below zero, and about a capacitor or a load that is much smaller than the others.

    ``grid``: the component whose loads these are; ``where``: the place of their source."""
    plan = draft.system.components[grid]
    if draft.network is None or draft.data is None:
        return
    yield from _negative_loads(draft, grid, where)
    yield from _hundredths(grid, "shunt", "Mvar", draft.data.capacitors, where)
    powers = {
        load.name.removeprefix("load_"): value_of(plan, f"{load.name}.P")
        for load in draft.network.loads
        if load.name.startswith("load_")
    }
    drawn = {bus: p_mw for bus, p_mw in powers.items() if p_mw and p_mw > 0}
    yield from _hundredths(grid, "load", "MW", drawn, where)


def _negative_loads(draft: Draft, grid: str, where: str) -> Iterator[UnusualValue]:
    table, found = draft.given.case.network, draft.data
    if table is None or found is None or table.generation_model.active is not None:
        return
    names = {load.name for load in found.loads}
    for bus, p_mw in found.feeding.items():
        number = bus.removeprefix("bus_")
        apart = f"static_{number}" in names
        beside = " beside what loads draw there" if apart else ""
        text = f"the load at {bus} is {p_mw:g} MW, below zero{beside}: it feeds in, as static generation; is its "
        name = f"{grid}.{'static' if apart else 'load'}_{number}.P"
        yield UnusualValue(name, where, f"{text}sign right?", "a load below zero")


def _hundredths(
    grid: str, what: str, unit: str, found: Mapping[str, float], where: str
) -> Iterator[UnusualValue]:
    """Ask about one that is much smaller than all others, of which only the smallest can be one."""
    if len(found) < 2:
        return
    bus = min(found, key=lambda name: found[name])
    b, others = found[bus], [other for name, other in found.items() if name != bus]
    if b < min(others) / _FAR and 0.2 * min(others) < 100 * b < 5 * max(others):
        number = bus.removeprefix("bus_")
        text = (
            f"the {what} at bus_{number} has {b:g} {unit}, where the others have {min(others):g} to "
            f"{max(others):g} {unit}: is {100 * b:g} {unit} meant?"
        )
        name = f"{grid}.{what}_{number}.{'B' if what == 'shunt' else 'P'}"
        yield UnusualValue(name, where, text, f"a {what} much smaller than the others")
