"""Relays of records that never trip, and settings of relays that make no sense."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.load_relay_records import FORM_OF, LoadRelay
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import LoadsOfRecords, RecordsOfLoads
from orchestrator.cases.networks.psse.relay_records import UnitRelay
from orchestrator.core.errors import Problem, QuestionTopic

_OF_ONE_LOAD = "BL"  # end of the names of records that name a load by its bus
_OVERLAP = 1e-6  # by which the shares of all stages may exceed the whole load

_LONGEST_BREAKER = 1.0
"""Time [s] above which a breaker's is in other units, as it seems: breakers open within some cycles."""


@dataclass(frozen=True)
class IdleRelay:
    """A record of a load's relay that no run has, why, and what to do about it; nothing where PSS/E has none either."""

    record: DynamicRecord
    why: str
    remedy: str = ""


def idle_load_relays(
    records: Sequence[DynamicRecord],
    loads: Sequence[FileLoad],
    shed: Sequence[LoadRelay],
    *,
    is_motor: Callable[[FileLoad], bool],
    is_bus: Callable[[int], bool],
) -> Iterator[IdleRelay]:
    """Yield the relays of loads that never trip.

    ``shed``: the stages that could be taken, whichever bus they watch; ``is_motor``: whether a load is motors here,
    which no relay sheds; ``is_bus``: whether a number is of a bus here."""
    own = [record for record in records if record.name in FORM_OF]
    first: dict[tuple[str, int, str], DynamicRecord] = {}
    of_loads, loads_of = RecordsOfLoads(own), LoadsOfRecords(loads)
    taken = {stage.record: stage for stage in shed}
    for record in own:
        key = record.name, record.bus, record.machine
        before = first.setdefault(key, record)
        if before is not record:
            why = f"a second relay of {_load_in_words(record)}; the first is in line {before.line}"
            yield IdleRelay(record, why, "remove one of the two")
            continue
        named = loads_of.of(record, FORM_OF[record.name].names)
        why, remedy = _reason(
            record, named, of_loads, taken.get(record), is_motor=is_motor, is_bus=is_bus
        )
        if why:
            yield IdleRelay(record, why, remedy)


def _reason(
    record: DynamicRecord,
    named: Sequence[FileLoad],
    of_loads: RecordsOfLoads,
    stage: LoadRelay | None,
    *,
    is_motor: Callable[[FileLoad], bool],
    is_bus: Callable[[int], bool],
) -> tuple[str, str]:
    """Return why a relay never trips, and the remedy; nothing where it may.

    ``named``: the loads that its record names; ``stage``: one of its stages."""
    names = FORM_OF[record.name].names
    of = f"a relay of {_load_in_words(record)}"
    if not named:
        why = f"{of}, which the RAW file does not have in service"
        return why, "correct the bus or identifier of its load"
    followed = [load for load in named if of_loads.first(load, names) is record]
    if not followed:
        return f"{of}, and narrower records go before it", ""
    if all(map(is_motor, followed)):
        why = f"{of}, in whose place induction motors stand, which it does not shed"
        return why, "leave out the motors' record, or this one"
    if all(load.p_mw <= 0 for load in followed):
        return f"{of}, which draws no active power", "correct the bus or identifier of its load"
    if stage is None:
        return f"{of}, of which no stage has a limit and a share", "correct its stages"
    if not is_bus(stage.watched):
        return f"{of} that watches bus {stage.watched}, which is no bus here", (
            "correct the bus that it watches"
        )
    return "", ""


def _load_in_words(record: DynamicRecord) -> str:
    if record.name.endswith(_OF_ONE_LOAD):
        return f"the load {record.machine!r} at bus {record.bus}"
    return "loads"


def doubts_of_settings(
    units: Sequence[UnitRelay], stages: Sequence[LoadRelay]
) -> Iterator[Problem]:
    """Ask about relays whose times, shares or stages make no sense, each record once."""
    for unit in units:
        yield from _times(unit.record, unit.limits.opening)
    by_record: dict[tuple[str, int], list[LoadRelay]] = {}
    for stage in stages:
        by_record.setdefault((stage.record.file, stage.record.line), []).append(stage)
    for every in by_record.values():
        record, load = every[0].record, every[0].load
        yield from _times(record, max(stage.limits.opening for stage in every))
        own = [stage for stage in every if stage.load is load and stage.transfer is None]
        yield from _shares(record, own)
        yield from _order(record, own)


def _times(record: DynamicRecord, opening: float) -> Iterator[Problem]:
    if opening > _LONGEST_BREAKER:
        text = (
            f"{record.name} has a breaker that takes {opening:g} s, and breakers take less than 0.2 s; are its times "
            "in cycles or milliseconds? Write them in seconds"
        )
        yield Problem(record.place, text, topic=QuestionTopic("a relay's times in other units"))


def _shares(record: DynamicRecord, stages: Sequence[LoadRelay]) -> Iterator[Problem]:
    total = sum(stage.share for stage in stages)
    if total > 1 + _OVERLAP:
        told = ", ".join(f"{stage.share:g}" for stage in stages)
        text = (
            f"{record.name} sheds the shares {told} of its load, {total:g} in all, and there is no more than 1 to "
            "shed; each is a share of the whole load; correct them"
        )
        yield Problem(record.place, text, topic=QuestionTopic("a relay's shares above the load"))


def _order(record: DynamicRecord, stages: Sequence[LoadRelay]) -> Iterator[Problem]:
    """Ask about a stage that acts before the one in front of it; a higher limit with a longer delay may be meant."""
    for one, after in pairwise(stages):
        low, later = one.limits, after.limits
        if later.low > low.low and later.delay <= low.delay:
            text = (
                f"{record.name} has a stage at {later.low:g} with a delay of {later.delay:g} s behind one at "
                f"{low.low:g} with {low.delay:g} s: the later stage sheds first; are the limits in reverse order?"
            )
            yield Problem(record.place, text, topic=QuestionTopic("a relay's stages out of order"))
            return
