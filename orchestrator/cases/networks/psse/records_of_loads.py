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
        numbers = (load.bus, load.owner, load.zone, load.area, None)
        for name, number in zip(names, numbers, strict=True):
            for identifier in (load.name, _EVERY):
                record = self._first.get((name, number, identifier))
                if record is not None:
                    return record
        return None
