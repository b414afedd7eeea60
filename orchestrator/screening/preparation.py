"""Preparing one operating point with its outage, and what it means where that fails."""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.coupling.system import System
from orchestrator.errors import CosimError, ErrorKind
from orchestrator.points.failure import Failure
from orchestrator.screening.columns import Elements
from orchestrator.screening.outages import cut_off
from orchestrator.screening.record import Item, Status
from orchestrator.screening.service import switched_off, without_units

ACCEPT = 1e-9
"""Largest change of a state over a communication step with which the power flow's point is a steady state."""

_PACKAGE = Path(__file__).parent.parent

_STATUS = {
    ErrorKind.INPUT: Status.VALUES,
    ErrorKind.VALUES: Status.VALUES,
    ErrorKind.UNITS: Status.VALUES,
    ErrorKind.POWER_FLOW: Status.POWER_FLOW,
    ErrorKind.START: Status.STEADY_STATE,
    ErrorKind.STEADY_STATE: Status.STEADY_STATE,
    ErrorKind.HIDDEN_STATES: Status.MODES,
    ErrorKind.ANALYSIS: Status.MODES,
}
"""What an error of each kind makes of an item; of any other kind, an FMU failed."""


class ItemPreparation:
    """Prepares a scenario with the values of an operating point and an outage.

    Parameters
    ----------
    case
        The case.
    scenario
        Its name.
    layers
        Parameter files whose values hold at every point.
    step_size
        Communication step [s]; the case's where None.
    """

    def __init__(
        self, case: Case, scenario: str, layers: Sequence[ParameterFile], step_size: float | None = None
    ) -> None:
        self._case, self._scenario, self._layers, self._step_size = case, scenario, tuple(layers), step_size
        self.base = self._prepare({})
        self.elements = Elements.of(self.base)
        self._asked = {str(question) for question in self.base.questions}

    def cut_off(self, item: Item) -> str:
        """What an item cuts off from the slack bus, in words; "" where it cuts nothing off."""
        return cut_off(self._valued(item), self.elements, item.out)

    def prepared(self, item: Item) -> PreparedScenario:
        """The scenario at an item, without the units that are out of service.

        Raises
        ------
        CosimError
            If it cannot be prepared; `failure` says what that means.
        """
        found = self._prepare({**item.values, **switched_off(item.out, self.elements)})
        return without_units(found, item.out, self.elements)

    def warnings(self, prepared: PreparedScenario) -> tuple[str, ...]:
        """Questions that the scenario without the item's values does not raise."""
        return tuple(str(question) for question in prepared.questions if str(question) not in self._asked)

    def _prepare(self, values: Mapping[str, Value]) -> PreparedScenario:
        (prepared,) = self._case.prepare([self._scenario], dict(values), self._step_size, None, self._layers)
        return prepared

    def _valued(self, item: Item) -> PreparedScenario:
        """The base scenario with the item's own values in the grid, for what is said of islands."""
        grid = self.elements.grid
        plan = self.base.system.components[grid]
        own = {k.partition(".")[2]: v for k, v in item.values.items() if k.startswith(f"{grid}.") and "*" not in k}
        numbers = {name: value for name, value in own.items() if not isinstance(value, str)}
        system = System()
        system.components.update(self.base.system.components)
        system.connections.extend(self.base.system.connections)
        system.components[grid] = replace(plan, parameters=plan.parameters | numbers)
        return replace(self.base, system=system)


def failure(error: Exception) -> tuple[Status, str, bool]:
    """What an error at an item means: its status, the text, and whether the same would come out again."""
    found = Failure.of(error)
    if not isinstance(error, (CosimError, np.linalg.LinAlgError)):
        return Status.INTERNAL, unexpected(error), found.lasting
    return _STATUS.get(found.kind, Status.FMU), found.text, found.lasting


def unexpected(error: Exception) -> str:
    """An error that is no user's mistake, with its place in our code, in words."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if frame.filename.startswith(str(_PACKAGE))]
    at = f" at {Path(ours[-1].filename).relative_to(_PACKAGE)}, line {ours[-1].lineno}" if ours else ""
    blame = "" if isinstance(error, (MemoryError, OSError)) else "; gfor-cosim has failed here: please report it"
    return f"{type(error).__name__}{at}: {error}{blame}"
