"""Use of each record of dynamics data: which part stands for it, or why it is not used."""

from collections.abc import Collection, Sequence

from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from orchestrator.cases.networks.psse.dyr_file import EVENT, NUMBERED, DynamicRecord
from orchestrator.cases.networks.psse.limiter_records import UNHEARD, unheard_limiters
from orchestrator.cases.networks.psse.machine_model import MANUAL
from orchestrator.cases.networks.psse.missing_models import (
    LIMITER,
    OF_MACHINES,
    RESTS,
    is_resting,
    kind_of,
    names_load,
    owner_of,
)
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord

_PLANTS = "plants"
"""Kind of the models that set the references of several units."""

_AT_EXCITERS = ("stabilizer", "compensator", LIMITER)
"""Kinds of models that act on a voltage regulator."""


def record_uses(
    records: Sequence[DynamicRecord],
    machines: Collection[tuple[int, str]],
    idle: Collection[tuple[int, str]],
    leaving_out: Sequence[str] = (),
    *,
    approximate: bool = False,
    exciter: str | None = None,
    ours: Collection[tuple[int, str]] = (),
) -> list[RecordUse]:
    """Return what becomes of each record, of which none that stops the reading is there.

    ``exciter``: what machines without a record of one get, where the case says so; ``ours``: machines that a converter
    of the case replaces."""
    left = {name.upper() for name in leaving_out}
    excited = {
        (record.bus, record.machine)
        for record in records
        if exciter not in (None, MANUAL)
        or (kind_of(record.name) == "exciter" and record.name not in left)
    }
    unheard = unheard_limiters(records, left)
    return [
        RecordUse(
            record.file,
            record.line,
            record.model,
            *(
                (UseOfRecord.NOT_USED, "a converter of ours replaces its machine", False)
                if (record.bus, record.machine) in ours
                else _use_of(record, machines, idle, left, approximate, excited, unheard=unheard)
            ),
        )
        for record in records
    ]


def _use_of(
    record: DynamicRecord,
    machines: Collection[tuple[int, str]],
    idle: Collection[tuple[int, str]],
    left: Collection[str],
    approximate: bool,
    excited: Collection[tuple[int, str]],
    *,
    unheard: Collection[DynamicRecord],
) -> tuple[UseOfRecord, str, bool]:
    """Return what became of a record, why, and whether it is of no machine."""
    key = record.bus, record.machine
    of_load = names_load(record.model)
    of_plants = record.model in NUMBERED or kind_of(record.model) == _PLANTS
    of_none = of_load or of_plants or bool(record.line_of_dc)
    if of_none and record.name in left:
        return UseOfRecord.NOT_USED, "dyr_leave_out names it", False
    if key in machines and not of_load:
        if record.name in left:
            return UseOfRecord.NOT_USED, "dyr_leave_out names it", False
        if is_resting(record.name):
            return UseOfRecord.NOT_USED, RESTS, False
        if key not in excited and kind_of(record.name) in _AT_EXCITERS:
            return UseOfRecord.NOT_USED, "its machine has no exciter", False
        if record in unheard:
            return UseOfRecord.NOT_USED, UNHEARD, False
        stand_in = f"approximated as {MODEL}" if approximate and record.name in FIELDS else ""
        return UseOfRecord.USED, stand_in, False
    if key in idle and not of_load:
        return UseOfRecord.NOT_USED, "its machine is out of service", False
    if record.name == EVENT:
        told = f"an event of ANDES, of {record.machine}; [scenarios] has events"
        return UseOfRecord.NOT_USED, told, False
    if record.line_of_dc:
        told = f"a model of the {owner_of(record)} {record.line_of_dc!r}, which is of no machine"
        return UseOfRecord.NOT_USED, told, True
    kind = kind_of(record.name)
    if kind in OF_MACHINES:
        told = f"the RAW file has no machine {record.machine!r} at bus {record.bus}"
        return UseOfRecord.NOT_USED, told, True
    what = {"load": "a load model", "device": "a model of an SVC or a DC line", "relay": "a relay"}
    return (
        UseOfRecord.NOT_USED,
        f"{what.get(kind, 'a model')} at bus {record.bus}, which is of no machine",
        True,
    )
