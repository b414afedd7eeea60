"""Clock, length and schedule of a scenario's run."""

from collections.abc import Sequence

from orchestrator.cases.draft import Draft
from orchestrator.cases.names import close_names
from orchestrator.cases.scheduling import schedule_of
from orchestrator.cases.schema import LONGEST_STEP
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.schedule import Schedule
from orchestrator.errors import InputError

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
        draft.note("--step", str(error))
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
        draft.note(
            draft.given.place("solver", "tolerance"),
            f'a tolerance goes with schedule = "midpoint" or "newton", not with {solver.schedule!r}',
        )
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
    return schedule_of(solver.schedule, solver, draft.grid, draft.system, draft.given.scenario.remove)


def _check_unused_groups(draft: Draft, groups: Sequence[Sequence[str]]) -> None:
    """With Jacobi's schedule the groups are kept for later and do nothing; wrong names are wrong all the same."""
    for name in (name for group in groups for name in group if name not in draft.known):
        hint = close_names(name, sorted(draft.known), f"the case has: {', '.join(sorted(draft.known))}")
        draft.note(draft.given.place("solver", "groups"), f"there is no component {name!r}; {hint}")
