"""Records of dynamics data of loads: which one a load follows."""

from collections.abc import Iterable, Sequence

from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.raw_network import FileLoad

_EVERY = "*"  # identifier of all loads of the bus, area, zone or owner


class RecordsOfLoads:
    """Records by what of a load they may name; a file's thousands of loads each ask for a dozen kinds of them."""

    def __init__(self, records: Iterable[DynamicRecord]) -> None:
        self._first: dict[tuple[str, int | None, str], DynamicRecord] = {}
        for record in records:
            for number in (record.bus, None):
                self._first.setdefault((record.name, number, record.machine), record)

    def first(self, load: FileLoad, names: Sequence[str]) -> DynamicRecord | None:
        """Return the record that names a load, and that goes before others; None where there is none.

        ``names``: of the records of a load, an owner, a zone, an area, and of all loads."""
        for name, number in zip(names, _numbers_of(load), strict=True):
            for identifier in (load.name, _EVERY):
                record = self._first.get((name, number, identifier))
                if record is not None:
                    return record
        return None


class LoadsOfRecords:
    """Loads by what of them a record may name."""

    def __init__(self, loads: Iterable[FileLoad]) -> None:
        self._named: dict[tuple[int, int | None, str], list[FileLoad]] = {}
        for load in loads:
            for level, number in enumerate(_numbers_of(load)):
                for identifier in (load.name, _EVERY):
                    self._named.setdefault((level, number, identifier), []).append(load)

    def of(self, record: DynamicRecord, names: Sequence[str]) -> Sequence[FileLoad]:
        """Return the loads that a record names, whether another goes before it or not.

        ``names``: of the records of a load, an owner, a zone, an area, and of all loads, the record's among them."""
        level = names.index(record.name)
        number = None if record.name == names[-1] else record.bus
        return self._named.get((level, number, record.machine), ())


def _numbers_of(load: FileLoad) -> tuple[int | None, ...]:
    """Return the numbers by which records name a load, the narrower first."""
    return load.bus, load.owner, load.zone, load.area, None
