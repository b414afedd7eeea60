"""Relays of generators and of their buses by their records of dynamics data.

    VTGTPAT, VTGDCAT   bus watched, bus and identifier of the generator; VL, VU [pu], TP, TB [s]
    FRQTPAT, FRQDCAT   the same with FL, FU [Hz]
    VTGTPA and so on   the same as models of a user (USRMDL)

A record of a generator's relay begins with its number, in the place of a bus. xxxTPAT takes the generator off, xxxDCAT
its whole bus.

Source: PowerWorld's guide to PSS/E's relay models; fields as InterPSS and GridPACK read them."""

from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.cases.networks.psse.dyr_file import NUMBERED, DynamicRecord, number_in
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.core.errors import InputError
from orchestrator.core.units import LARGEST
from orchestrator.systems.coupling.relay_limits import Quantity, RelayLimits

_OF_VOLTAGE = "VTG"  # how the names of relays of generators begin that watch a voltage
OF_BUSES = ("VTGDCAT", "FRQDCAT", "VTGDCA", "FRQDCA")

_OF_UNIT = 7  # the bus watched, bus and identifier of the generator, two limits, two times


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


def unit_relays(records: Sequence[DynamicRecord]) -> list[UnitRelay]:
    """Return the relays of generators, whichever these are.

    Raises
    ------
    InputError
        If records have not their values, or one that cannot be; with all of them.
    """
    found, refusals = list[UnitRelay](), Refusals()
    for record in records:
        if record.name in NUMBERED:
            with refusals.keep():
                found.append(_unit_relay(record))
    refusals.tell()
    return found


def _unit_relay(record: DynamicRecord) -> UnitRelay:
    fields = "the bus that it watches, bus and identifier of the generator, two limits, TP and TB"
    texts = record.values
    if len(texts) != _OF_UNIT or not (texts[0].isdigit() and texts[1].isdigit()):
        raise InputError.at(
            record.place,
            f"{record.name} has {len(texts)} values behind its name, and needs {_OF_UNIT}: {fields}; a "
            f"relay that is not wanted goes with dyr_leave_out = ['{record.name}'] in [units]",
        )
    low, high, delay, opening = numbers_of(record, texts[3:])
    check_times(record, delay, opening)
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


def numbers_of(record: DynamicRecord, texts: Sequence[str]) -> list[float]:
    """Return the values of a record as numbers; an `InputError` at its line where one is none."""
    found = []
    for text in texts:
        value = number_in(text)
        if not abs(value) < LARGEST:
            raise InputError.at(
                record.place, f"{record.name} has the value {text!r}; it must be a number"
            )
        found.append(value)
    return found


def check_times(record: DynamicRecord, delay: float, opening: float) -> None:
    """Refuse negative times [s] at the line of a record."""
    for what, time in (("delay", delay), ("time of the breaker", opening)):
        if time < 0:
            raise InputError.at(
                record.place, f"{record.name} has a {what} of {time:g} s; it must not be negative"
            )
