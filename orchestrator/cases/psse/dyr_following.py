"""WECC's grid-following converters in dynamics data: as the phasor converter at the user's word, else refused."""

from collections.abc import Collection, Mapping, Sequence

from fmus.grid_following.dyr_fields import CONVERTER, FIELDS, MODEL, PLANT, approximation
from fmus.synchronous_generator.dyr_fields import DyrField
from orchestrator.cases.psse.dyr_records import DynamicRecord, given_values
from orchestrator.errors import InputError

_FAMILIES = ("REGC", "REEC", "REPC", "WTG", "WT4", "WT3", "PVGU", "PVEU", "PLNTB")
"""How the names of grid-following converters and their controls begin."""


def remedy_for(name: str, *, approximate: bool) -> str:
    """What to do about a record that no part stands for; empty where it is of no grid-following converter."""
    if not name.startswith(_FAMILIES):
        return ""
    if name == PLANT:
        return (
            f", the controller of a plant; name it in dyr_leave_out = ['{PLANT}'], and the references of its converter "
            "are constant"
        )
    if approximate or name not in FIELDS:
        return (
            ", a grid-following converter; name its records in dyr_leave_out, and give its unit alpha = 1 with a "
            "converter of ours"
        )
    return (
        f", a grid-following converter; write dyr_approximate = true for {MODEL} in its place, with a list of what "
        "that leaves out, or name its records in dyr_leave_out, and give its unit alpha = 1 with a converter of ours"
    )


def is_following(records: Sequence[DynamicRecord], left: Collection[str]) -> bool:
    """Whether some of a machine's records, but for those that are left out, can be approximated."""
    return any(record.name in FIELDS and record.name not in left for record in records)


def followed(
    records: Sequence[DynamicRecord], left: Collection[str]
) -> tuple[Mapping[str, float], list[tuple[int, str]]]:
    """The approximation of a grid-following converter by its records.

    Returns parameters of the model, and what it leaves out, with the lines that say it."""
    own = [record for record in records if record.name in FIELDS and record.name not in left]
    values: dict[str, dict[str, float]] = {}
    for record in own:
        others = FIELDS.keys() - {CONVERTER} if record.name != CONVERTER else {CONVERTER}
        if others & {*values}:
            raise InputError(
                f"{record.place}: a second {record.name} of machine {record.machine!r} at bus {record.bus}"
            )
        fields = tuple(DyrField(name) for name in FIELDS[record.name])
        values[record.name] = given_values(record, fields, FIELDS)
    try:
        parameters, texts = approximation(values)
    except ValueError as error:
        raise InputError(
            f"{own[0].place}: the converter at bus {own[0].bus} cannot be approximated: {error}; name its records in "
            "dyr_leave_out, and give its unit alpha = 1 with a converter of ours"
        ) from None
    replaced = [(own[0].line, text) for text in texts]
    for record in (record for record in records if record.name == PLANT and PLANT in left):
        replaced.append((record.line, f"{PLANT} left out, as dyr_leave_out says: the references are constant"))
    return parameters, replaced
