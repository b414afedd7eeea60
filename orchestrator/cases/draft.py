"""A scenario on its way to be ready: the case's tables, what has been made of them, and what is wrong."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fmus.grid.network import Network
from orchestrator.cases.network_data import NetworkData
from orchestrator.cases.schema import CaseTable, ComponentTable, ScenarioTable, Value
from orchestrator.coupling.system import System
from orchestrator.errors import Problem

Place = Callable[..., str]
COMMAND_LINE = "--set"


@dataclass(frozen=True)
class Layer:
    """Values by ``component.variable``, and where each is written."""

    values: Mapping[str, Value]
    place: Callable[[str], str]


@dataclass
class Draft:
    """What the steps of the preparation share.

    Attributes
    ----------
    place
        Key path → its text with the line of the file.
    layers
        Values from parameter files, the scenario and the command line; a later layer goes before an earlier one.
    problems
        All that is wrong so far.
    data
        Elements of the network and what its source says of units; None where the case has no network of its own.
    network
        The network behind the grid component.
    known, tables
        Names of all components there can be, and the tables of those that this scenario has.
    system
        Components and connections.
    """

    case: CaseTable
    name: str
    scenario: ScenarioTable
    directory: Path
    place: Place
    layers: list[Layer] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    data: NetworkData | None = None
    network: Network | None = None
    known: set[str] = field(default_factory=set)
    tables: dict[str, ComponentTable] = field(default_factory=dict)
    system: System = field(default_factory=System)
    network_failed: bool = False

    def note(self, place: str, text: str) -> None:
        """Add a problem, once."""
        problem = Problem(place, text)
        if problem not in self.problems:
            self.problems.append(problem)

    def note_network(self, place: str, text: str) -> None:
        """Add a problem that leaves no network, so that what follows from its lack is not noted as well."""
        self.network_failed = True
        self.note(place, text)

    @property
    def grid(self) -> str | None:
        """Name of the grid component."""
        return self.case.power_flow.grid if self.case.power_flow else None
