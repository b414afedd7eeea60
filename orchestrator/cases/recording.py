"""What of a scenario is recorded and how often, and whether that is what the case wants."""

import fnmatch

from orchestrator.cases.draft import Draft
from orchestrator.cases.names import variables_of
from orchestrator.cases.schema import ForcingTable
from orchestrator.coupling.clock import Clock
from orchestrator.errors import InputError, Problem

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
    outputs = [f"{n}.{v}" for n, fmu in plans.items() for v in fmu.outputs if fmu.variables[v].type == "Real"]
    events = draft.given.case.events if draft.given.scenario.events is None else draft.given.scenario.events
    forced = any(isinstance(event, ForcingTable) for event in events)
    patterns = [*draft.given.case.solver.record, *(NEEDED_FOR_SOURCES if forced else ())]
    wanted = {name for pattern in patterns for name in fnmatch.filter(outputs, pattern)}
    if outputs and not wanted and draft.given.case.solver.record:
        text = f"nothing is recorded in scenario {draft.given.name!r}: none of its outputs fits a pattern"
        questions.append(Problem(draft.given.place("solver", "record"), text))
    ring = draft.given.case.analysis.ring_down
    shown = [(draft.given.place("analysis", "ring_down"), ring.signal)] if ring else []
    shown += [
        (draft.given.place("plots", k, "panels", n, "signal"), signal)
        for k, plot in enumerate(draft.given.case.plots)
        for n, panel in enumerate(plot.panels)
        for signal in (panel.signal, *panel.also)
    ]
    for place, expression in shown:
        if missing := [name for name in _variables(expression) if name in outputs and name not in wanted]:
            text = f"{expression!r} is not shown, because solver.record leaves out {' and '.join(missing)}"
            questions.append(Problem(place, text))
    return tuple(name for name in outputs if name in wanted), questions


def _variables(expression: str) -> list[str]:
    try:
        return variables_of(expression)
    except InputError:
        return []  # a problem of its own
