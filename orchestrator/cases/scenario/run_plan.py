"""Clock, length and schedule of a scenario's run, what of it is recorded and how often."""

import fnmatch
from collections.abc import Sequence

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.names import close_names, variables_of
from orchestrator.cases.form.schema import LONGEST_STEP, ForcingTable
from orchestrator.cases.questions.mentions import shown_signals
from orchestrator.cases.scenario.scheduling import schedule_of
from orchestrator.core.errors import InputError, Problem, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.schedule import Schedule

MOST_STEPS = 1e11  # communication steps of a run: a month and more
_STEPS_A_SECOND = 30_000  # of the two-area system on one core, about


def clock_of(draft: Draft, step_size: float | None) -> Clock | None:
    """The clock of the file, or of the command's step [s]; None if there is none of such a step."""
    try:
        if step_size is not None and step_size > LONGEST_STEP:
            raise InputError(
                f"a communication step of {step_size:g} s is too long; it must be at most {LONGEST_STEP} s"
            )
        return Clock(step_size if step_size is not None else draft.given.case.solver.step_size)
    except InputError as error:
        draft.note(Option.STEP, str(error))
        return None


def check_length(draft: Draft, clock: Clock | None, stop: float) -> None:
    """Refuse a run that nobody lives to see the end of: one of its two times was mistyped."""
    steps = 0.0 if clock is None else stop / clock.step_size
    if steps > MOST_STEPS:
        years = steps / (_STEPS_A_SECOND * 365 * 86400)
        draft.note(
            "solver",
            f"{stop:g} s in steps of {stop / steps:g} s are {steps:.3g} communication steps, which take about "
            f"{years:.2g} years; at most {MOST_STEPS:.0g} are run: stop earlier, or take a longer step",
        )


def checked_schedule(draft: Draft) -> Schedule:
    schedule, solver = _chosen(draft), draft.given.case.solver
    if solver.tolerance is not None and not schedule.is_second_order:
        text = (
            f'a tolerance goes with schedule = "midpoint" or "newton", not with {solver.schedule!r}'
        )
        draft.note(draft.given.place("solver", "tolerance"), text)
    if draft.found.network_failed:
        return schedule
    try:
        schedule.check(set(draft.system.components))
    except InputError as error:
        draft.note(draft.given.place("solver", "groups"), str(error))
    return schedule


def _chosen(draft: Draft) -> Schedule:
    solver = draft.given.case.solver
    if solver.schedule == "jacobi":
        _check_unused_groups(draft, solver.groups or [])
    return schedule_of(
        solver.schedule, solver, draft.grid, draft.system, draft.given.scenario.remove
    )


def _check_unused_groups(draft: Draft, groups: Sequence[Sequence[str]]) -> None:
    """With Jacobi's schedule the groups are kept for later and do nothing; wrong names are wrong all the same."""
    for name in (name for group in groups for name in group if name not in draft.known):
        hint = close_names(
            name, sorted(draft.known), f"the case has: {', '.join(sorted(draft.known))}"
        )
        draft.note(draft.given.place("solver", "groups"), f"there is no component {name!r}; {hint}")


NEEDED_FOR_SOURCES = ("*.i_re", "*.i_im", "*.v_re", "*.v_im", "*.p", "*.q")
"""Recorded besides where something is forced: what tells where an oscillation comes from."""

_EQUAL = 1e-6  # an interval is a multiple of the step if it is one to this part of a step


def record_every(draft: Draft, clock: Clock, stop_time: float) -> tuple[int, tuple[Problem, ...]]:
    """Communication steps between two rows, and what a run asks about the interval that the case states."""
    solver = draft.given.case.solver
    steps = solver.record_interval / clock.step_size
    every = max(1, round(steps))
    if "record_interval" in solver.model_fields_set:
        place = draft.given.place("solver", "record_interval")
        given = f"{solver.record_interval:g} s"
        if abs(steps - every) > _EQUAL:
            rule = f"{given} is no multiple of the communication step of {clock.step_size:g} s"
            text = f"{rule}; rows are recorded every {every * clock.step_size:g} s instead"
            return every, (Problem(place, text),)
        if solver.record_interval > stop_time:
            text = f"{given} is longer than the run of {stop_time:g} s; its start is the only row"
            return every, (Problem(place, text),)
    return every, ()


def recorded(draft: Draft) -> tuple[tuple[str, ...], list[Problem]]:
    """All Real outputs that fit one of the file's patterns, and questions of a run about what it leaves out."""
    questions: list[Problem] = []
    plans = {name: plan.description for name, plan in draft.system.components.items()}
    outputs = [
        f"{n}.{v}"
        for n, fmu in plans.items()
        for v in fmu.outputs
        if fmu.variables[v].type == "Real"
    ]
    forced = any(isinstance(event, ForcingTable) for event in draft.given.events)
    patterns = [*draft.given.case.solver.record, *(NEEDED_FOR_SOURCES if forced else ())]
    wanted = {name for pattern in patterns for name in fnmatch.filter(outputs, pattern)}
    if outputs and not wanted and draft.given.case.solver.record:
        text = f"nothing is recorded in scenario {draft.given.name!r}: none of its outputs fits a pattern"
        questions.append(Problem(draft.given.place("solver", "record"), text))
    for place, expression in shown_signals(draft.given.case, draft.given.place):
        missing = [
            name for name in _variables(expression) if name in outputs and name not in wanted
        ]
        if missing:
            text = f"{expression!r} is not shown, because solver.record leaves out {' and '.join(missing)}"
            questions.append(Problem(place, text, topic=QuestionTopic("a signal that is not kept")))
    return tuple(name for name in outputs if name in wanted), questions


def _variables(expression: str) -> list[str]:
    try:
        return variables_of(expression)
    except InputError:
        return []  # a problem of its own
