"""The continuous model of a system whose dead bands are 0, from the components that have them alone.

At its operating point a closed loop feeds nothing, so that all else is as it was: only these components are opened,
each with the band and without it, and what differs in their equations is added to the system's."""

from collections.abc import Mapping
from dataclasses import replace

import scipy.sparse as sp

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.state_access import StateAccess
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import ComponentPlan, System


def with_plans(result: ModesResult, changed: PreparedScenario) -> LinearModel:
    """The continuous model with the plans of a scenario that has another one of some components with resting loops.

    Raises `AnalysisError` where the system has no continuous model, or a connection that changes its value feeds what
    the change reads."""
    if result.system is None:
        raise AnalysisError(
            "a component gives no derivatives, so that there is no continuous model"
        )
    names = [name for name in result.resting if changed.system.components.get(name)]
    own, other = (
        _alone(result, {name: scenario.system.components[name] for name in names})
        for scenario in (result.prepared, changed)
    )
    added = _Additions(result.system, result.prepared)
    for name in names:
        added.take(own[name], other[name])
    return added.model()


def _alone(
    result: ModesResult, plans: Mapping[str, ComponentPlan]
) -> dict[str, ComponentLinearization]:
    """Linearise components at the operating point, with their inputs held."""
    system, prepared = System(), result.prepared
    for name, plan in plans.items():
        system.components[name] = replace(
            plan, inputs=plan.inputs | dict(result.resting[name].inputs)
        )
    ends = [f"{name}.{v}" for name in plans for v in result.resting[name].inputs]
    exits = [f"{name}.{v}" for name in plans for v in result.resting[name].outputs]
    schedule = gauss_seidel((tuple(plans),))
    with Master(system, schedule, prepared.step_size, prepared.stop_time) as master:
        for name, component in master.components.items():
            access = StateAccess(component)
            states = access.read()
            for k, state in enumerate(component.description.states):
                states[k] = result.operating_point.states.get(f"{name}.{state}", states[k])
            access.write(states)
        blocks = Blocks(master, inputs=ends, outputs=exits, without_step=True, once=True)
    return dict(blocks.components)


class _Additions:
    """Additions to the equations of a continuous model, of states first, then of wires."""

    def __init__(self, model: LinearModel, prepared: PreparedScenario) -> None:
        self._model = model
        every = [*model.names, *model.wires]
        self._places = {name: k for k, name in enumerate(every)}
        wires = {str(target) for target in prepared.system.wires}
        self._feeding = {
            str(c.target): str(c.source)
            for c in prepared.system.connections
            if str(c.target) not in wires
        }
        self._added: dict[tuple[int, int], float] = {}

    def take(self, own: ComponentLinearization, other: ComponentLinearization) -> None:
        """Add what one component's equations have more than before."""
        if own.A_c is None or own.B_c is None or other.A_c is None or other.B_c is None:
            raise AnalysisError(f"component {own.name!r} gives no derivatives")
        states = [f"{own.name}.{state}" for state in own.states]
        exits = [f"{own.name}.{variable}" for variable in own.observed]
        entries = [self._feeding.get(f"{own.name}.{v}", "") for v in own.inputs]
        self._add(states, states, other.A_c - own.A_c)
        self._add(states, entries, other.B_c - own.B_c)
        self._add(exits, states, other.C_o - own.C_o)
        self._add(exits, entries, other.D_o - own.D_o)

    def _add(self, rows: list[str], columns: list[str], block: Matrix) -> None:
        for i, k in zip(*block.nonzero(), strict=True):
            places = self._places.get(rows[i]), self._places.get(columns[k])
            if places[0] is None or places[1] is None:
                raise AnalysisError(f"{rows[i]} or what it reads is no part of the linear model")
            self._added[places[0], places[1]] = float(block[i, k])

    def model(self) -> LinearModel:
        """The model with what was added."""
        model, n = self._model, len(self._model.names)
        size = n + len(model.wires)
        rows, columns = zip(*self._added, strict=True) if self._added else ((), ())
        added = sp.csr_array((list(self._added.values()), (rows, columns)), shape=(size, size))
        return replace(
            model,
            F=sp.csr_array(model.F + added[:n, :n]),
            G=sp.csr_array(model.G + added[:n, n:]),
            H=sp.csr_array(model.H + added[n:, :n]),
            K=sp.csr_array(model.K + added[n:, n:]),
        )
