"""Points of the network at which the controllers of plants measure."""

import re
from collections.abc import Mapping, Sequence

from fmus.grid_following.dyr_fields import PLANT
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.psse.dyr_records import DynamicRecord
from orchestrator.core.errors import InputError

_PLACES = 4  # first values of REPCA1: the bus and the branch that are measured


def measured_points(
    of: Mapping[tuple[int, str], Sequence[DynamicRecord]],
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    problems: list[str],
) -> dict[tuple[int, str], MeasuredPoint]:
    """Return where the controllers of plants measure that do not at their own terminal."""
    found: dict[tuple[int, str], MeasuredPoint] = {}
    for key, record in ((key, r) for key, own in of.items() for r in own if r.name == PLANT):
        if "plant" in parts[key] and len(record.values) >= _PLACES:
            try:
                point = _measured_point(record, key[0])
            except InputError as error:
                problems.append(str(error))
                continue
            found |= {key: point} if point is not None else {}
    return found


def _measured_point(record: DynamicRecord, own_bus: int) -> MeasuredPoint | None:
    """Return where a plant's controller measures; None at its own terminal."""
    numbers = []
    for name, text in zip(("BUSR", "BUS1", "BUS2"), record.values, strict=False):
        if not re.fullmatch(r"\d{1,9}", text):
            raise InputError.at(
                record.place,
                f"{record.name} has {name} = {text!r}; it must be the number of a bus, or 0",
            )
        numbers.append(int(text))
    bus, near, far = numbers
    if bool(near) != bool(far):
        raise InputError.at(
            record.place,
            f"{record.name} has BUS1 = {near} and BUS2 = {far}; give both ends of it, or 0 twice",
        )
    found = MeasuredPoint(
        0 if bus == own_bus else bus, near, far, record.values[3].strip(), record.place
    )
    return None if found.is_own else found
