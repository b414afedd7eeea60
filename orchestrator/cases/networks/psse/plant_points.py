"""Points of the network at which the controllers of plants and static var compensators measure."""

import re
from collections.abc import Mapping, Sequence

from fmus.grid_following.dyr_approximation import PLANT
from fmus.static_var.dyr_records import STATIC_VAR_RECORDS
from fmus.wecc_renewable.dyr_records import model_of_record
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.core.errors import InputError

HELD_BUS = "IB"
"""First field of a compensator's record that may hold another bus' voltage; 0 and its own number are its terminal."""

_PLACES = 4  # first values of REPCA1: the bus and the branch that are measured


def measured_points(
    of: Mapping[tuple[int, str], Sequence[DynamicRecord]],
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    problems: list[str],
) -> dict[tuple[int, str], MeasuredPoint]:
    """Return where the controllers of plants and compensators measure that do not at their own terminal."""
    found = _held_buses(of, parts, problems)
    for key, record in ((key, r) for key, own in of.items() for r in own):
        is_plant = model_of_record(record.name) == PLANT
        if is_plant and "plant" in parts[key] and len(record.values) >= _PLACES:
            try:
                point = point_of_record(record, key[0])
            except InputError as error:
                problems.append(str(error))
                continue
            found |= {} if point.is_own else {key: point}
    return found


def _held_buses(
    of: Mapping[tuple[int, str], Sequence[DynamicRecord]],
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    problems: list[str],
) -> dict[tuple[int, str], MeasuredPoint]:
    """Return the buses whose voltage compensators hold that is not their own."""
    found: dict[tuple[int, str], MeasuredPoint] = {}
    for key, record in ((key, r) for key, own in of.items() for r in own):
        known = STATIC_VAR_RECORDS.get(record.name)
        if known is None or known.fields[0].name != HELD_BUS or not record.values:
            continue
        if parts[key].get(known.kind) != known.part:
            continue
        try:
            bus = number_of_bus(record, HELD_BUS, record.values[0])
        except InputError as error:
            problems.append(str(error))
            continue
        if bus not in (0, key[0]):
            found[key] = MeasuredPoint(
                bus, 0, 0, "", record.place, record=record.name, of_voltage=True
            )
    return found


def number_of_bus(record: DynamicRecord, field: str, text: str) -> int:
    """Return the number of a bus in a record, 0 where it names none; an `InputError` where it is no number."""
    if not re.fullmatch(r"\d{1,9}", text):
        raise InputError.at(
            record.place,
            f"{record.name} has {field} = {text!r}; it must be the number of a bus, or 0",
        )
    return int(text)


def point_of_record(record: DynamicRecord, own_bus: int) -> MeasuredPoint:
    """Return where a plant's controller measures, by the first values of its record."""
    bus, near, far = (
        number_of_bus(record, name, text)
        for name, text in zip(("BUSR", "BUS1", "BUS2"), record.values, strict=False)
    )
    if bool(near) != bool(far):
        raise InputError.at(
            record.place,
            f"{record.name} has BUS1 = {near} and BUS2 = {far}; give both ends of it, or 0 twice",
        )
    circuit = record.values[3].strip()
    measured = 0 if bus == own_bus else bus
    return MeasuredPoint(measured, near, far, circuit, record.place, record.name)
