"""Areas, zones, owners and stations of a RAW file's buses."""

from collections.abc import Sequence

from orchestrator.cases.networks.psse.raw_records import RawFile, Record
from orchestrator.cases.networks.regions import Region, with_name
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import one_line

_COLUMNS = {"area": 4, "zone": 5, "owner": 6}  # of a bus
_NAMES = {"area": 4, "zone": 1, "owner": 1}  # column of the name in the records of each section
_STATION = (4, 5)  # fields of a station's record, whose grounding may be left out
_NODE = 6  # fields of a node's record
_NODE_OF_RAWX = 7  # the same, which RAWX begins with the station's number


def regions_of(raw: RawFile) -> dict[int, Region]:
    """Return the regions of every bus of a file; numbers that are none count as not given."""
    names = {section: _names(raw.of(section), column) for section, column in _NAMES.items()}
    stations = _stations(raw.of("substation"))
    found = {}
    for record in raw.of("bus"):
        area, zone, owner = (
            _group(record, column, names[kind]) for kind, column in _COLUMNS.items()
        )
        bus = record.whole(0, "the bus' number")
        found[bus] = Region(area, zone, owner, stations.get(bus, ""))
    return found


def _group(record: Record, column: int, names: dict[int, str]) -> str:
    number = _whole(record, column)
    return "" if number is None else with_name(number, names)


def _names(records: Sequence[Record], column: int) -> dict[int, str]:
    numbers = {_whole(record, 0): one_line(record.text(column).strip()) for record in records}
    return {number: name for number, name in numbers.items() if number is not None}


def _stations(records: Sequence[Record]) -> dict[int, str]:
    """Return the names of the stations by bus: a station's record, then in RAW its nodes, each with its bus."""
    names: dict[int | None, str] = {}
    station_of: dict[int, int | None] = {}
    station: int | None = None
    for record in records:
        if _is_station(record):
            station = _whole(record, 0)
            names[station] = one_line(record.text(1).strip())
        elif _is_node(record):
            fields = len(record.fields)
            of = station if fields == _NODE else _whole(record, 0)
            bus = _whole(record, fields - 4)
            if bus is not None:
                station_of.setdefault(bus, of)
    return {bus: names[of] for bus, of in station_of.items() if of in names}


def _is_station(record: Record) -> bool:
    """Return whether a record has a name and geographic coordinates, and no terminal's node and circuit."""
    is_terminal = _is_number(record, 1) and "." not in record.text(2)
    return len(record.fields) in _STATION and _is_number(record, 2) and not is_terminal


def _is_node(record: Record) -> bool:
    """Return whether a record has a node's name and bus, and no terminal's node and kind of element."""
    if len(record.fields) == _NODE:
        return not (_is_number(record, 1) and "." not in record.text(4))
    return len(record.fields) == _NODE_OF_RAWX and len(record.text(2)) > 1


def _is_number(record: Record, column: int) -> bool:
    try:
        record.number(column, "")
    except InputError:
        return False
    return True


def _whole(record: Record, column: int) -> int | None:
    """Return a whole number; None where there is another text or none."""
    try:
        return record.whole(column, "") if record.text(column) else None
    except InputError:
        return None
