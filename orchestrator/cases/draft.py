"""A scenario in preparation: the case's tables, the results of the steps so far, and the problems found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fmus.grid.network import Network
from orchestrator.cases.network_data import NetworkData
from orchestrator.cases.schema import CaseTable, ComponentTable, ScenarioTable, Value
from orchestrator.coupling.system import System
from orchestrator.errors import Problem

Locate = Callable[..., str]
COMMAND_LINE = "--set"


@dataclass(frozen=True)
class Layer:
    """Values by ``component.variable``, and where each is written."""

    values: Mapping[str, Value]
    place: Callable[[str], str]


@dataclass(frozen=True)
class UnitOrigin:
    """Where a component of the units table stands.

    Attributes
    ----------
    row
        The row of the units' file, or what else it comes from.
    own
        Parameters that this row has.
    common
        Key of ``[units]`` with the parameters of all of its kind.
    """

    row: str
    own: frozenset[str]
    common: str


@dataclass
class Draft:
    """What the steps of the preparation share.

    Attributes
    ----------
    place
        Key path → its text with the line of the file.
    layers
        Values from parameter files, the scenario and the command line; a later layer overrides an earlier one.
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
    places
        Where each ``component.variable`` that is set was set last.
    origins
        Where each component of the units table stands, by its name.
    questions
        What is most unusual about the data.
    """

    case: CaseTable
    name: str
    scenario: ScenarioTable
    directory: Path
    place: Locate
    layers: list[Layer] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    data: NetworkData | None = None
    network: Network | None = None
    known: set[str] = field(default_factory=set)
    tables: dict[str, ComponentTable] = field(default_factory=dict)
    system: System = field(default_factory=System)
    network_failed: bool = False
    places: dict[str, str] = field(default_factory=dict)
    origins: dict[str, UnitOrigin] = field(default_factory=dict)
    questions: list[Problem] = field(default_factory=list)

    def note(self, place: str, text: str) -> None:
        """Add a problem, once."""
        problem = Problem(place, text)
        if problem not in self.problems:
            self.problems.append(problem)

    def note_network(self, place: str, text: str) -> None:
        """Add a problem that leaves no network, so that what follows from its lack is not noted as well."""
        self.network_failed = True
        self.note(place, text)

    def place_of_value(self, name: str, group: str, path: Sequence[str]) -> str:
        """Where a value of a component's table is written: the table, or the row and the table of its unit."""
        origin = self.origins.get(name)
        if origin is None or group != "parameters":
            return self.place("components", name, group, *path)
        common = getattr(self.case.units, origin.common)
        if ".".join(path) not in origin.own and path[0] in common:
            return self.place("units", origin.common, *path)
        return f"{origin.row}, {name}.{'.'.join(path)}"

    @property
    def grid(self) -> str | None:
        """Name of the grid component."""
        return self.case.power_flow.grid if self.case.power_flow else None
