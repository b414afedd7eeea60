"""The undervoltage relays of motors, which are equations of their FMUs, at the operating point."""

from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.questions.plausibility import is_meant
from orchestrator.cases.questions.plausible_values import place_of, value_of
from orchestrator.core.errors import ErrorKind, Problem, QuestionTopic
from orchestrator.core.question_kinds import answer

_LIMIT = "VI"  # parameter [pu] below which the relay counts
_CYCLES = ("TI", "TB")  # delay and time of the breaker [cycles of f_n]
_RATED = "f_n"  # [Hz]


def check_motor_relays(draft: Draft, flow: PowerFlow | None, step_size: float | None) -> None:
    """Ask about motors whose relay counts at the operating point; note those that trip in the first step.

    ``step_size``: communication step [s]; None where it is not known, and a motor that trips at once is noted."""
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
        waits = (cycles[0] or 0.0) / rated
        after = sum(cycle or 0.0 for cycle in cycles) / rated
        seen = (
            f"the undervoltage relay of {name}: the voltage of {buses[name]} rests at {abs(voltage):.4g} pu, below "
            f"VI = {limit:g} pu, so that it trips {after:.3g} s after the start of any run"
        )
        place = place_of(draft, name, _LIMIT)
        if waits <= (step_size or 0.0):
            text = f"{seen}, and there is no steady state; correct VI, or write 0 for a motor without a relay"
            draft.note(place, text, ErrorKind.STEADY_STATE)
        elif not is_meant(f"{name}.{_LIMIT}", draft.given.case.meant):
            draft.found.questions.append(_question(f"{name}.{_LIMIT}", place, seen))


def _question(variable: str, place: str, seen: str) -> Problem:
    text = (
        f"{seen}, as it does in PSS/E; modes are those with the motor, before that; correct VI, or write 0 for a motor "
        f"without a relay; if it is meant, say so at the top of the case: {answer([variable])}"
    )
    about = variable.partition(".")[0]
    return Problem(place, text, topic=QuestionTopic("a motor that trips", about, (variable,)))
