"""Limiters of excitation by their records of dynamics data: where their exciters take their signal, if at all."""

from collections.abc import Collection, Iterator, Mapping, Sequence

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, given_values
from orchestrator.cases.networks.psse.raw_network import Machine

LIMITERS = ("oel", "uel")
"""Kinds of records that are limiters, of over- and of underexcitation."""

REACTIVE_LIMIT = "oel.Q_ref"  # of OEL4C [pu of MBASE]

UNHEARD = "a limiter of excitation whose signal its exciter does not take where gfor's limiters act"


def unheard_limiters(
    records: Sequence[DynamicRecord], left: Collection[str]
) -> list[DynamicRecord]:
    """Return the limiters beside an exciter's record that takes their signal elsewhere, or not at all.

    ``left``: names of models that are left out."""
    return [record for record, place in _places(records, left) if place is None]


def place_limiters(
    records: Sequence[DynamicRecord],
    left: Collection[str],
    parts: Mapping[tuple[int, str], dict[str, str]],
    values: Mapping[tuple[int, str], dict[str, float]],
) -> None:
    """Set where limiters act, and take those that their exciters do not hear off, by machines' bus and identifier."""
    for record, place in _places(records, left):
        key, kind = (record.bus, record.machine), DYR_RECORDS[record.name].kind
        if key not in parts:
            continue
        if place:
            values[key][f"{kind}.gate"] = place
        elif place is None and parts[key].pop(kind, None) is not None:
            for name in [name for name in values[key] if name.startswith(f"{kind}.")]:
                del values[key][name]


def give_reactive_limits(
    machines: Mapping[tuple[int, str], Machine],
    values: Mapping[tuple[int, str], dict[str, float]],
) -> None:
    """Set the limit of an OEL4C that is 0 to the machine's greatest reactive power, QT, as PowerWorld has it."""
    for key, own in values.items():
        if own.get(REACTIVE_LIMIT) == 0:
            own[REACTIVE_LIMIT] = machines[key].q_max_mvar / machines[key].rating_mva


def _places(
    records: Sequence[DynamicRecord], left: Collection[str]
) -> Iterator[tuple[DynamicRecord, int | None]]:
    """Yield limiters beside an exciter's record with their place there: 0 the reference, else a gate; None for none."""
    known = [record for record in records if record.name in DYR_RECORDS and record.name not in left]
    exciters = {
        (record.bus, record.machine): record
        for record in known
        if DYR_RECORDS[record.name].kind == "exciter"
    }
    for record in known:
        kind, exciter = DYR_RECORDS[record.name].kind, exciters.get((record.bus, record.machine))
        if kind in LIMITERS and exciter is not None:
            yield record, _place(exciter, kind)


def _place(exciter: DynamicRecord, kind: str) -> int | None:
    known = DYR_RECORDS[exciter.name]
    for choice in known.hears.get(kind, "").split():
        condition, _, place = choice.rpartition(":")
        name, _, value = condition.partition("=")
        if not name or given_values(exciter, known.fields, DYR_RECORDS)[name] == float(value):
            return int(place)
    return None
