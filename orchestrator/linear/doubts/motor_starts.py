"""Warnings of motors that trip after the start, and of those that are hardly motors beside their susceptance."""

from collections.abc import Iterator

from orchestrator.linear.models.waiting_relays import waiting_relays
from orchestrator.systems.coupling.master import Master

_BESIDE = "B_shunt"  # susceptance beside an induction machine [pu, S_n]; above 0 capacitive
_START = "slip_0"
_GIVEN = ("P_0", "Q_0", "S_n", "v_0")


def motor_warnings(master: Master) -> tuple[str, ...]:
    """Warn of motors with more Mvar beside them than MW that they draw, and of those about to trip; at the start."""
    beside = (text for name in master.components for text in _of_machine(master, name))
    return (*beside, *(_about_to_trip(*one) for one in waiting_relays(master)))


def _about_to_trip(name: str, voltage: float, limit: float, after: float) -> str:
    return (
        f"{name} is about to trip: its undervoltage relay counts below VI = {limit:g} pu, and the voltage rests at "
        f"{voltage:.4g} pu; a run trips it {after:.3g} s after its start, and the modes are those before that"
    )


def _of_machine(master: Master, name: str) -> Iterator[str]:
    component = master.components[name]
    if not {_BESIDE, _START, *_GIVEN} <= component.description.variables.keys():
        return
    found = component.values([_BESIDE, *_GIVEN])
    rating = found["S_n"]
    drawn_mw, drawn_mvar = -found["P_0"] * rating, -found["Q_0"] * rating
    beside = found[_BESIDE] * found["v_0"] ** 2 * rating
    if abs(beside) <= abs(drawn_mw):
        return
    feeds = "feeds" if beside > 0 else "draws"
    yield (
        f"{name}: beside it a susceptance {feeds} {abs(beside):.4g} Mvar ({_BESIDE}), more than the "
        f"{abs(drawn_mw):.4g} MW of the machine, which alone draws {drawn_mvar + beside:.4g} Mvar where the power "
        f"flow has {drawn_mvar:.4g}: it follows the voltage as a shunt does; correct the rating, "
        f"S_n = {rating:.4g} MVA (MBASE or PMULT of its record), or the load's reactive power"
    )
