"""Limiters of excitation by their records of dynamics data, and the exciters that do not take their signal."""

from collections.abc import Collection, Mapping, Sequence

from fmus.synchronous_generator.dyr_fields import DYR_RECORDS
from orchestrator.cases.networks.psse.dyr_records import DynamicRecord, given_values

LIMITERS = ("oel", "uel")
"""Kinds of records that are limiters, of over- and of underexcitation."""

UNHEARD = "a limiter of excitation whose signal its exciter does not add to the voltage reference"


def unheard_limiters(
    records: Sequence[DynamicRecord], left: Collection[str]
) -> list[DynamicRecord]:
    """Return the limiters beside an exciter's record that takes their signal at a gate, or not at all.

    ``left``: names of models that are left out."""
    records = [record for record in records if record.name not in left]
    exciters = {
        (record.bus, record.machine): record
        for record in records
        if record.name in DYR_RECORDS and DYR_RECORDS[record.name].kind == "exciter"
    }
    found = []
    for record in records:
        known = DYR_RECORDS.get(record.name)
        exciter = exciters.get((record.bus, record.machine))
        if known is None or known.kind not in LIMITERS or exciter is None:
            continue
        if not _sums(exciter, known.kind):
            found.append(record)
    return found


def take_off_unheard(
    records: Sequence[DynamicRecord],
    left: Collection[str],
    parts: Mapping[tuple[int, str], dict[str, str]],
    values: Mapping[tuple[int, str], dict[str, float]],
) -> None:
    """Take limiters that their exciters do not hear off the machines' parts and parameters, by bus and identifier."""
    for record in unheard_limiters(records, left):
        key, kind = (record.bus, record.machine), DYR_RECORDS[record.name].kind
        if parts.get(key, {}).pop(kind, None) is not None:
            for name in [name for name in values[key] if name.startswith(f"{kind}.")]:
                del values[key][name]


def _sums(exciter: DynamicRecord, kind: str) -> bool:
    """Return whether an exciter adds the signal of a kind of limiter to its voltage reference."""
    known = DYR_RECORDS[exciter.name]
    if kind not in known.sums:
        return False
    name, _, value = known.sums[kind].partition("=")
    return not name or given_values(exciter, known.fields, DYR_RECORDS)[name] == float(value)
