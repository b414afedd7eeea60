"""Check that exciters outside of their machines hold what the machines were started for, and what to type if not.

A machine with ``exciter = "external"`` computes the field voltage and the terminal voltage of its operating point. Its
exciter is another component, whose start and reference nobody but the user knows by name."""

from collections.abc import Iterator
from typing import NamedTuple

from orchestrator.systems.coupling.master import Master

# variables of a machine whose exciter is another FMU
_NEEDED = "exciter.E_fd_0"  # field voltage at the start [pu]
_HELD = "exciter.v_t_0"  # terminal voltage at the start [pu]
_VOLTAGE = "v_t"  # terminal voltage [pu]
_FIELD = "exciter.E_fd"  # field voltage that comes from outside [pu]
_APART = 1e-4  # difference that is said [pu]


class _Outside(NamedTuple):
    """A machine with the output that gives its field voltage, and what both need [pu]."""

    machine: str
    exciter: str
    output: str
    field: float
    voltage: float


def _outside(master: Master) -> Iterator[_Outside]:
    for connection in master.system.connections:
        machine, exciter = connection.target.component, connection.source.component
        component = master.components[machine]
        wanted = (_NEEDED, _HELD, _VOLTAGE)
        if connection.target.variable == _FIELD and component.description.variables.keys() >= set(
            wanted
        ):
            found = component.values([_NEEDED, _HELD])
            yield _Outside(
                machine, exciter, connection.source.variable, found[_NEEDED], found[_HELD]
            )


def start_warnings(master: Master) -> tuple[str, ...]:
    """Warn of exciters that give another field voltage than their machine needs; for a master at its start."""
    said = []
    for one in _outside(master):
        given = master.components[one.exciter].values([one.output])[one.output]
        if abs(given - one.field) > _APART:
            start = f"initial.{one.output}"
            known = start in master.components[one.exciter].description.variables
            where = (
                f"{start} = {one.field:.8g}"
                if known
                else f"the start of its output, {one.field:.8g},"
            )
            said.append(
                f"{one.exciter}: it starts with {one.output} = {given:.6g}, and {one.machine} needs {one.field:.8g} pu "
                f"({_NEEDED}): a run begins with a swing; write {where} into the parameters of {one.exciter}"
            )
    return tuple(said)


def settled_warnings(master: Master) -> tuple[str, ...]:
    """Warn of exciters that hold another voltage than their machine was started for; for a master in steady state."""
    said = []
    for one in _outside(master):
        voltage = master.components[one.machine].values([_VOLTAGE])[_VOLTAGE]
        if abs(voltage - one.voltage) > _APART:
            said.append(
                f"{one.machine}: {one.exciter} holds its terminal voltage at {voltage:.6g} pu, and it was started for "
                f"{one.voltage:.8g} pu ({_HELD}): the modes are those of another operating point; write a reference "
                f"into {one.exciter} with which it gives {one.field:.8g} pu ({_NEEDED}) at that voltage"
            )
    return tuple(said)
