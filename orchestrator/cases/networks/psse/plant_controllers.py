"""Controllers of plants of several units by PLNTBU1, and the units under them by REAX3BU1 or REAX4BU1."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from fmus.wecc_renewable.dyr_records import AT_A_UNIT, CONTROLLER, CONTROLLER_RECORD
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_values import values_of_record
from orchestrator.cases.networks.psse.plant_points import number_of_bus, point_of_record
from orchestrator.core.errors import InputError

_BASE = "S_n"  # parameter with the base of a plant's data [MVA]; 0 in a record is the system's


@dataclass(frozen=True)
class UnitOfPlant:
    """A unit's record of a plant's controller, and the bus of that controller."""

    record: DynamicRecord
    plant: int

    @property
    def machine(self) -> tuple[int, str]:
        """Bus and identifier of its machine."""
        return self.record.bus, self.record.machine


@dataclass(frozen=True)
class PlantController:
    """A controller of several units: its record, its parameters, and where it measures."""

    record: DynamicRecord
    parameters: Mapping[str, float]
    point: MeasuredPoint

    @property
    def name(self) -> str:
        """Name of its component."""
        return f"plant{self.record.bus}"


def units_of_plants(records: Sequence[DynamicRecord]) -> list[UnitOfPlant]:
    """Return the records of units under a controller of several."""
    return [
        UnitOfPlant(record, number_of_bus(record, "BUSP", record.values[0]))
        for record in records
        if record.name in AT_A_UNIT and record.values
    ]


def plant_controllers(
    records: Sequence[DynamicRecord], plants: Sequence[int]
) -> list[PlantController]:
    """Return the controllers at these buses.

    Raises
    ------
    InputError
        If a record has a value that cannot be, or a bus has two.
    """
    found: dict[int, PlantController] = {}
    for record in records:
        if record.name != CONTROLLER or record.bus not in plants:
            continue
        if record.bus in found:
            text = f"a second {CONTROLLER} of bus {record.bus}; remove one of them"
            raise InputError.at(record.place, text)
        parameters = values_of_record(record, CONTROLLER_RECORD)
        parameters[_BASE] = parameters[_BASE] or SYSTEM_BASE_MVA
        point = point_of_record(record, record.bus)
        found[record.bus] = PlantController(record, parameters, point)
    return [*found.values()]
