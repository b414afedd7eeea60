"""Modes of a coupled system with a black box in it.

The box is measured alone, at an ideal bus that holds the voltage of the operating point, and a model over the
communication step is fitted to it. All other components are perturbed where they are. The step map is composed as
always; the box's states in it are those of the fitted model and mean nothing one by one, only together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.devices.fmi.component import Component
from orchestrator.linear.doubts.examination import Examination
from orchestrator.linear.doubts.linearity import doubts, tell
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.device_start import misfits_of, sentences
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.sampled import repeating, steps_of_period
from orchestrator.linear.models.state_access import StateAccess, obstacle
from orchestrator.linear.models.state_space import StateSpace, state_space
from orchestrator.linear.models.steady_state import OperatingPoint, what_to_check
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, Mode, find_spectrum
from orchestrator.studies.black_box.bench import Bench
from orchestrator.studies.black_box.fitting import IdentifiedModel, fit, require_fitting
from orchestrator.studies.black_box.frequency_response import Excitation, FrequencyResponse, measure
from orchestrator.studies.modes.modes import ModesResult, modes_from, modes_of, running
from orchestrator.systems.coupling.master import Master

STEADY = 1e-6  # largest difference of the box's current [pu] at the ideal bus from the power flow's
# largest change of a known component's state in a step; the same limit holds without black box
STILL = 1e-9


@dataclass(frozen=True)
class BoxedSystem:
    component: str
    response: FrequencyResponse
    identified: IdentifiedModel
    model: LinearModel
    # the larger of two changes: of a known component's state in one communication step, and of the box's current from
    # its start to its rest at the ideal bus
    residual: float
    # reasons in the other components for doubts about the modes from 0.1 to 2 Hz
    warnings: tuple[str, ...] = ()
    # what does not fit between devices and their bindings; among the warnings too
    misfits: tuple[str, ...] = ()

    def modes(
        self,
        lowest_hz: float = ELECTROMECHANICAL_HZ[0],
        highest_hz: float = ELECTROMECHANICAL_HZ[1],
    ) -> list[Mode]:
        return find_spectrum(self.model, lowest_hz, highest_hz).modes


def is_black_box(component: Component) -> bool:
    """Return whether a component does not show its states, so that it cannot be perturbed like the others."""
    return obstacle(component) is not None


def component_participation(mode: Mode, component: str) -> float:
    """|Σ l*·r| over the states of one component, with lᴴ·r = 1 over all states.

    Unlike the sum of the states' factors it does not depend on which states describe the component, so it is the same
    for a fitted model as for the device's own equations."""
    names = [name for name in mode.shape if name.partition(".")[0] == component]
    return float(abs(sum(mode.left[name].conjugate() * mode.shape[name] for name in names)))


def linearize_with_box(
    master: Master,
    component: str,
    excitation: Excitation | None = None,
    *,
    restore: bool | None = None,
    report: Callable[[str], None] | None = None,
) -> BoxedSystem:
    """Identify one component and linearise the coupled system around where the master is.

    ``master``: at the power flow's operating point; nothing is stepped, so an unstable system serves as well.
    ``restore``: whether the bench saves and restores the box's state; None if it does so whenever the FMU can."""
    if component not in master.components:
        raise InputError(
            f"there is no component {component!r}; there are: {', '.join(master.components)}"
        )
    require_fitting()
    misfits = sentences(misfits_of(master))
    residual = _check_still(master, [component])
    response, moved = _respond(
        master, component, excitation or Excitation(), restore=restore, report=report
    )
    identified = fit(response)
    blocks = Blocks(master, known={component: _as_component(component, identified)})
    model = compose(blocks, master.schedule)
    doubtful = doubts(blocks, master.schedule, model, find_spectrum(model).modes)
    return BoxedSystem(
        component,
        response,
        identified=identified,
        model=model,
        residual=max(moved, residual),
        warnings=(*misfits, *tell(doubtful)),
        misfits=misfits,
    )


def modes_with_boxes(
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    critical: float | None = None,
    excitation: Excitation | None = None,
    report: Callable[[str], None] | None = None,
) -> ModesResult:
    """Modes as `modes_of` finds them; components that hide their states are identified first.

    ``prepared`` and ``master`` and ``frequency_range`` and ``critical``: as `modes_of`; to identify anything, the
    master must be at rest at the power flow's operating point."""
    if not any(map(is_black_box, master.components.values())):
        return modes_of(prepared, master, frequency_range, critical)
    return _with_boxes(
        prepared, master, frequency_range, critical, excitation or Excitation(), report
    )[0]


def coupled_with_boxes(
    prepared: PreparedScenario, frequency_range: tuple[float, float]
) -> ModesResult:
    """The same of a scenario that does not run yet."""
    with running(prepared) as master:
        return modes_with_boxes(prepared, master, frequency_range)


def linear_with_boxes(
    prepared: PreparedScenario, master: Master, inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[StateSpace, OperatingPoint, Examination]:
    """The step map from inputs to outputs, with the verdict on it."""
    found, blocks = _with_boxes(
        prepared,
        master,
        frequency_range=ELECTROMECHANICAL_HZ,
        critical=None,
        excitation=Excitation(),
        report=None,
        inputs=inputs,
        outputs=outputs,
    )
    space = state_space(blocks, master.schedule)
    return space, found.operating_point, Examination(found.stability, found.warnings)


def _with_boxes(
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    critical: float | None,
    excitation: Excitation,
    report: Callable[[str], None] | None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> tuple[ModesResult, Blocks]:
    boxes = [name for name, component in master.components.items() if is_black_box(component)]
    require_fitting()
    most, kept = 0.0, dict[tuple[Any, ...], tuple[ComponentLinearization, float]]()

    def identified(master: Master) -> dict[str, ComponentLinearization]:
        nonlocal most
        most, known = max(most, _check_still(master, boxes)), {}
        for name in boxes:
            key = _measured(master, name)
            if (
                key not in kept
            ):  # another scenario, for the names, often has the same box at the same point
                response, moved = _respond(master, name, excitation, report=report)
                kept[key] = _as_component(name, fit(response)), moved
            known[name], moved = kept[key]
            most = max(most, moved)
        return known

    blocks = Blocks(master, inputs=inputs, outputs=outputs, known=identified(master))
    point = OperatingPoint(most, most / master.clock.step_size, most, 0, {})
    return modes_from(
        prepared,
        master,
        point=point,
        blocks=blocks,
        frequency_range=frequency_range,
        critical=critical,
        black_boxes=identified,
    ), blocks


def _measured(master: Master, name: str) -> tuple[Any, ...]:
    """All that a component's measurement follows from."""
    exchange, plan = master.exchanges[name], master.system.components[name]
    return (
        name,
        plan.description.path,
        plan.description.guid,
        tuple(sorted(plan.parameters.items())),
        tuple(sorted(plan.inputs.items())),
        master.arriving(name).tobytes(),
        exchange.outputs.values.tobytes(),
        master.clock.step_size,
    )


def _respond(
    master: Master,
    name: str,
    excitation: Excitation,
    *,
    restore: bool | None = None,
    report: Callable[[str], None] | None = None,
) -> tuple[FrequencyResponse, float]:
    """Measure one component at an ideal bus. Also return the difference of its current from the power flow's."""
    exchange, plan = master.exchanges[name], master.system.components[name]
    bench = Bench(
        plan.description,
        plan.parameters,
        rest=master.arriving(name),
        inputs=exchange.inputs.names,
        outputs=exchange.outputs.names,
        held=plan.inputs,
        step_size=master.clock.step_size,
        restore=restore,
        isolated=plan.isolated,
    )
    response = measure(bench, excitation, report)
    moved = float(np.abs(response.operating_point - exchange.outputs.values).max())
    if not moved <= STEADY:
        raise AnalysisError(
            f"no steady state: alone at an ideal bus, component {name!r} moves its current by {moved:.3g} pu from the "
            f"power flow's, where {STEADY:g} is allowed; check that it starts at the P_0, Q_0, v_0 and theta_0 that it "
            "is given"
        )
    return response, moved


def _check_still(master: Master, boxes: Sequence[str]) -> float:
    """Largest change of a known state in one communication step. With a black box, no better operating point can be
    solved for."""
    if steps_of_period(master, master.clock.step_size, without=boxes) > 1:
        sampled = ", ".join(name for name in repeating(master) if name not in boxes)
        raise AnalysisError(
            f"{sampled} is sampled beside the communication step, or works on phase quantities, so each step differs "
            f"from the last, and no map of one step describes it beside the black box {', '.join(boxes)}; measure "
            f"{sampled} itself as the black box, or take `gfor modes` where every component lets its states be set"
        )
    moves = {name: _movement(master, name) for name in master.components if name not in boxes}
    worst = max(moves, key=lambda name: moves[name], default=None)
    if worst is None:
        return 0.0
    if not moves[worst] <= STILL:
        raise AnalysisError(
            f"no steady state: from the power flow's start, a communication step changes a state of component "
            f"{worst!r} by {moves[worst]:.3g}, where {STILL:g} is allowed; " + what_to_check(master)
        )
    return moves[worst]


def _movement(master: Master, name: str) -> float:
    """Largest change of a component's states over one step with its inputs as they are; it is put back."""
    component = master.components[name]
    access = StateAccess(component)
    saved = component.save_state()
    try:
        before = access.read()
        component.step(master.time, master.clock.step_size)
        return float(np.abs(access.read() - before).max(initial=0.0))
    finally:
        component.restore_state(saved)
        component.free_state(saved)


def _as_component(name: str, model: IdentifiedModel) -> ComponentLinearization:
    n = len(model.A)
    none = np.zeros((0, n)), np.zeros((0, len(model.inputs)))
    return ComponentLinearization(
        name,
        tuple(f"identified.{k + 1}" for k in range(n)),
        model.inputs,
        model.outputs,
        model.A,
        model.B,
        model.C,
        model.D,
        (),
        *none,
        None,
        None,
        model.error,
        IDENTIFIED,
    )
