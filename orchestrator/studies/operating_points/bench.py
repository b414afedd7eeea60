"""FMUs that serve one operating point after the other, and the linear models that were made of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.closing import Closing
from orchestrator.core.errors import AnalysisError, ComponentError, InputError, few
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, continuous
from orchestrator.linear.models.slope_linearization import covers, linearize_slopes
from orchestrator.linear.models.state_access import StateAccess
from orchestrator.studies.modes.modes import running
from orchestrator.studies.modes.start_errors import start_errors
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.step_awareness import other_step
from orchestrator.systems.coupling.system import ComponentPlan

DRIVEN, OBSERVED = ("droop.delta_P_ref", "droop.delta_Q_ref"), ("omega",)
"""Of a converter: where damping controllers act, and what they measure."""

_SHOWN = 3
_KEPT = 2000  # linear models that are kept at once


@dataclass(frozen=True)
class PointModel:
    """The linear model of a running system without a communication step, and those of its components."""

    model: LinearModel
    blocks: Blocks
    # with what damping controllers act on and measure
    components: dict[str, ComponentLinearization]
    doubts: tuple[str, ...]  # a warning where a limit is so close that the model is doubtful


class PointBench(Closing):
    """Holds the FMUs of one operating point; the next one gets the same FMUs, reset, where it has the same."""

    def __init__(self, *, remember: bool = False) -> None:
        """``remember``: keep the linear models of components by their FMU's whole state."""
        self._remembered: dict[Any, Any] | None = {} if remember else None
        self._master: Master | None = None
        self._models: dict[Any, ComponentLinearization] = {}
        self._like: dict[Path, ComponentLinearization] = {}
        self.perturbed = self.reused = 0

    def master(self, prepared: PreparedScenario) -> Master:
        if self._master is not None and _same_fmus(self._master, prepared):
            try:
                self._master.restart(prepared.system)
            except BaseException as error:
                self.close()
                found = start_errors(prepared, error) if isinstance(error, ComponentError) else None
                if found is not None:
                    raise found from error
                raise
            self._master.index = 0
            self._master.handed_over = False
            return self._master
        self.close()
        self._master = running(prepared)
        self._master.remembered = self._remembered
        return self._master

    @contextmanager
    def serving(self, prepared: PreparedScenario) -> Iterator[Master]:
        """The FMUs at a point. After an error they are closed, but where only the analysis has no result there: what a
        failed FMU is worth after a reset is not known."""
        try:
            yield self.master(prepared)
        except BaseException as error:
            if not _is_of_analysis(error):
                self.close()
            raise

    def linearized(self, name: str) -> ComponentLinearization:
        """One component at the operating point; equal ones are perturbed once.

        A linear model depends on the FMU, its parameters, its states and its inputs; where all these are equal to the
        last digit, the model that is there is taken."""
        master = self._master
        assert master is not None
        component, plan, exchange = (
            master.components[name],
            master.system.components[name],
            master.exchanges[name],
        )
        at = (
            StateAccess(component).read().tobytes(),
            RealBatch(component, exchange.inputs.names).read().tobytes(),
        )
        path, asked = plan.description.path, (exchange.inputs.names, exchange.outputs.names)
        key = (
            path,
            tuple(sorted(plan.parameters.items())),
            tuple(plan.inputs.items()),
            *asked,
            *at,
        )
        if key not in self._models:
            if len(self._models) >= _KEPT:
                self._models.clear()
            driven, observed = (DRIVEN, OBSERVED) if is_converter(plan) else ((), ())
            with other_step(master, name, 0.0):
                found = linearize_slopes(
                    exchange,
                    master.time,
                    master.clock.step_size,
                    driven,
                    observed,
                    self._like.get(path),
                )
            self._models[key] = found
            known = self._like.setdefault(path, found)
            if covers(
                found, known
            ):  # without a unit, the grid has fewer inputs: the model of all serves longer
                self._like[path] = found
            self.perturbed += 1
        else:
            self.reused += 1
        return self._models[key]

    def linear_model(self) -> PointModel:
        assert self._master is not None
        whole = {name: self.linearized(name) for name in self._master.components}
        blocks = Blocks(
            self._master,
            known={n: without_references(c) for n, c in whole.items()},
            without_step=True,
        )
        doubtful = [f"{name}: {few(c.doubtful, _SHOWN)}" for name, c in whole.items() if c.doubtful]
        text = (
            f"a limit is so close that the linear model is doubtful: {few(doubtful, _SHOWN, '; ')}"
        )
        return PointModel(continuous(blocks), blocks, whole, (text,) if doubtful else ())

    def close(self) -> None:
        """Free the FMUs; calling it again does nothing."""
        master, self._master = self._master, None
        if master is not None:
            master.close()


def is_converter(plan: ComponentPlan) -> bool:
    """Return whether a component is a converter with references that a damping controller acts on, and a frequency."""
    return plan.kind == "converter" and all(
        name in plan.description.variables for name in (*DRIVEN, *OBSERVED)
    )


def without_references(c: Any) -> Any:
    """A converter's linear model without the references that damping controllers act on."""
    m = len(c.inputs) - (len(DRIVEN) if c.observed else 0)
    return replace(c, inputs=c.inputs[:m], B_c=c.B_c[:, :m], D=c.D[:, :m], observed=())


def _is_of_analysis(error: BaseException) -> bool:
    """Return whether an error says that there is no steady state, or no mode to believe, and that no FMU failed."""
    if not isinstance(error, AnalysisError | InputError):
        return False
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, ComponentError):
        cause = cause.__cause__ or cause.__context__
    return cause is None


def _same_fmus(master: Master, prepared: PreparedScenario) -> bool:
    """Tell if the running FMUs can serve the next point. Others' are opened anew: many cannot go on after a reset."""
    system, other = master.system, prepared.system
    paths = {n: plan.description.path for n, plan in system.components.items()}
    return (
        not (system.wires or other.wires)
        and system.connections == other.connections
        and list(system.components) == list(other.components)
        and paths == {n: plan.description.path for n, plan in other.components.items()}
        and all(map(is_ours, set(paths.values())))
        and all(
            plan.isolated == other.components[n].isolated for n, plan in system.components.items()
        )
        and master.schedule == prepared.schedule
        and master.clock.step_size == prepared.step_size
    )
