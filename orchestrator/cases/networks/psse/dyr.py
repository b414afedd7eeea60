"""PSS/E dynamics data (DYR): machines with their controls, and converters, of the generators of a RAW file."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from fmus.static_var.held_bus import ELSEWHERE
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_mistakes import (
    LEAST_STRANGE,
    WITHOUT_RECORD,
    count_repeats,
    going_with_shafts,
    other_network,
    records_unfit,
    slips,
    without_machine,
)
from orchestrator.cases.networks.psse.dyr_questions import doubts_of_machine
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.following_converters import models_of_following
from orchestrator.cases.networks.psse.limiter_records import give_reactive_limits, place_limiters
from orchestrator.cases.networks.psse.machine_model import (
    BY_SPEED,
    CLASSICAL,
    OF_PLANTS,
    SOURCE_IMPEDANCE,
    STATIC,
    MachineModel,
    plant_of,
)
from orchestrator.cases.networks.psse.missing_models import (
    MissingModel,
    in_words,
    is_own,
    missing_models,
    names_load,
)
from orchestrator.cases.networks.psse.parts_of_machines import MachineKey, PartsOfMachines
from orchestrator.cases.networks.psse.plant_points import measured_points
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.core.errors import InputError, first_of
from orchestrator.core.options import Option, command

_MOST_SHOWN = 20


def machine_models(
    records: Sequence[DynamicRecord],
    machines: Sequence[Machine],
    leaving_out: Sequence[str] = (),
    replaced: Collection[tuple[int, str]] = (),
    idle: Collection[tuple[int, str]] = (),
    *,
    approximate: bool = False,
) -> dict[tuple[int, str], MachineModel]:
    """Models of the machines in service, by bus and identifier.

    ``leaving_out``: models whose records may be left out; their generators keep what the case says of that part.
    ``replaced``: machines in whose place a converter of the case stands: they need no record.
    ``approximate``: whether WECC's grid-following converters become `gfl_phasor`, which leaves a part of them out; else
    those of REGCA1 are models of their own."""
    left = {name.upper() for name in leaving_out}
    _refuse_absent([name for name in leaving_out if name != WITHOUT_RECORD], records)
    # a load may have the identifier of the machine at its bus
    records = [record for record in records if not names_load(record.model)]
    found = PartsOfMachines(machines, left, approximate=approximate)
    for record in records:
        found.take(record)
    place_limiters([] if found.problems else records, left, found.parts, found.values)
    give_reactive_limits(found.machines, found.values)
    found.give_load_controllers()
    found.give_infinite_machines()
    static = _static_machines(found, replaced) if WITHOUT_RECORD in leaving_out else {}
    measured = measured_points(found.records, found.parts, found.problems)
    following: dict[MachineKey, MachineModel] = {}
    if approximate:
        following = models_of_following(found.records, left, found.problems, found.labels)
    for key in following:
        found.parts[key]["converter"] = MODEL
    for key in static:
        found.parts[key]["converter"] = STATIC
    _refuse_what_lacks(found, records, left, {*replaced}, {*idle})
    return (
        following
        | static
        | {
            key: replace(
                _own_model(found, key, elsewhere=key in measured, is_open=found.is_open(key)),
                lines=found.lines[key],
                replaced=tuple(_left_out_of_plant(found.parts[key], found.records[key], left)),
                measured=measured.get(key),
                doubts=tuple(doubts_of_machine(machine, found.records[key], found.values[key])),
            )
            for key, machine in found.machines.items()
            if {"machine", "converter"} & {*found.parts[key]} and key not in following | static
        }
    )


def machines_without_record(
    records: Sequence[DynamicRecord], machines: Sequence[Machine]
) -> list[tuple[int, str]]:
    """Return the machines of which the file has no record, by bus and identifier.

    What the network calls infinite needs none."""
    recorded = {(record.bus, record.machine) for record in records if not names_load(record.model)}
    keys = [(one.bus, one.name.strip()) for one in machines if not one.is_infinite]
    return [key for key in keys if key not in recorded]


def _static_machines(
    found: PartsOfMachines, replaced: Collection[MachineKey]
) -> dict[MachineKey, MachineModel]:
    """Return static generation in the place of the machines that have no record; `InputError` where each has one."""
    bare = [key for key in without_machine(found.parts) if not found.records[key]]
    if not bare:
        raise InputError(
            f"dyr_leave_out names {WITHOUT_RECORD!r}, and every machine has a record; take it out"
        )
    return {key: MachineModel({}, {}, STATIC) for key in bare if key not in replaced}


def _refuse_what_lacks(
    found: PartsOfMachines,
    records: Sequence[DynamicRecord],
    left: set[str],
    replaced: Collection[MachineKey],
    idle: Collection[MachineKey],
) -> None:
    """Refuse, all together, what no part stands for, machines without a record, and parts that do not fit."""
    there = {*found.machines, *idle}
    strange = [
        record
        for record in records
        if (record.bus, record.machine) not in there and record.name in RECORDS_OF_UNITS
    ]
    unmodelled = without_machine(found.parts)
    passed = {*RECORDS_OF_UNITS, *found.without, *(left - _own_models(records, left, unmodelled))}
    passed |= {*(FIELDS if found.approximate else ())}
    missing = missing_models(records, found.machines, passed, unmodelled)
    lacking = {key for model in missing for key in _machines_of(model) if not model.may_go}
    missing = [model for model in missing if model.may_go or not _machines_of(model) <= {*replaced}]
    accounted = {*replaced, *found.lacking, *lacking}
    bare = [key for key in unmodelled if key not in accounted]
    places = {(record.bus, record.machine) for record in strange}
    problems = found.problems
    known = sum(record.name in RECORDS_OF_UNITS for record in records)
    if min(len(places), len(bare)) >= LEAST_STRANGE and 2 * len(strange) > known:
        problems = [other_network(strange, records, bare, len(found.machines)), *problems]
        strange = []
        accounted |= {*bare}
    recorded = {key for key, own in found.records.items() if own}
    powers = {key: machine.p_mw for key, machine in found.machines.items()}
    unfit = records_unfit(found.parts, accounted, found.labels, recorded, powers, found.names)
    with_shafts = going_with_shafts(found.unread, found.records)
    problems = [*(slips(strange) if bare else ()), *problems, *with_shafts, *unfit]
    if not problems and not missing:
        return
    counted_once = [*count_repeats(problems, found.first_places)]
    listed = first_of(counted_once, _MOST_SHOWN, ("gfor new lists all with " + Option.DETAILS))
    shown = [*in_words(missing, found.labels), *listed]
    remedy = "correct them"
    if found.may_go or any(model.may_go for model in missing):
        option = command("new", (Option.DYR_LEAVE_OUT, "MODEL"))
        remedy += f", or name models that may go in [units] dyr_leave_out ({option})"
    raise InputError(f"the dynamics data cannot be taken over; {remedy}:\n  " + "\n  ".join(shown))


def _own_model(
    found: PartsOfMachines, key: MachineKey, *, elsewhere: bool, is_open: bool
) -> MachineModel:
    """The model that the records of a machine make; ``is_open``: whether one of them is left out."""
    machine, parts, values = found.machines[key], found.parts[key], found.values[key]
    if "converter" in parts:
        return _converter(machine, parts, found.names[key], values, elsewhere)
    return _machine(machine, parts, values, is_open)


def _refuse_absent(names: Sequence[str], records: Sequence[DynamicRecord]) -> None:
    """Refuse names of models of which the file has no record: one that is misspelt would leave out nothing."""
    there = {record.name for record in records}
    for name in names:
        if name.upper() not in there:
            raise InputError(
                f"dyr_leave_out names {name!r}, of which the file has no record; "
                f"take it out, or choose from {', '.join(sorted(there))}"
            )


def _own_models(
    records: Sequence[DynamicRecord],
    names: Collection[str],
    bare: Collection[tuple[int, str]],
) -> set[str]:
    """Names of models that a generator is itself, which cannot be left out, among those that records have.

    ``bare``: machines without a record of one."""
    found = set()
    for name in (name for name in names if name not in RECORDS_OF_UNITS):
        own = [record for record in records if record.name == name]
        if own and is_own(name, own, bare):
            found.add(name)
    return found


def _machines_of(model: MissingModel) -> set[tuple[int, str]]:
    return {(record.bus, record.machine) for record in model.records}


def _left_out_of_plant(
    parts: Mapping[str, str], records: Sequence[DynamicRecord], left: Collection[str]
) -> Iterator[tuple[int, str]]:
    """Yield the line and the consequence of a plant's controller that the case leaves out."""
    for record in records:
        if record.name in OF_PLANTS and record.name in left and "electrical" in parts:
            yield (
                record.line,
                f"{record.name} left out, as dyr_leave_out says: the references are constant",
            )


def _converter(
    machine: Machine,
    parts: Mapping[str, str],
    names: Mapping[str, str],
    values: Mapping[str, float],
    elsewhere: bool,
) -> MachineModel:
    """The model of a converter; ``names``: of its records by kind; ``elsewhere``: whether its plant measures, or
    it holds a voltage, there."""
    own = dict(values)
    if "shaft" not in parts:
        own.pop(BY_SPEED, None)  # of a shaft that turns at rated speed
    if "electrical" in parts:
        model, made_of = plant_of(names, elsewhere=elsewhere)
    else:
        model, made_of = parts["converter"], {}
        if elsewhere:
            made_of = {"records": f"{names['converter']} {ELSEWHERE}"}
    of_source = SOURCE_IMPEDANCE.get(names["converter"], SOURCE_IMPEDANCE.get(model, ()))
    for name, value in zip(of_source, (machine.source.real, machine.source.imag), strict=False):
        own.setdefault(name, value)
    return MachineModel(made_of, own, model)


def _machine(
    machine: Machine, parts: Mapping[str, str], values: Mapping[str, float], partial: bool
) -> MachineModel:
    source = {"machine.R_s": machine.source.real}
    if parts["machine"] == CLASSICAL:
        source["machine.X_d1"] = machine.source.imag
    step_up = {"transformer.X_t": 0.0, "transformer.R_t": 0.0}  # the network has them
    made_of = {kind: part for kind, part in parts.items() if kind != "compensator"}
    return MachineModel(made_of, {**source, **values, **step_up}, partial=partial)
