"""Relays that shed load by their records of dynamics data: of three stages and of five.

    LVSH, LDSH   three stages of a limit [pu, Hz], a delay [s] and a share of the load, and TB [s]
    LVS3, LDS3   whole values, five stages of a limit, a delay, TB and a share, and TTB [s]

LVSH may name another bus that it watches before its stages. The whole values of LDS3 are bus and identifier of a
generator ('-1' for all there), those of LVS3 two branches by their buses and circuit: as soon as a stage has waited for
its delay, these are ordered off and go TTB later. The last whole value says if the shunts of the bus are shed as well.

Source: PowerWorld's guide to PSS/E's relay models; fields as InterPSS and GridPACK read them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf

from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import RecordsOfLoads
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.cases.networks.psse.relay_records import check_times, numbers_of
from orchestrator.core.errors import InputError, number_of
from orchestrator.systems.coupling.relay_limits import Quantity, RelayLimits

_SUBSYSTEMS = ("BL", "OW", "ZN", "AR", "AL")  # the narrower first
_HIGHEST_SHARE = 1.0
_OF_MACHINE = 2  # whole values that name a machine: its bus and its identifier
_OF_BRANCH = 3  # whole values that name a branch: its buses and its circuit
_NONE = "0"  # of a whole value that names nothing
_EVERY_MACHINE = "-1"  # identifier that names all machines of a bus


@dataclass(frozen=True)
class LoadRelayForm:
    """How a family of records is written.

    ``names``: of its records, the narrower first; ``machines``, ``branches``: how many it may take off besides."""

    names: tuple[str, ...]
    quantity: Quantity
    stages: int
    machines: int = 0
    branches: int = 0
    may_watch: bool = False  # whether another bus that it watches may stand before the stages

    @property
    def has_own_times(self) -> bool:
        """Return whether each stage has a breaker of its own."""
        return bool(self.machines or self.branches)

    @property
    def of_stage(self) -> int:
        return 4 if self.has_own_times else 3

    @property
    def whole(self) -> int:
        """Return how many whole values stand before the stages."""
        named = self.machines * _OF_MACHINE + self.branches * _OF_BRANCH
        return named + 1 if named else 0

    @property
    def count(self) -> int:
        """Return how many values a record has."""
        return self.whole + self.stages * self.of_stage + max(1, self.machines + self.branches)

    @property
    def in_words(self) -> str:
        """Return what its values are."""
        if self.branches:
            return "two branches, a flag, five times a limit, a delay, TB and a share, and two TTB"
        if self.machines:
            return "a generator, a flag, five times a limit, a delay, TB and a share, and TTB"
        return "three times a limit, a delay and a share, and TB"


def _names(stem: str) -> tuple[str, ...]:
    return tuple(f"{stem}{subsystem}" for subsystem in _SUBSYSTEMS)


LOAD_RELAYS = (
    LoadRelayForm(_names("LVSH"), "voltage", 3, may_watch=True),
    LoadRelayForm(_names("LDSH"), "frequency", 3),
    LoadRelayForm(_names("LVS3"), "voltage", 5, branches=2),
    LoadRelayForm(_names("LDS3"), "frequency", 5, machines=1),
)


FORM_OF = {name: form for form in LOAD_RELAYS for name in form.names}
"""The family of a record by its name."""


@dataclass(frozen=True)
class TransferTrip:
    """A part that a relay of a load takes off besides: a machine by bus and identifier, ``"-1"`` for all of the bus,
    or a branch by its buses and circuit."""

    machine: tuple[int, str] | None = None
    branch: tuple[int, int, str] | None = None


@dataclass(frozen=True)
class LoadRelay:
    """A stage of a relay of a load: the share of the file's load that it takes off, or what it takes off besides."""

    record: DynamicRecord
    load: FileLoad
    watched: int
    quantity: Quantity
    limits: RelayLimits
    share: float
    transfer: TransferTrip | None = None
    sheds_shunts: bool = False


def load_relays(records: Sequence[DynamicRecord], loads: Sequence[FileLoad]) -> list[LoadRelay]:
    """Return the stages of the relays of loads; of two records of one family the narrower counts.

    Raises
    ------
    InputError
        If records have not their values, or one that cannot be; with all of them.
    """
    of_loads = RecordsOfLoads(records)
    found, refusals = list[LoadRelay](), Refusals()
    for load in loads:
        for form in LOAD_RELAYS:
            record = of_loads.first(load, form.names)
            if record is not None and load.p_mw > 0:
                with refusals.keep():
                    found += _stages(record, load, form)
    refusals.tell()
    return found


def _stages(record: DynamicRecord, load: FileLoad, form: LoadRelayForm) -> Iterator[LoadRelay]:
    texts = record.values
    names_bus = form.may_watch and len(texts) == form.count + 1
    if not names_bus and len(texts) != form.count:
        raise InputError.at(
            record.place,
            f"{record.name} has {number_of(len(texts), 'value')}, and needs {form.count}: {form.in_words}; "
            f"a relay that is not wanted goes with dyr_leave_out = ['{record.name}'] in [units]",
        )
    watched = load.bus
    if names_bus:
        number, texts = texts[0], texts[1:]
        if not number.isdigit():
            raise InputError.at(
                record.place, f"{record.name} watches bus {number!r}; it must be a number, or 0"
            )
        watched = int(number) or load.bus
    whole, texts = texts[: form.whole], texts[form.whole :]
    values, last = numbers_of(record, texts), max(1, form.machines + form.branches)
    of_stages, times = values[:-last], values[-last:]
    transfers = [*zip(_transfers(record, whole, form), times, strict=False)]
    sheds_shunts = bool(whole) and whole[-1] != _NONE
    for k in range(0, len(of_stages), form.of_stage):
        low, delay, *own, share = of_stages[k : k + form.of_stage]
        opening = own[0] if own else times[0]
        check_times(record, delay, opening)
        if not 0 <= share <= _HIGHEST_SHARE:
            raise InputError.at(
                record.place,
                f"{record.name} sheds the share {share:g} of its load; a share is from 0 to 1",
            )
        if not (share > 0 and low > 0):
            continue
        limits = RelayLimits(low, inf, delay, opening)
        stage = LoadRelay(record, load, watched, form.quantity, limits, share)
        yield replace(stage, sheds_shunts=sheds_shunts)
        for transfer, time in transfers:
            check_times(record, delay, time)
            if transfer is not None:
                later = RelayLimits(low, inf, delay, time)
                yield replace(stage, limits=later, share=0.0, transfer=transfer)


def _transfers(
    record: DynamicRecord, whole: Sequence[str], form: LoadRelayForm
) -> Iterator[TransferTrip | None]:
    """Yield what a record takes off besides, None where it names nothing."""
    if form.machines:
        bus, name = whole[:_OF_MACHINE]
        _check_buses(record, [bus])
        yield TransferTrip(machine=(int(bus), name.strip())) if int(bus) else None
    for k in range(0, form.branches * _OF_BRANCH, _OF_BRANCH):
        one, other, circuit = whole[k : k + _OF_BRANCH]
        _check_buses(record, [one, other])
        branch = int(one), int(other), circuit.strip()
        yield TransferTrip(branch=branch) if int(one) and int(other) else None


def _check_buses(record: DynamicRecord, numbers: Sequence[str]) -> None:
    for number in numbers:
        if not number.isdigit():
            raise InputError.at(
                record.place,
                f"{record.name} takes off what is at bus {number!r}; it must be a number, or 0",
            )


def is_of(transfer: TransferTrip, machine: tuple[int, str]) -> bool:
    """Return whether a machine, by bus and identifier, is taken off."""
    if transfer.machine is None:
        return False
    bus, name = transfer.machine
    return bus == machine[0] and name in (_EVERY_MACHINE, machine[1])
