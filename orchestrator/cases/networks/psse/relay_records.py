"""Relays by their records of dynamics data: trips of generators and of buses, and shedding of loads.

    VTGTPAT, VTGDCAT   bus watched, bus and identifier of the generator; VL, VU [pu], TP, TB [s]
    FRQTPAT, FRQDCAT   the same with FL, FU [Hz]
    LVSH, LDSH         three stages of a limit [pu, Hz], a delay [s] and a share of the load, and TB [s]

A record of a generator's relay begins with its number, in the place of a bus. xxxTPAT takes the generator off, xxxDCAT
its whole bus. LVSH may name another bus that it watches before its stages.

Source: PowerWorld's guide to PSS/E's relay models; fields as InterPSS and GridPACK read them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from orchestrator.cases.networks.psse.dyr_file import NUMBERED, DynamicRecord
from orchestrator.cases.networks.psse.load_records import records_for
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.core.errors import InputError
from orchestrator.core.units import LARGEST
from orchestrator.systems.coupling.relay_limits import Quantity, RelayLimits

_OF_VOLTAGE = "VTG"  # how the names of relays of generators begin that watch a voltage
OF_BUSES = ("VTGDCAT", "FRQDCAT")
_SUBSYSTEMS = ("BL", "OW", "ZN", "AR", "AL")
LOAD_RELAYS: Mapping[Quantity, tuple[str, ...]] = {
    "voltage": tuple(f"LVSH{s}" for s in _SUBSYSTEMS),
    "frequency": tuple(f"LDSH{s}" for s in _SUBSYSTEMS),
}
"""Records that shed load, the narrower first."""

_OF_UNIT = 7  # the bus watched, bus and identifier of the generator, two limits, two times
_STAGES = 3
_OF_STAGE = 3  # limit, delay, share
_OF_LOAD = _STAGES * _OF_STAGE + 1  # with TB
_HIGHEST_SHARE = 1.0


@dataclass(frozen=True)
class UnitRelay:
    """A relay of a machine, by bus and identifier, that watches a bus of the file."""

    record: DynamicRecord
    machine: tuple[int, str]
    watched: int
    quantity: Quantity
    limits: RelayLimits

    @property
    def is_of_bus(self) -> bool:
        """Return whether the whole bus goes off."""
        return self.record.name in OF_BUSES


@dataclass(frozen=True)
class LoadRelay:
    """A stage of a relay of a load: the share of the file's load that it takes off."""

    record: DynamicRecord
    load: FileLoad
    watched: int
    quantity: Quantity
    limits: RelayLimits
    share: float


def unit_relays(records: Sequence[DynamicRecord]) -> Iterator[UnitRelay]:
    """Yield the relays of generators, whichever these are.

    Raises
    ------
    InputError
        If a record has not its values, or one that cannot be.
    """
    for record in records:
        if record.name in NUMBERED:
            yield _unit_relay(record)


def _unit_relay(record: DynamicRecord) -> UnitRelay:
    fields = "the bus that it watches, bus and identifier of the generator, two limits, TP and TB"
    texts = record.values
    if len(texts) != _OF_UNIT or not (texts[0].isdigit() and texts[1].isdigit()):
        raise InputError.at(
            record.place,
            f"{record.name} has {len(texts)} values behind its name, and needs {_OF_UNIT}: {fields}; a "
            f"relay that is not wanted goes with dyr_leave_out = ['{record.name}'] in [units]",
        )
    low, high, delay, opening = _numbers(record, texts[3:])
    _check_times(record, delay, opening)
    if low > high:
        raise InputError.at(
            record.place,
            f"{record.name} has the lower limit {low:g} above the upper {high:g} and always trips; correct them",
        )
    bus = int(texts[1])
    watched = int(texts[0]) or bus
    limits = RelayLimits(low, high, delay, opening)
    quantity: Quantity = "voltage" if record.name.startswith(_OF_VOLTAGE) else "frequency"
    return UnitRelay(record, (bus, texts[2].strip()), watched, quantity, limits)


def load_relays(records: Sequence[DynamicRecord], loads: Sequence[FileLoad]) -> Iterator[LoadRelay]:
    """Yield the stages of the relays of loads; of two records of one quantity the narrower counts.

    Raises
    ------
    InputError
        If a record has not its values, or one that cannot be.
    """
    for load in loads:
        for quantity, names in LOAD_RELAYS.items():
            record = next(records_for(load, records, names), None)
            if record is not None and load.p_mw > 0:
                yield from _stages(record, load, quantity)


def _stages(record: DynamicRecord, load: FileLoad, quantity: Quantity) -> Iterator[LoadRelay]:
    texts = record.values
    names_bus = quantity == "voltage" and len(texts) == _OF_LOAD + 1
    if not names_bus and len(texts) != _OF_LOAD:
        raise InputError.at(
            record.place,
            f"{record.name} has {len(texts)} values, and needs {_OF_LOAD}: three times a limit, a delay and a share, "
            f"and TB; a relay that is not wanted goes with dyr_leave_out = ['{record.name}'] in [units]",
        )
    watched = load.bus
    if names_bus:
        number, texts = texts[0], texts[1:]
        if not number.isdigit():
            raise InputError.at(
                record.place, f"{record.name} watches bus {number!r}; it must be a number, or 0"
            )
        watched = int(number) or load.bus
    *values, opening = _numbers(record, texts)
    for k in range(0, len(values), _OF_STAGE):
        low, delay, share = values[k : k + _OF_STAGE]
        _check_times(record, delay, opening)
        if not 0 <= share <= _HIGHEST_SHARE:
            raise InputError.at(
                record.place,
                f"{record.name} sheds the share {share:g} of its load; a share is from 0 to 1",
            )
        if share > 0 and low > 0:
            limits = RelayLimits(low, inf, delay, opening)
            yield LoadRelay(record, load, watched, quantity, limits, share)


def _numbers(record: DynamicRecord, texts: Sequence[str]) -> list[float]:
    found = []
    for text in texts:
        try:
            value = float(text.upper().replace("D", "E"))
        except ValueError:
            value = inf
        if not abs(value) < LARGEST:
            raise InputError.at(
                record.place, f"{record.name} has the value {text!r}; it must be a number"
            )
        found.append(value)
    return found


def _check_times(record: DynamicRecord, delay: float, opening: float) -> None:
    for what, time in (("delay", delay), ("time of the breaker", opening)):
        if time < 0:
            raise InputError.at(
                record.place, f"{record.name} has a {what} of {time:g} s; it must not be negative"
            )
