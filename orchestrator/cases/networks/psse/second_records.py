"""Records of dynamics data that stand in a file a second time: copies, and further models of a load."""

from collections.abc import Collection, Mapping, Sequence

from orchestrator.cases.networks.psse.air_conditioners import AIR_CONDITIONERS
from orchestrator.cases.networks.psse.composite_loads import COMPOSITE_NAMES
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.load_records import LOAD_RECORDS
from orchestrator.cases.networks.psse.motor_loads import MOTOR_NAMES
from orchestrator.core.errors import Problem, QuestionTopic

_MODELS_OF_LOADS = {*MOTOR_NAMES, *COMPOSITE_NAMES, *LOAD_RECORDS, *AIR_CONDITIONERS}
"""Records of which a load follows one."""


def copies_of(records: Sequence[DynamicRecord]) -> Mapping[DynamicRecord, DynamicRecord]:
    """Return the first record by each copy of it: of a machine, of one model, and with the same values."""
    first: dict[tuple[object, ...], DynamicRecord] = {}
    found = {}
    for record in records:
        if record.name not in RECORDS_OF_UNITS or record.line_of_dc:
            continue
        key = record.bus, record.name, record.machine, record.values
        before = first.setdefault(key, record)
        if before is not record:
            found[record] = before
    return found


def second_load_models(
    records: Sequence[DynamicRecord], taken: Collection[tuple[str, int]]
) -> Mapping[DynamicRecord, DynamicRecord]:
    """Return the record that a load follows by each other of the same bus and identifier.

    ``taken``: file and line of the records that are used."""
    own = [record for record in records if record.name in _MODELS_OF_LOADS]
    followed = {
        (record.bus, record.machine): record
        for record in own
        if (record.file, record.line) in taken
    }
    return {
        record: followed[record.bus, record.machine]
        for record in own
        if (record.file, record.line) not in taken and (record.bus, record.machine) in followed
    }


def why_a_copy(first: DynamicRecord) -> str:
    """Return why a copy is not used."""
    return f"a copy of the record in line {first.line}"


def why_a_second(record: DynamicRecord, first: DynamicRecord) -> str:
    """Return why a further model of a load is not used."""
    return (
        f"a second load record of the load {record.machine!r} at bus {record.bus}; the first is "
        f"{first.name} in line {first.line}"
    )


def question_of_copy(record: DynamicRecord, first: DynamicRecord) -> Problem:
    """Ask about a record that stands there twice."""
    text = (
        f"{record.name} of machine {record.machine!r} at bus {record.bus} stands there a second time, with the values "
        f"of line {first.line}; it is read once; remove one, or correct the machine of the other"
    )
    return Problem(record.place, text, topic=QuestionTopic("a record that stands there twice"))


def question_of_second(record: DynamicRecord, first: DynamicRecord) -> Problem:
    """Ask about a further model of a load, which decides nothing."""
    text = f"{record.name} is not used: {why_a_second(record, first)}; remove one of them"
    return Problem(record.place, text, topic=QuestionTopic("a second load record", record.name))
