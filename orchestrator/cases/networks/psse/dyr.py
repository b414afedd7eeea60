"""PSS/E dynamics data (DYR): machines with their controls, and converters, of the generators of a RAW file."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_mistakes import (
    LEAST_STRANGE,
    count_repeats,
    other_network,
    records_unfit,
    remedy_for,
    slips,
    without_machine,
)
from orchestrator.cases.networks.psse.following_converters import models_of_following
from orchestrator.cases.networks.psse.limiter_records import place_limiters
from orchestrator.cases.networks.psse.machine_model import (
    BY_SPEED,
    CLASSICAL,
    KNOWN_RECORDS,
    OF_PLANTS,
    SOURCE_IMPEDANCE,
    WITHOUT_INERTIA,
    MachineModel,
    plant_of,
)
from orchestrator.cases.networks.psse.missing_models import (
    MissingModel,
    in_words,
    is_own,
    kind_of,
    missing_models,
    names_load,
)
from orchestrator.cases.networks.psse.plant_points import measured_points
from orchestrator.cases.networks.psse.raw_network import Machine, unit_labels
from orchestrator.cases.networks.psse.record_doubts import doubts_of_machine
from orchestrator.cases.networks.psse.record_values import values_of_record
from orchestrator.core.errors import InputError, first_of
from orchestrator.core.options import Option

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
    at = {(machine.bus, machine.name.strip()): machine for machine in machines}
    problems: list[str] = []
    parts: dict[tuple[int, str], dict[str, str]] = {key: {} for key in at}
    values: dict[tuple[int, str], dict[str, float]] = {key: {} for key in at}
    lines: dict[tuple[int, str], dict[str, int]] = {key: {} for key in at}
    names: dict[tuple[int, str], dict[str, str]] = {key: {} for key in at}
    left = {name.upper() for name in leaving_out}
    _refuse_absent(leaving_out, records)
    # a load may have the identifier of the machine at its bus
    records = [record for record in records if not names_load(record.name)]
    labels = unit_labels(machines)
    of: dict[tuple[int, str], list[DynamicRecord]] = {key: [] for key in at}
    # machines whose own record no part stands for
    lacking: set[tuple[int, str]] = set()
    without: set[str] = set()  # names of converters' records, which have a remedy of their own
    first: dict[str, str] = {}  # place of the first record, by the problem
    there = {*at, *idle}
    strange = [
        record
        for record in records
        if (record.bus, record.machine) not in there and record.name in KNOWN_RECORDS
    ]
    for record in records:
        key = (record.bus, record.machine)
        if key in at:
            of[key].append(record)
        if key not in at or record.name in left or (approximate and record.name in FIELDS):
            continue
        is_left = approximate and record.name in OF_PLANTS
        known = None if is_left else KNOWN_RECORDS.get(record.name)
        if known is None:
            remedy = remedy_for(record.name, labels[key], approximate=approximate)
            if remedy:
                problems.append(f"no part of ours stands for {record.name}{remedy}")
                first.setdefault(problems[-1], record.place)
                without.add(record.name)
                lacking |= {key} if kind_of(record.name) == "converter" else set()
        elif known.kind in parts[key]:
            problems.append(
                f"{record.place}: a second {known.kind} of machine {record.machine!r} at bus {record.bus}"
            )
        else:
            parts[key][known.kind] = known.part
            names[key][known.kind] = record.name
            try:
                own = values_of_record(record, known)
                values[key] |= own
                lines[key] |= dict.fromkeys(own, record.line)
            except InputError as error:
                problems.append(str(error))
    place_limiters([] if problems else records, left, parts, values)
    for key in (key for key, machine in at.items() if machine.is_infinite and not of[key]):
        parts[key]["machine"] = CLASSICAL
        values[key] |= WITHOUT_INERTIA
    measured = measured_points(of, parts, problems)
    following = models_of_following(of, left, problems, labels) if approximate else {}
    for key in following:
        parts[key]["converter"] = MODEL
    unmodelled = without_machine(parts)
    passed = {*KNOWN_RECORDS, *without, *(left - _own_models(records, left, unmodelled))}
    passed |= {*(FIELDS if approximate else ())}
    missing = missing_models(records, at, passed, unmodelled)
    lacking |= {key for model in missing for key in _machines_of(model) if not model.may_go}
    missing = [model for model in missing if model.may_go or not _machines_of(model) <= {*replaced}]
    accounted = {*replaced, *lacking}
    bare = [key for key in unmodelled if key not in accounted]
    places = {(record.bus, record.machine) for record in strange}
    if min(len(places), len(bare)) >= LEAST_STRANGE:
        problems = [other_network(strange, records, bare, len(at)), *problems]
        strange = []
        accounted |= {*bare}
    unfit = records_unfit(parts, accounted, labels)
    problems = [*(slips(strange) if bare else ()), *problems, *unfit]
    if problems or missing:
        counted_once = [*count_repeats(problems, first)]
        listed = first_of(counted_once, _MOST_SHOWN, ("gfor new lists all with " + Option.DETAILS))
        shown = [*in_words(missing, labels), *listed]
        raise InputError(
            "the dynamics data cannot be taken over; correct them, or name models that may go in [units] "
            "dyr_leave_out:\n  " + "\n  ".join(shown)
        )
    open_ = {(record.bus, record.machine) for record in records if record.name in left}
    return following | {
        key: replace(
            _converter(at[key], parts[key], names[key], values[key], key in measured)
            if "converter" in parts[key]
            else _machine(at[key], parts[key], values[key], key in open_),
            lines=lines[key],
            replaced=tuple(_left_out_of_plant(parts[key], of[key], left)),
            measured=measured.get(key),
            doubts=tuple(doubts_of_machine(at[key], of[key], values[key])),
        )
        for key in at
        if {"machine", "converter"} & {*parts[key]} and key not in following
    }


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
    for name in (name for name in names if name not in KNOWN_RECORDS):
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
    """The model of a converter; ``names``: of its records by kind; ``elsewhere``: whether its plant measures there."""
    own = dict(values)
    if "shaft" not in parts:
        own.pop(BY_SPEED, None)  # of a shaft that turns at rated speed
    if "electrical" in parts:
        model, made_of = plant_of(names, elsewhere=elsewhere)
    else:
        model, made_of = parts["converter"], {}
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
