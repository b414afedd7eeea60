"""WECC's grid-following converters as the phasor converter, at the user's word."""

from collections.abc import Collection, Mapping, Sequence

from fmus.grid_following.dyr_approximation import CONVERTER, FIELDS, MODEL, PLANT, approximation
from fmus.toolchain.dyr_form import DyrField
from fmus.wecc_renewable.dyr_records import model_of_record
from orchestrator.cases.form.remedies import replacement_of
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, given_values
from orchestrator.cases.networks.psse.machine_model import MachineModel
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.core.errors import InputError


def models_of_following(
    of: Mapping[tuple[int, str], Sequence[DynamicRecord]],
    left: Collection[str],
    problems: list[str],
    labels: Mapping[tuple[int, str], str],
) -> dict[tuple[int, str], MachineModel]:
    """Models of the machines that are grid-following converters; ``problems`` takes what speaks against one.

    ``labels``: of the machines' units."""
    found = {}
    for key, own in of.items():
        if any(record.name in FIELDS and record.name not in left for record in own):
            try:
                parameters, replaced = followed(own, left, labels[key])
            except InputError as error:
                problems.append(str(error))
                parameters, replaced = {}, []
            found[key] = MachineModel({}, parameters, MODEL, replaced=tuple(replaced))
    return found


def followed(
    records: Sequence[DynamicRecord], left: Collection[str], unit: str
) -> tuple[Mapping[str, float], list[tuple[int, str]]]:
    """The approximation of a grid-following converter by its records; ``unit`` is the label of its unit.

    Returns parameters of the model, and what it leaves out, with the lines that say it."""
    own = [record for record in records if record.name in FIELDS and record.name not in left]
    values: dict[str, dict[str, float]] = {}
    for record in own:
        others = FIELDS.keys() - {CONVERTER} if record.name != CONVERTER else {CONVERTER}
        if others & {*values}:
            raise InputError.at(
                record.place,
                f"a second {record.name} of machine {record.machine!r} at bus {record.bus}",
            )
        fields = tuple(DyrField(name) for name in FIELDS[record.name])
        values[record.name] = given_values(record, fields, FIELDS)
    try:
        parameters, texts = approximation(values)
    except ValueError as error:
        raise InputError.at(
            own[0].place,
            f"the converter at bus {own[0].bus} cannot be approximated: {error}; write "
            f"{replacement_of(unit)}, and a converter of ours stands there",
        ) from None
    replaced: list[tuple[int, str]] = [
        (own[0].line, Remark(text, kind)) for kind, text in texts.items()
    ]
    for record in (r for r in records if model_of_record(r.name) == PLANT and r.name in left):
        told = f"{record.name} left out, as dyr_leave_out says: the references are constant"
        replaced.append((record.line, told))
    return parameters, replaced
