"""A scenario in preparation: the case's tables, the results of the steps so far, and the problems found."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fmus.grid.network import Network
from orchestrator.cases.flow.sharing import Dispatch
from orchestrator.cases.flow.solved_fault import SolvedFault
from orchestrator.cases.form.build_choices import Layer
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import CaseTable, ComponentTable, EventTable, ScenarioTable
from orchestrator.cases.networks.data import NetworkData
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.psse.dc_line_models import ModelledLine
from orchestrator.cases.networks.psse.load_relay_records import LoadRelay
from orchestrator.cases.networks.psse.plant_controllers import PlantController, UnitOfPlant
from orchestrator.cases.networks.psse.relay_records import UnitRelay
from orchestrator.cases.networks.record_use import RecordUse
from orchestrator.core.errors import (
    MOST_PROBLEMS,
    TOO_MANY,
    CaseError,
    ErrorKind,
    InputError,
    Problem,
)
from orchestrator.core.options import Option
from orchestrator.systems.coupling.system import System

Locate = Callable[..., str]
COMMAND_LINE = Option.SET


@dataclass(frozen=True)
class UnitOrigin:
    row: str  # place of the row in the units' file, or the name of another source
    own: frozenset[str]  # parameters that the row itself gives
    common: str  # key of ``[units]`` with the common parameters of this kind of unit
    # lines of the row's file by the parameter that they give, where there are several.
    lines: Mapping[str, int] = field(default_factory=dict)
    # likely rating [MVA] if S_n is only the base of the unit's data; otherwise None
    rating_mva: float | None = None


@dataclass
class DraftInput:
    source: str  # the case file, as errors name it
    case: CaseTable
    name: str
    scenario: ScenarioTable
    directory: Path
    place: Locate  # key path → its text with the line of the file
    # the parameter files that scenarios name, as the case was loaded with them; text says why one cannot be read.
    parameter_files: Mapping[str, ParameterFile | str] = field(default_factory=dict)
    # whether the case is the user's own file; an SSP is one scenario of a case, and may name components of others.
    whole: bool = True
    injections: bool = False  # as in `CaseDefinition`
    faulted: frozenset[str] = frozenset()  # as in `CaseDefinition`
    line_ends: frozenset[str] = frozenset()  # as in `CaseDefinition`
    # components whose device is another than the file's own, which no layer's value reaches.
    exchanged: frozenset[str] = frozenset()
    # variables, by ``component.variable``, that the command line or its parameter files set.
    from_outside: frozenset[str] = frozenset()
    varied: frozenset[str] = frozenset()  # as in `CaseDefinition`
    # values and choices from parameter files, the scenario and the command line; a later layer overrides an earlier
    # one.
    layers: list[Layer] = field(default_factory=list)

    @property
    def events(self) -> Sequence[EventTable]:
        return self.case.events if self.scenario.events is None else self.scenario.events


@dataclass
class Findings:
    problems: list[Problem] = field(default_factory=list)
    questions: list[Problem] = field(default_factory=list)
    # what became of the records of the network's files
    records: list[RecordUse] = field(default_factory=list)
    # what is asked about values, by ``component.variable``, of the digits that the files have, in another unit.
    thousandfold: dict[str, str] = field(default_factory=dict)
    # S_n of components before one from outside [MVA]
    ratings: dict[str, float] = field(default_factory=dict)
    # components of other scenarios to which a layer gives values, by ``component.variable``, with the place.
    absent: dict[str, str] = field(default_factory=dict)
    # limits that the case widens, by ``component.variable``: the value of the files [pu], and where it is widened.
    widened: dict[str, tuple[float, str]] = field(default_factory=dict)
    faults: list[SolvedFault] = field(default_factory=list)  # of fewer phases, and open poles
    not_reached: list[float] = field(default_factory=list)
    # components whose form the network cannot take, each with its model; what follows from that is not noted.
    misfits: dict[str, str] = field(default_factory=dict)
    # inputs, by ``component.variable``, whose connection or value was refused: that nothing feeds them follows.
    refused_inputs: set[str] = field(default_factory=set)
    network_failed: bool = False
    # variables of units of a kind that none of them has
    missed: set[tuple[str, str]] = field(default_factory=set)


@dataclass
class Draft:
    """A scenario in preparation: what it is made from, what was found, and what is made so far."""

    given: DraftInput
    found: Findings = field(default_factory=Findings)
    # elements of the network, and the source's data of units; None if the case has no network of its own.
    data: NetworkData | None = None
    network: Network | None = None  # the network behind the grid component
    # known, tables: names of all possible components, and the tables of the components in this scenario.
    known: set[str] = field(default_factory=set)
    tables: dict[str, ComponentTable] = field(default_factory=dict)
    system: System = field(default_factory=System)
    # place of the last assignment of each ``component.variable``
    places: dict[str, str] = field(default_factory=dict)
    origins: dict[str, UnitOrigin] = field(default_factory=dict)
    # least and most reactive power of the units at a bus together [Mvar], by bus.
    reactive_limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    # least and most active power of a unit in sharing [MW], by component.
    active_limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    # where units measure that do not at their own terminal
    measured: dict[str, MeasuredPoint] = field(default_factory=dict)
    # controllers of several units, and these units, by component
    plant_controllers: Sequence[PlantController] = ()
    units_of_plants: Mapping[str, UnitOfPlant] = field(default_factory=dict)
    # DC lines with models of their own
    dc_lines: Sequence[ModelledLine] = ()
    # relays of the labels of units, and of loads, by the records of dynamics data
    unit_relays: Sequence[tuple[str, UnitRelay]] = ()
    load_relays: Sequence[LoadRelay] = ()
    # labels of the units that are wind turbines, by a record of dynamics data that may be left out
    wind_turbines: Collection[str] = frozenset()
    # what the units fed before an outage that they share; None without one
    dispatch: Dispatch | None = None
    # voltages before an outage [pu], at which loads that follow the voltage draw what is set
    voltages_before: Mapping[str, complex] = field(default_factory=dict)
    # loads that do not, as their power is given
    loads_as_given: frozenset[str] = frozenset()

    @property
    def reacts(self) -> bool:
        """Return whether there are loads or controls that follow the voltage in an outage's power flow."""
        return self.data is not None and bool(self.data.flow_laws or self.data.controls)

    def note(self, place: str, text: str, kind: ErrorKind = ErrorKind.VALUES) -> None:
        self._add(Problem(place, text, kind))

    def note_of_scenario(self, place: str, cause: str, kind: ErrorKind = ErrorKind.VALUES) -> None:
        """Add a problem that others of the case's scenarios may not have."""
        self._add(Problem.of_scenario(place, self.given.name, cause, kind))

    def note_unread(self, place: str, error: InputError) -> None:
        """Add the problem of a network's file, whose error may name the record; without it there is no network."""
        self.found.network_failed = True
        self._add(Problem(place, error.message, record=error.place))

    def _add(self, problem: Problem) -> None:
        if problem not in self.found.problems:
            self.found.problems.append(problem)
            if len(self.found.problems) > MOST_PROBLEMS:
                raise CaseError(self.given.source, [*self.found.problems[:MOST_PROBLEMS], TOO_MANY])

    def note_network(self, place: str, text: str) -> None:
        """Add a problem that leaves no network. Problems that follow from the missing network are then not noted."""
        self.found.network_failed = True
        self.note(place, text)

    def is_repeated(self, name: str, variable: str) -> bool:
        """Return whether this variable was missed already at a unit of the same kind: all of them have it, or none."""
        origin = self.origins.get(name)
        if origin is None:
            return False
        missed = (origin.common, variable)
        repeated = missed in self.found.missed
        self.found.missed.add(missed)
        return repeated

    def place_of_component(self, name: str) -> str:
        origin = self.origins.get(name)
        return self.given.place("components", name) if origin is None else origin.row

    def place_of_value(self, name: str, group: str, path: Sequence[str]) -> str:
        """Place of a value of a component's table: the table, or the row and the table of its unit."""
        origin = self.origins.get(name)
        if origin is None or group != "parameters":
            return self.given.place("components", name, group, *path)
        common = getattr(self.given.case.units, origin.common)
        if ".".join(path) not in origin.own and path[0] in common:
            return self.given.place("units", origin.common, *path)
        line = origin.lines.get(".".join(path))
        return f"{origin.row}{'' if line is None else f', line {line}'}, {name}.{'.'.join(path)}"

    @property
    def base_ratings(self) -> dict[str, float]:
        """Likely ratings [MVA] of the units whose S_n is only the base of their data."""
        found = {
            name: self.origins[name].rating_mva for name in self.tables if name in self.origins
        }
        return {name: rating for name, rating in found.items() if rating is not None}

    @property
    def grid(self) -> str | None:
        return self.given.case.power_flow.grid if self.given.case.power_flow else None
