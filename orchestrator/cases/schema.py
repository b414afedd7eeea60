"""The form of a case file. What the file means is checked in `case`."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from orchestrator.toml_files import Table
from orchestrator.units import to_unit

Value = bool | float | str


def _in(unit: str) -> Callable[[Any], Any]:
    def convert(value: Any) -> Any:
        return to_unit(value, unit) if isinstance(value, str) else value

    return convert


Seconds = Annotated[float, BeforeValidator(_in("s")), Field(allow_inf_nan=False)]
PerUnit = Annotated[float, BeforeValidator(_in("pu"))]
Megawatt = Annotated[float, BeforeValidator(_in("MW"))]
Megavar = Annotated[float, BeforeValidator(_in("Mvar"))]
Hertz = Annotated[float, BeforeValidator(_in("Hz")), Field(allow_inf_nan=False)]
Radian = Annotated[float, BeforeValidator(_in("rad")), Field(allow_inf_nan=False)]


class SolverTable(Table):
    """Communication step, schedule and recording."""

    step_size: Seconds = Field(default=1e-4, gt=0, le=0.1)
    stop_time: Seconds = Field(default=20.0, gt=0)
    record_interval: Seconds = Field(default=0.005, gt=0)
    schedule: Literal["gauss-seidel", "jacobi"] = "gauss-seidel"
    groups: list[list[str]] | None = None
    record: list[str] = ["*"]


class ComponentTable(Table):
    """An FMU file, behind a binding or not, or a model of the catalogue, with its values."""

    model: str | None = None
    fmu: str | None = None
    binding: str | None = None
    isolated: bool | None = None
    bus: str | None = None
    native: bool = False
    parameters: dict[str, Any] = {}
    inputs: dict[str, Any] = {}


class PowerFlowTable(Table):
    """Which component is the grid, and which unit or bus balances it."""

    grid: str
    slack: str | None = None


class LineTable(Table):
    """A line or transformer of the network."""

    from_bus: str = Field(alias="from")
    to_bus: str = Field(alias="to")
    X: PerUnit
    R: PerUnit = 0.0
    B: PerUnit = 0.0
    tap: float = 1.0
    shift: Radian = 0.0


class LoadTable(Table):
    """A load of the network."""

    bus: str
    p: Megawatt
    q: Megavar = 0.0
    active: Literal["impedance", "current"] = "impedance"


class ShuntTable(Table):
    """An admittance to earth: what it draws and generates at 1 pu."""

    bus: str
    g: Megawatt = 0.0
    b: Megavar = 0.0


class NetworkTable(Table):
    """A network for the model ``grid``: another program's, or written out, or both together."""

    matpower: str | None = None
    pandapower: str | None = None
    frequency: Hertz | None = Field(default=None, gt=0)
    stray_B: PerUnit = 0.0

    buses: list[str] = []
    lines_file: str | None = None
    loads_file: str | None = None
    lines: dict[str, LineTable] = {}
    loads: dict[str, LoadTable] = {}
    shunts: dict[str, ShuntTable] = {}


class UnitsTable(Table):
    """Many units, each a generator and a converter that share its rating and power.

    They come from a file; without one, every generator bus of the network's source is a unit.
    """

    file: str | None = None
    alpha: float = Field(default=0.0, ge=0, le=1)
    generator: str
    converter: str
    generator_parameters: dict[str, Any] = {}
    converter_parameters: dict[str, Any] = {}


class ConnectionTable(Table):
    """A connection from an output to an input."""

    source: str = Field(alias="from")
    target: str = Field(alias="to")


class EventBase(Table):
    """What all events have: a time."""

    time: Seconds = Field(ge=0)


class GridEventBase(EventBase):
    """Something in the network; ``component`` is the grid of ``[power_flow]`` where it is left out."""

    component: str | None = None


class LoadChangeTable(GridEventBase):
    """A load changes to a multiple of its power."""

    type: Literal["load_change"]
    load: str
    scale: float = Field(gt=0)


class LoadTripTable(GridEventBase):
    """A load is disconnected."""

    type: Literal["load_trip"]
    load: str


class LoadReconnectionTable(GridEventBase):
    """A load is connected again."""

    type: Literal["load_reconnection"]
    load: str
    scale: float = Field(default=1.0, gt=0)


class LineTripTable(GridEventBase):
    """A line opens, and may close again."""

    type: Literal["line_trip"]
    line: str
    reclose_after: Seconds | None = Field(default=None, gt=0)


class LineReclosingTable(GridEventBase):
    """A line closes again."""

    type: Literal["line_reclosing"]
    line: str


class UnitTripTable(GridEventBase):
    """A unit is disconnected."""

    type: Literal["unit_trip"]
    unit: str


class UnitReconnectionTable(GridEventBase):
    """A unit is connected again."""

    type: Literal["unit_reconnection"]
    unit: str


class BranchChangeTable(GridEventBase):
    """A line gets another impedance."""

    type: Literal["branch_change"]
    line: str
    X: PerUnit
    R: PerUnit | None = None


class ReferenceChangeTable(EventBase):
    """A reference of a component steps."""

    type: Literal["reference_change"]
    component: str
    reference: str
    delta: PerUnit


class ParameterChangeTable(EventBase):
    """A parameter of a component changes."""

    type: Literal["parameter_change"]
    component: str
    parameter: str
    value: Value


EventTable = Annotated[
    LoadChangeTable
    | LoadTripTable
    | LoadReconnectionTable
    | LineTripTable
    | LineReclosingTable
    | UnitTripTable
    | UnitReconnectionTable
    | BranchChangeTable
    | ReferenceChangeTable
    | ParameterChangeTable,
    Field(discriminator="type"),
]


class ScenarioTable(Table):
    """What differs from the case."""

    title: str = ""
    remove: list[str] = []
    parameters: list[str] = []
    set: dict[str, Value] = {}
    events: list[EventTable] | None = None


class RingDownTable(Table):
    """A recorded signal in which modes are identified."""

    signal: str
    start: Seconds


class NamedModeTable(Table):
    """A mode told by its shape: where some states take part most, or where two groups swing against each other."""

    name: str
    states: list[str] = []
    against: tuple[list[str], list[str]] | None = None


class AnalysisTable(Table):
    """Which modes are looked for by name, who swings in them, and where the first one's ring-down is read."""

    modes: list[NamedModeTable] = []
    swing: list[str] = ["*.machine.omega"]
    areas: dict[str, list[str]] = {}
    ring_down: RingDownTable | None = None


class ReferenceModeTable(Table):
    """A published mode to compare with."""

    real: float | None = None
    imag: float | None = None
    frequency_hz: float
    damping_percent: float


class ReferenceTable(Table):
    """Figures of somebody else, shown beside ours where their conditions hold."""

    title: str
    source: str
    when: dict[str, Value] = {}
    modes: dict[str, dict[str, ReferenceModeTable]]


class PanelTable(Table):
    """One axis of a plot."""

    signal: str
    label: str
    scale: float = 1.0


class PlotTable(Table):
    """A plot of recorded signals."""

    name: str
    title: str
    panels: list[PanelTable]


class CaseTable(Table):
    """A whole case file; ``meant`` names values ``component.variable`` that are unusual and meant so."""

    name: str
    title: str = ""
    source: str = ""
    meant: list[str] = []
    solver: SolverTable = SolverTable()
    components: dict[str, ComponentTable] = Field(min_length=1)
    network: NetworkTable | None = None
    units: UnitsTable | None = None
    power_flow: PowerFlowTable | None = None
    connections: list[ConnectionTable] = []
    events: list[EventTable] = []
    scenarios: dict[str, ScenarioTable] = {}
    analysis: AnalysisTable = AnalysisTable()
    reference: ReferenceTable | None = None
    plots: list[PlotTable] = []
