"""The linear model of a scenario: exported for other tools, and laid over the simulated response."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.cases.form.names import variables_of
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import InputError, few
from orchestrator.core.late import xr
from orchestrator.core.threads import side_by_side
from orchestrator.linear.doubts.examination import Examination, examine
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import (
    Blocks,
    compose,
    continuous,
    continuous_model,
)
from orchestrator.linear.models.state_access import obstacle
from orchestrator.linear.models.state_space import StateSpace, state_space
from orchestrator.linear.models.steady_state import OperatingPoint, find_operating_point
from orchestrator.linear.spectra.modes import Spectrum, find_spectrum
from orchestrator.linear.spectra.slowest_decay import LEAST_STATES
from orchestrator.linear.spectra.stability import WHOLE, judge, whole_spectrum
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.events import Event, faults_among
from orchestrator.systems.coupling.master import Master


def default_inputs(prepared: PreparedScenario) -> list[str]:
    """Return what the scenario's events change, as far as a linear model can be driven by it.

    What an event sets beside a switch, such as a fault's reactance, has no effect before it."""
    changed = [
        f"{component}.{variable}"
        for event in prepared.events
        if not _switches(event)
        for component, settings in event.changes().items()
        for variable in settings
    ]
    return list(dict.fromkeys(changed))


def tell_left_out(prepared: PreparedScenario) -> tuple[str, ...]:
    """Return a sentence where events of the scenario are no inputs by default, as they switch something."""
    switching = [str(event) for event in prepared.events if _switches(event)]
    if not switching:
        return ()
    return (
        f"a linear model cannot follow what switches, so these events are no inputs: {few(switching, 2, '; ')}",
    )


def _switches(event: Event) -> bool:
    return any(
        isinstance(value, bool)
        for settings in event.changes().values()
        for value in settings.values()
    )


def default_outputs(prepared: PreparedScenario) -> list[str]:
    """Return what the case plots or reads a ring-down from, as far as the scenario has it."""
    case = prepared.case
    expressions = [panel.signal for plot in case.table.plots for panel in plot.panels]
    if case.table.analysis.ring_down:
        expressions.append(case.table.analysis.ring_down.signal)
    names = dict.fromkeys(name for expression in expressions for name in variables_of(expression))
    return [name for name in names if _is_output(prepared, name)]


def _is_output(prepared: PreparedScenario, name: str) -> bool:
    component, _, variable = name.partition(".")
    plan = prepared.system.components.get(component)
    return plan is not None and variable in plan.description.outputs


def linear_model(
    prepared: PreparedScenario,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    as_continuous: bool = False,
    boxes: Callable[..., tuple[StateSpace, OperatingPoint, Examination]] | None = None,
    report: Callable[[str], None] | None = None,
) -> tuple[StateSpace, OperatingPoint, Examination]:
    """The scenario's linear model around its steady state, as step map or continuous, with the verdict on it.

    The verdict on the continuous model is its own; beside it stands what is to be said of the step map.

    ``inputs`` and ``outputs``: names ``component.variable``; an output may be a difference ``a.b - c.d``.
    ``as_continuous``: A model in continuous time instead of the map over one communication step.
    ``boxes``: finds the step map where components hide their states.
    ``report``: called with a sentence before what takes long in a large system."""
    parts = {output: variables_of(output) for output in outputs}
    phasors = [output for output in outputs if "|" in output]
    if phasors:
        raise InputError(f"outputs: {phasors[0]!r}: a magnitude is not linear; give its two parts")
    wanted, outputs = (
        list(outputs),
        list(dict.fromkeys(name for names in parts.values() for name in names)),
    )
    select = np.array(
        [[(n == parts[w][0]) - 1.0 * (n in parts[w][1:]) for n in outputs] for w in wanted]
    )
    with running(prepared) as master:
        if boxes is not None and any(map(obstacle, master.components.values())):
            space, point, examined = boxes(prepared, master, inputs, outputs)
            return _selected(space, select, wanted), point, examined
        point = find_operating_point(master)
        blocks = Blocks(master, inputs=inputs, outputs=outputs, derivatives=True)
        model, system = compose(blocks, master.schedule), continuous_model(master, blocks)
        of_map, of_system = _spectra(model, system, report)
        examined = examine(master, blocks, model, system, spectrum=of_map, of_system=of_system)
        if not as_continuous:
            return _selected(state_space(blocks, master.schedule), select, wanted), point, examined
        if not blocks.serves_continuous:
            blocks = Blocks(master, inputs=inputs, outputs=outputs, without_step=True)
        space = state_space(blocks, None)
        own = judge(continuous(blocks), of_system)
        warnings = examined.warnings
        if examined.stability.stable is None:
            own = replace(own, stable=None, reason=examined.stability.reason)
        elif examined.stability.stable is not own.stable:
            warnings = (
                f"with the communication step the system is {examined.stability.sentence()}",
                *warnings,
            )
        return _selected(space, select, wanted), point, Examination(own, warnings)


def _spectra(
    model: LinearModel, system: LinearModel | None, report: Callable[[str], None] | None
) -> tuple[Spectrum | None, Spectrum | None]:
    """All eigenvalues of a step map, with its modes, and of the continuous model, for the verdict on them.

    None for a model that is too large for all of them, or is not there."""
    states = len(model.names)
    if report is not None and states >= LEAST_STATES:
        what = "all eigenvalues" if states <= WHOLE else "what grows"
        both = "" if system is None else " and of the continuous model"
        report(f"{what} of {states} states, of the step map{both}, for the verdict on the model")
    with side_by_side(pays=states >= LEAST_STATES) as pool:
        of_map = pool.submit(_spectrum_with_modes, model)
        of_system = pool.submit(_spectrum_of, system)
        return of_map.result(), of_system.result()


def _spectrum_with_modes(model: LinearModel) -> Spectrum | None:
    return find_spectrum(model) if len(model.names) <= WHOLE else None


def _spectrum_of(system: LinearModel | None) -> Spectrum | None:
    return None if system is None else whole_spectrum(system)


def _selected(space: StateSpace, select: Matrix, outputs: Sequence[str]) -> StateSpace:
    return (
        replace(space, C=select @ space.C, D=select @ space.D, outputs=tuple(outputs))
        if outputs
        else space
    )


class NoLinearResponseError(InputError):
    """A linear model cannot follow a scenario's events."""


def response_at_steady_state(prepared: PreparedScenario) -> xr.Dataset:
    """`linear_response` of a scenario that does not run yet."""
    with running(prepared) as master:
        find_operating_point(master)
        try:
            return linear_response(master, prepared)
        except NoLinearResponseError as error:
            raise InputError(f"{error}; the co-simulation follows it: run that") from error


def linear_response(master: Master, prepared: PreparedScenario) -> xr.Dataset:
    """Response of the linear step map to the scenario's events, at the recorded times and for all recorded signals."""
    switching = [str(event) for event in prepared.events if _switches(event)]
    faults = faults_among(prepared.events)
    if faults:
        raise NoLinearResponseError(
            f"a linear model cannot follow a fault or a forcing ({faults[0]})"
        )
    if switching:
        raise NoLinearResponseError(
            f"a linear model cannot follow a switching event ({switching[0]})"
        )
    inputs = default_inputs(prepared)
    if not inputs:
        raise InputError(
            f"scenario {prepared.name!r} has no event that a linear model could answer to"
        )
    model = state_space(Blocks(master, inputs=inputs, outputs=prepared.record), master.schedule)
    distance = prepared.record_every * prepared.step_size
    count = 1 + int(np.floor(prepared.stop_time / distance + 1e-9))
    times: Matrix = prepared.record_every * np.arange(count, dtype=np.float64) * prepared.step_size
    before = {name: _value(master, name) for name in inputs}
    total = np.array([_value(master, name) for name in prepared.record]) * np.ones((count, 1))
    for event in sorted(prepared.events, key=lambda e: e.time):
        change = np.zeros(len(inputs))
        for component, settings in event.changes().items():
            for variable, value in settings.items():
                name = f"{component}.{variable}"
                change[inputs.index(name)] = float(value) - before[name]
                before[name] = float(value)
        # what is recorded at the event's time is from before it
        after = times > event.time + prepared.step_size / 2
        if after.any():
            total[after] += model.step_response(change, times[after] - event.time)
    data = {name: ("time", total[:, k]) for k, name in enumerate(prepared.record)}
    return xr.Dataset(data, coords={"time": ("time", times, {"units": "s", "long_name": "Time"})})


def _value(master: Master, name: str) -> float:
    component, _, variable = name.partition(".")
    return master.components[component].get([variable])[variable]
