"""The undervoltage relays of motors, which are equations of their FMUs, at the operating point."""

from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.questions.plausible_values import place_of, value_of
from orchestrator.core.errors import ErrorKind

_LIMIT = "VI"  # parameter [pu] below which the relay counts
_CYCLES = ("TI", "TB")  # delay and time of the breaker [cycles of f_n]
_RATED = "f_n"  # [Hz]


def check_motor_relays(draft: Draft, flow: PowerFlow | None) -> None:
    """Note motors whose relay trips at the operating point, so that no steady state holds them."""
    if flow is None or draft.network is None:
        return
    buses = {port.name: port.bus for port in draft.network.ports}
    for name, plan in draft.system.components.items():
        voltage = flow.voltages.get(buses.get(name, ""))
        limit, *cycles = (value_of(plan, variable) for variable in (_LIMIT, *_CYCLES))
        rated = value_of(plan, _RATED)
        if voltage is None or limit is None or not rated or None in cycles:
            continue
        if abs(voltage) >= limit:
            continue
        after = sum(cycle or 0.0 for cycle in cycles) / rated
        text = (
            f"the undervoltage relay of {name}: the voltage of {buses[name]} rests at {abs(voltage):.4g} pu, below "
            f"VI = {limit:g} pu, so that it trips {after:.3g} s after the start of any run, and there is no steady "
            "state; correct VI, or write 0 for a motor without a relay"
        )
        draft.note(place_of(draft, name, _LIMIT), text, ErrorKind.STEADY_STATE)
