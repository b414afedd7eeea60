"""Undervoltage relays inside motors that count at rest: they are held, so that what they will trip is still in service.

Nothing else of the motor answers a relay before its trip, so that the modes without its states are those until then."""

from collections.abc import Iterator

from orchestrator.linear.models.drifting_states import hold
from orchestrator.systems.coupling.master import Master

_LIMIT = "VI"  # voltage [pu] below which the relay counts
_AT_REST = "v_0"  # voltage of the operating point [pu]
_RATED = "f_n"  # [Hz]
_CYCLES = ("TI", "TB")  # delay of the relay, and of its breaker [cycles of f_n]
_LATCH = "relay.latch"
_DECIDED = 0.5  # of the latch, above which the relay has tripped
_STATES = ("relay.counted", _LATCH, "relay.opening")


def waiting_relays(master: Master) -> Iterator[tuple[str, float, float, float]]:
    """Yield each motor whose relay counts at its start: name, voltage and limit [pu], time until it trips [s]."""
    for name, component in master.components.items():
        needed = (_LATCH, _LIMIT, _AT_REST, _RATED, *_CYCLES)
        if not {*needed, *_STATES} <= component.description.variables.keys():
            continue
        latch, limit, voltage, rated, *cycles = map(component.values(needed).__getitem__, needed)
        if voltage < limit and latch <= _DECIDED:
            yield name, voltage, limit, sum(cycles) / rated


def hold_waiting_relays(master: Master) -> frozenset[str]:
    """Leave the states of such relays out of steady states and linear models, and return their names."""
    states = [f"{name}.{state}" for name, *_ in waiting_relays(master) for state in _STATES]
    hold(master, states)
    return frozenset(states)
