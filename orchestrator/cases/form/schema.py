"""The form of a case file. `case` checks the meaning of the file."""

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    FiniteFloat,
    PrivateAttr,
    model_validator,
)

from orchestrator.cases.form.names import file_name
from orchestrator.core.foreign_files import one_line
from orchestrator.core.toml_files import Table
from orchestrator.core.units import to_unit
from orchestrator.systems.coupling.events import FaultKind, ForcingShape
from orchestrator.systems.coupling.no_trip_regions import NoTripCode
from orchestrator.systems.coupling.schedule import TOLERANCES, ScheduleName

Value = bool | float | str


def _no_truth_value(value: Any) -> Any:
    """Refuse true and false where a number is meant: read as 1 and 0, they would run as something else."""
    if isinstance(value, bool):
        raise ValueError("this is a truth value; give a number")
    return value


def _in(unit: str) -> Callable[[Any], Any]:
    def convert(value: Any) -> Any:
        return to_unit(value, unit) if isinstance(value, str) else _no_truth_value(value)

    return convert


def _share(value: Any) -> Any:
    """``"2 %"`` as 0.02; else per unit."""
    if isinstance(value, str) and value.rstrip().endswith("%"):
        return to_unit(value.rstrip().removesuffix("%"), "pu") / 100
    return _in("pu")(value)


Number = Annotated[float, BeforeValidator(_no_truth_value)]

Seconds = Annotated[float, BeforeValidator(_in("s")), Field(allow_inf_nan=False)]
PerUnit = Annotated[float, BeforeValidator(_in("pu"))]
Megawatt = Annotated[float, BeforeValidator(_in("MW"))]
Megavar = Annotated[float, BeforeValidator(_in("Mvar"))]
Kilovolt = Annotated[float, BeforeValidator(_in("kV"))]
Hertz = Annotated[float, BeforeValidator(_in("Hz")), Field(allow_inf_nan=False)]
Bus = Annotated[str, BeforeValidator(lambda name: str(name) if type(name) is int else name)]
"""A number is no bus' name here, but the error that there is none such names the near ones."""
FileName = Annotated[str, AfterValidator(file_name)]
Title = Annotated[str, AfterValidator(one_line)]
"""Titles and labels stand in one line; a file cannot hold other control characters."""
Radian = Annotated[float, BeforeValidator(_in("rad")), Field(allow_inf_nan=False)]

LONGEST_STEP = 0.1  # between two communication points [s]


class SolverTable(Table):
    step_size: Seconds = Field(default=1e-4, gt=0, le=LONGEST_STEP)
    stop_time: Seconds = Field(default=20.0, gt=0)
    record_interval: Seconds = Field(default=0.005, gt=0)
    schedule: ScheduleName = "gauss-seidel"
    micro_step: Seconds | None = Field(default=None, gt=0, le=LONGEST_STEP)
    tolerance: Number | None = Field(default=None, ge=TOLERANCES[0], le=TOLERANCES[1])
    groups: list[list[str]] | None = None
    record: list[str] = ["*"]
    record_filter: Literal["none", "low-pass"] = "none"


class ComponentTable(Table):
    """An FMU file or a vendor's DLL, behind a binding or not, a model of the catalogue, or a scan and the rated voltage
    at its bus, with values; ``vendor`` is whose make it is."""

    model: str | None = None
    fmu: str | None = None
    dll: str | None = None
    scan: str | None = None
    voltage: Kilovolt | None = Field(default=None, gt=0, allow_inf_nan=False)
    binding: str | None = None
    isolated: bool | None = None
    vendor: str | None = Field(default=None, min_length=1)
    bus: Bus | None = None
    native: bool = False
    machine: str | None = None
    exciter: str | None = None
    governor: str | None = None
    stabilizer: str | None = None
    oel: str | None = None
    uel: str | None = None
    records: str | None = None
    parameters: dict[str, Any] = {}
    inputs: dict[str, Any] = {}

    @property
    def file(self) -> str | None:
        """Path of what is not of the catalogue; None for a model."""
        return self.fmu if self.fmu is not None else self.dll


class PowerFlowTable(Table):
    """Which component is the grid, which unit or bus balances it, whether limits of reactive power are kept (None names
    those that are exceeded), and how units share what an outage takes away."""

    grid: str
    slack: Bus | None = None
    reactive_limits: Annotated[bool | None, Field(strict=True)] = None
    sharing: Literal["droop", "rating", "slack"] = "droop"


class LineTable(Table):
    from_bus: Bus = Field(alias="from")
    to_bus: Bus = Field(alias="to")
    X: PerUnit
    R: PerUnit = 0.0
    B: PerUnit = 0.0
    tap: Number = 1.0
    shift: Radian = 0.0
    X_C: PerUnit = 0.0


class ThreeWindingTable(Table):
    """A three-winding transformer, by its short-circuit impedances between two windings each."""

    buses: tuple[str, str, str]
    X_12: PerUnit
    X_13: PerUnit
    X_23: PerUnit
    R_12: PerUnit = 0.0
    R_13: PerUnit = 0.0
    R_23: PerUnit = 0.0
    tap: tuple[Number, Number, Number] = (1.0, 1.0, 1.0)
    shift: tuple[Radian, Radian, Radian] = (0.0, 0.0, 0.0)


class ZipTable(Table):
    """Shares of constant impedance, current and power; they sum to 1."""

    z: Number = 0.0
    i: Number = 0.0
    p: Number = 0.0


LoadLaw = Literal["impedance", "current", "power"] | ZipTable


class LoadModelTable(Table):
    active: LoadLaw | None = None
    reactive: LoadLaw | None = None
    k_pf: Number | None = Field(default=None, allow_inf_nan=False)
    k_qf: Number | None = Field(default=None, allow_inf_nan=False)
    v_min: PerUnit | None = None
    tau: Seconds | None = Field(default=None, gt=0)


class LoadTable(LoadModelTable):
    """A load of the network; p < 0 is static generation."""

    bus: Bus
    p: Megawatt
    q: Megavar = 0.0


class ShuntTable(Table):
    """An admittance to earth, by the power that it draws and generates at 1 pu."""

    bus: Bus
    g: Megawatt = 0.0
    b: Megavar = 0.0


VectorGroup = Annotated[str, Field(pattern=r"(?i)^(yn|y|d)(yn|y|d)\d{0,2}((yn|y|d)\d{0,2})?$")]
"""``YNd5``, the winding at the from bus first; of three windings ``YNynd``."""


class SequencesTable(Table):
    """The negative and the zero sequence, where no file has them."""

    line_z0: Number | None = Field(default=None, gt=0, allow_inf_nan=False)
    line_b0: Number | None = Field(default=None, ge=0, allow_inf_nan=False)
    transformer_x0: Number | None = Field(default=None, gt=0, allow_inf_nan=False)
    transformers: VectorGroup | None = None
    step_up: VectorGroup | None = None
    groups: dict[str, VectorGroup] = {}
    machine_x2: Number | None = Field(default=None, gt=0, allow_inf_nan=False)
    machine_x0: Number | None = Field(default=None, gt=0, allow_inf_nan=False)
    converter_x2: Number | None = Field(default=None, gt=0, allow_inf_nan=False)
    external_z0: Number | None = Field(default=None, gt=0, allow_inf_nan=False)


class NetworkTable(Table):
    """A network for the model ``grid``: another program's, or written out, or both together."""

    matpower: str | None = None
    pandapower: str | None = None
    raw: str | None = None
    cgmes: str | None = None
    seq: str | None = None
    leave_out: list[str] = []
    keep_load_parts: Annotated[bool, Field(strict=True)] = False
    move_controls: Annotated[bool, Field(strict=True)] = False
    frequency: Hertz | None = Field(default=None, gt=0)
    stray_B: PerUnit = 0.0

    buses: list[str] = []
    lines_file: str | None = None
    loads_file: str | None = None
    lines: dict[str, LineTable] = {}
    three_winding_transformers: dict[str, ThreeWindingTable] = {}
    loads: dict[str, LoadTable] = {}
    load_model: LoadModelTable = LoadModelTable()
    generation_model: LoadModelTable = LoadModelTable()
    device_model: LoadModelTable = LoadModelTable()
    shunts: dict[str, ShuntTable] = {}
    sequences: SequencesTable = SequencesTable()


class UnitsTable(Table):
    """Many units, each a generator and a converter that share its rating and power.

    They come from a file; without one, every generator bus of the network's source is a unit."""

    file: str | None = None
    dyr: str | None = None
    dyr_leave_out: list[str] = []
    dyr_approximate: Annotated[bool, Field(strict=True)] = False
    replace: list[str] = []
    alpha: Number = Field(default=0.0, ge=0, le=1)
    generator: str
    converter: str
    machine: str | None = None
    exciter: str | None = None
    governor: str | None = None
    stabilizer: str | None = None
    oel: str | None = None
    uel: str | None = None
    generator_parameters: dict[str, Any] = {}
    converter_parameters: dict[str, Any] = {}
    widened_limits: dict[str, Any] = {}


class ConnectionTable(Table):
    source: str = Field(alias="from")
    target: str = Field(alias="to")
    ignore_units: bool = False  # whether the value is taken as it is, in whatever unit
    # factor and offset that convert the value on its way, as the reader of an SSP finds them
    converted: tuple[float, float] | None = None


class WireTable(Table):
    """An imperfection of connections: ``a.out -> b.in``, or a pattern with ``*`` at either end."""

    connection: str


class BiasTable(WireTable):
    type: Literal["bias"]
    value: Value


class NoiseTable(WireTable):
    type: Literal["noise"]
    deviation: Value
    seed: Annotated[int, BeforeValidator(_no_truth_value)] = Field(ge=0)
    bandwidth: Hertz | None = Field(default=None, gt=0)


class FreezeTable(WireTable):
    """The last value that arrived is held."""

    type: Literal["freeze"]


class DropOutTable(WireTable):
    """The value is lost; the last one is held, or another takes its place."""

    type: Literal["drop_out"]
    substitute: Value = "hold"


class DelayTable(WireTable):
    type: Literal["delay"]
    delay: Seconds = Field(ge=0)


class QuantisationTable(WireTable):
    """Only multiples of a step are carried."""

    type: Literal["quantisation"]
    step: Value


ImperfectionTable = Annotated[
    BiasTable | NoiseTable | FreezeTable | DropOutTable | DelayTable | QuantisationTable,
    Field(discriminator="type"),
]


class EventBase(Table):
    """``place``: the option that asked for it, if no file did."""

    time: Seconds = Field(ge=0)
    _place: str = PrivateAttr(default="")

    @property
    def place(self) -> str:
        return self._place

    def asked_as(self, option: str) -> Self:
        self._place = option
        return self


class PassingBase(EventBase):
    """An event that may end again; it lasts to the end of the run where there is no ``end``."""

    end: Seconds | None = None


class BiasEventTable(PassingBase, BiasTable):
    """A value is added to the signal for a while."""


class NoiseEventTable(PassingBase, NoiseTable):
    """Noise is added to the signal for a while."""


class FreezeEventTable(PassingBase, FreezeTable):
    """The last value that arrived is held for a while."""


class DropOutEventTable(PassingBase, DropOutTable):
    """The value is lost for a while."""


class DelayEventTable(PassingBase, DelayTable):
    """The value arrives later for a while."""


class QuantisationEventTable(PassingBase, QuantisationTable):
    """Only multiples of a step are carried for a while."""


class ComponentTripTable(EventBase):
    """A component is taken from the system: by its breaker, else by what it gives becoming 0."""

    type: Literal["component_trip"]
    component: str


class NanOutputTable(EventBase):
    """A component's outputs are no numbers any more."""

    type: Literal["nan_output"]
    component: str


class TimeOutTable(EventBase):
    type: Literal["time_out"]
    component: str


class GridEventBase(EventBase):
    """Common part of events in the network; by default ``component`` is the grid of ``[power_flow]``."""

    component: str | None = None


class LoadChangeTable(GridEventBase):
    """A load changes to a multiple of its power."""

    type: Literal["load_change"]
    load: str
    scale: Number = Field(gt=0)


class LoadTripTable(GridEventBase):
    type: Literal["load_trip"]
    load: str


class LoadReconnectionTable(GridEventBase):
    type: Literal["load_reconnection"]
    load: str
    scale: Number = Field(default=1.0, gt=0)


class ShuntTripTable(GridEventBase):
    type: Literal["shunt_trip"]
    shunt: str


class ShuntReconnectionTable(GridEventBase):
    type: Literal["shunt_reconnection"]
    shunt: str


class LineTripTable(GridEventBase):
    """A line opens, at both ends or at one of its buses alone, and may close again."""

    type: Literal["line_trip"]
    line: str
    at: Bus | None = None
    reclose_after: Seconds | None = Field(default=None, gt=0)

    @property
    def end_bus(self) -> str | None:
        """Return the bus at which alone the line opens; None if it opens at both."""
        return self.at


class LineReclosingTable(GridEventBase):
    type: Literal["line_reclosing"]
    line: str


class FaultBase(GridEventBase):
    """Common part of faults: how many phases, the impedance, how long, and how the line that opens at the end does:
    at one of its buses alone, and for how long."""

    kind: FaultKind = "3-phase"
    R: PerUnit = Field(default=0.0, ge=0, allow_inf_nan=False)
    X: PerUnit = Field(default=0.0, ge=0, allow_inf_nan=False)
    duration: Seconds | None = Field(default=None, gt=0)
    opens_at: Bus | None = None
    reclose_after: Seconds | None = Field(default=None, gt=0)
    _bare: bool = PrivateAttr(default=False)

    @model_validator(mode="wrap")
    @classmethod
    def _noting_units(cls, given: Any, handler: Callable[[Any], Self]) -> Self:
        found = handler(given)
        found._bare = isinstance(given, dict) and not isinstance(given.get("duration"), str)
        return found

    @property
    def has_bare_duration(self) -> bool:
        """Return whether the duration is a number without a unit."""
        return self.duration is not None and self._bare

    @property
    def lasts(self) -> float | None:
        """Return how long the fault is there [s]; None if it stays."""
        return self.duration

    @property
    def end_bus(self) -> str | None:
        """Return the bus at which alone the line opens; None if it opens at both, or stays."""
        return self.opens_at


class BusFaultTable(FaultBase):
    """A fault at a bus; where a line clears it, that line opens when the fault ends, or its end at one bus alone."""

    type: Literal["bus_fault"]
    bus: Bus
    cleared_by: str | None = None

    @model_validator(mode="after")
    def _has_an_end_to_clear(self) -> Self:
        if self.reclose_after is not None and self.cleared_by is None:
            raise ValueError(
                "'reclose_after' needs 'cleared_by': the line that opens, and closes again"
            )
        if self.opens_at is not None and self.cleared_by is None:
            raise ValueError("'opens_at' needs 'cleared_by': the line that opens at this bus alone")
        if self.cleared_by is not None and self.duration is None:
            raise ValueError(
                "'cleared_by' needs 'duration': the time from the fault to the opening of the line"
            )
        return self


class LineFaultTable(FaultBase):
    """A fault along a line, at a part of the way from its from bus; the line may open as the fault ends, with all
    three phases or the faulted one, at both ends or at one of its buses alone, and close again.

    Where its other end opens later, the fault lasts until then."""

    type: Literal["line_fault"]
    line: str
    at: Annotated[float, BeforeValidator(_share), Field(gt=0, lt=1)]
    opens: Literal["no", "line", "pole"] = "no"
    # from the fault's begin to the opening of the end that is not at ``opens_at``
    other_end_after: Seconds | None = Field(default=None, gt=0)

    @property
    def lasts(self) -> float | None:
        """Return how long the fault is there [s]; None if it stays."""
        return self.other_end_after or self.duration

    @model_validator(mode="after")
    def _is_one_story(self) -> Self:
        if self.opens != "no" and self.duration is None:
            raise ValueError(
                "'opens' needs 'duration': the time from the fault to the opening of the line"
            )
        if self.reclose_after is not None and self.opens == "no":
            raise ValueError("'reclose_after' needs 'opens': what has not opened cannot close")
        if self.opens_at is not None and self.opens == "no":
            raise ValueError(
                "'opens_at' needs 'opens': 'line' or 'pole', which opens at this bus alone"
            )
        if self.other_end_after is not None:
            if self.opens != "line" or self.opens_at is None:
                raise ValueError(
                    "'other_end_after' needs opens = 'line' and 'opens_at': the bus whose end opens first"
                )
            if self.duration is not None and self.other_end_after <= self.duration:
                raise ValueError(
                    f"other_end_after = {self.other_end_after:g} s is not after the first end, which opens at "
                    f"{self.duration:g} s; both count from the fault's begin"
                )
        if self.opens == "pole" and (self.kind != "1-phase" or self.reclose_after is None):
            raise ValueError(
                "opens = 'pole' is for a fault of kind '1-phase', and needs 'reclose_after': the dead time"
            )
        return self


class UnitTripTable(GridEventBase):
    type: Literal["unit_trip"]
    unit: str


class UnitReconnectionTable(GridEventBase):
    type: Literal["unit_reconnection"]
    unit: str


class BranchChangeTable(GridEventBase):
    type: Literal["branch_change"]
    line: str
    X: PerUnit
    R: PerUnit | None = None


class ReferenceChangeTable(EventBase):
    type: Literal["reference_change"]
    component: str
    reference: str
    delta: PerUnit


class ParameterChangeTable(EventBase):
    type: Literal["parameter_change"]
    component: str
    parameter: str
    value: Value


class ForcingTable(EventBase):
    """A reference swings: by a share of its base, or in per unit; without a reference it is the unit's power."""

    type: Literal["forcing"]
    component: str
    reference: str | None = None
    frequency: Hertz = Field(gt=0)
    amplitude: Annotated[float, BeforeValidator(_share), Field(gt=0, allow_inf_nan=False)]
    shape: ForcingShape = "sine"
    end: Seconds | None = None


UnitSwitchingTable = UnitTripTable | UnitReconnectionTable

SettingEventTable = (
    LoadChangeTable
    | LoadTripTable
    | LoadReconnectionTable
    | LineTripTable
    | LineReclosingTable
    | UnitSwitchingTable
    | BranchChangeTable
    | BusFaultTable
    | LineFaultTable
    | ShuntTripTable
    | ShuntReconnectionTable
    | ReferenceChangeTable
    | ParameterChangeTable
)
"""Events that set variables."""

WireEventTable = (
    BiasEventTable
    | NoiseEventTable
    | FreezeEventTable
    | DropOutEventTable
    | DelayEventTable
    | QuantisationEventTable
)
"""Faults of connections."""

# faults of whole components
ComponentFaultTable = ComponentTripTable | NanOutputTable | TimeOutTable

EventTable = Annotated[
    SettingEventTable | WireEventTable | ComponentFaultTable | ForcingTable,
    Field(discriminator="type"),
]


class ScenarioTable(Table):
    """A scenario: its differences from the case; ``beside`` is the one that its damping is compared with."""

    title: Title = ""
    beside: str | None = None
    remove: list[str] = []
    parameters: list[str] = []
    set: dict[str, Value] = {}
    imperfections: dict[str, ImperfectionTable] = {}
    events: list[EventTable] | None = None


class RingDownTable(Table):
    """A recorded signal in which modes are identified."""

    signal: str
    start: Seconds


class NamedModeTable(Table):
    """A mode that is recognised by its shape: some states take part most, or two groups swing against each other."""

    name: str
    states: list[str] = []
    against: tuple[list[str], list[str]] | None = None


class AnalysisTable(Table):
    """The modes to find by name, the states that swing in them, and the signal with the first mode's ring-down."""

    modes: list[NamedModeTable] = []
    swing: list[str] = ["*.machine.omega"]
    areas: dict[str, list[str]] = {}
    ring_down: RingDownTable | None = None


class ReferenceModeTable(Table):
    real: Number | None = None
    imag: Number | None = None
    frequency_hz: Number
    damping_percent: Number


class ReferenceTable(Table):
    """Published figures, shown beside ours if their conditions hold."""

    title: Title
    source: Title
    when: dict[str, Value] = {}
    modes: dict[str, dict[str, ReferenceModeTable]]


class PanelTable(Table):
    """One axis of a plot; ``also`` are further signals on the same axis."""

    signal: str
    also: list[str] = []
    label: Title
    scale: Number = 1.0


class PlotTable(Table):
    name: FileName
    title: Title
    panels: list[PanelTable]


class KindTable(Table):
    """Values that one kind of models takes in place of the case's own values."""

    step_size: Seconds | None = Field(default=None, gt=0, le=LONGEST_STEP)
    stray_B: PerUnit | None = None


class ConventionsTable(Table):
    """Assumptions about machines, all of a program's or each alone; `conventions` knows who makes which."""

    like: Literal["exact", "psse", "powerfactory", "andes"] = "exact"
    speed_in_emf: Annotated[bool, Field(strict=True)] | None = None
    governor_gives: Literal["power", "torque"] | None = None


class DiagramTable(Table):
    """The network as ``gfor explore`` draws it: places of buses, to the right and downwards, about 900 by 600."""

    positions: dict[str, tuple[FiniteFloat, FiniteFloat]] = {}


class CaseTable(Table):
    """A whole case file; ``meant`` names values ``component.variable`` that are unusual on purpose, ``directory`` is
    what paths are relative to, the file's own folder where None."""

    name: FileName
    title: Title = ""
    source: Title = ""
    directory: str | None = None
    meant: list[str] = []
    models: Literal["emt", "phasor"] | None = None
    protection: NoTripCode | None = None
    emt: KindTable = KindTable()
    phasor: KindTable = KindTable()
    solver: SolverTable = SolverTable()
    components: dict[str, ComponentTable] = Field(min_length=1)
    network: NetworkTable | None = None
    units: UnitsTable | None = None
    conventions: ConventionsTable | None = None
    power_flow: PowerFlowTable | None = None
    connections: list[ConnectionTable] = []
    imperfections: dict[str, ImperfectionTable] = {}
    events: list[EventTable] = []
    scenarios: dict[FileName, ScenarioTable] = {}
    analysis: AnalysisTable = AnalysisTable()
    reference: ReferenceTable | None = None
    plots: list[PlotTable] = []
    diagram: DiagramTable = DiagramTable()
