"""Records of dynamics data with more values than their model has, or fewer: what is read, and what is asked.

GridPACK's reader takes as many values as a model has, passes over what follows, and gives 0 to those that are missing
at the end (`parser_classes` and the models' `load`). What PSS/E says of either no public source tells. A machine's own
record, and those of converters, whose fields differ from revision to revision, need all of their values."""

import math
from collections.abc import Sequence
from dataclasses import replace

from fmus.toolchain.dyr_form import DyrField
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, decimal_commas, number_in
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.limiter_records import LIMITERS
from orchestrator.cases.networks.psse.machine_model import ON_SHAFT
from orchestrator.cases.networks.unit_row import DoubtOfRecord
from orchestrator.core.errors import number_of

_OF_CONTROLS = ("exciter", "governor", "stabilizer", "compensator", *LIMITERS)
_MAY_LACK = (*_OF_CONTROLS, "shaft", *ON_SHAFT)
"""Kinds of records whose last values may be missing."""

_MAY_EXCEED = ("machine", *_MAY_LACK)
"""Kinds of records that may have more values than fields."""

_CLASSICAL = "GENCLS"


def with_needed_counts(records: Sequence[DynamicRecord]) -> list[DynamicRecord]:
    """Return the records, those of machines and their controls with as many values as their models have."""
    return [_with_needed_count(record) for record in records]


def _with_needed_count(record: DynamicRecord) -> DynamicRecord:
    known = RECORDS_OF_UNITS.get(record.name)
    if known is None or not _are_numbers(record.values, known.fields):
        return record
    needed = len(known.fields)
    surplus, lacking = record.values[needed:], max(0, needed - len(record.values))
    if surplus and known.kind in _MAY_EXCEED:
        return replace(record, values=record.values[:needed], surplus=surplus)
    if lacking and record.values and known.kind in _MAY_LACK:
        return replace(record, values=(*record.values, *("0",) * lacking), lacking=lacking)
    return record


def _are_numbers(values: Sequence[str], fields: Sequence[DyrField]) -> bool:
    """Return whether a record's values are numbers, as they are not where it runs into the next one."""
    if any(field.is_text for field in fields):
        return False
    return not any(math.isnan(number_in(text)) for text in values)


def doubt_of_count(record: DynamicRecord) -> DoubtOfRecord | None:
    """Return the question about a record whose values were too many or too few; None where they were not."""
    known = RECORDS_OF_UNITS.get(record.name)
    if known is None or not (record.surplus or record.lacking):
        return None
    needed = len(known.fields)
    if record.surplus:
        count = needed + len(record.surplus)
        rest = ", ".join(record.surplus)
        taken = f"what follows them ({rest}) is not used, as in GridPACK"
        if record.name == _CLASSICAL:
            taken += "; its reactance is ZX of the RAW file, as in PSS/E"
    else:
        count = needed - record.lacking
        names = ", ".join(field.name for field in known.fields[count:])
        taken = f"the others ({names}) are taken as 0, as in GridPACK"
    text = f"{record.name} has {number_of(count, 'value')}, and needs {needed}: {taken}; correct the record"
    text += decimal_commas(record, needed)
    return DoubtOfRecord(known.kind, record.place, text, f"a number of values of {record.name}")
