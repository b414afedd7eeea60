"""PSS/E dynamics data (DYR): machines with their controls, and converters, of the generators of a RAW file."""

import dataclasses
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid_following.dyr_fields import CONVERTER, FIELDS, MODEL, PLANT, approximation
from fmus.regfm_a1.dyr_fields import REGFM_A1_RECORDS
from fmus.static_var.dyr_fields import STATIC_VAR_RECORDS
from fmus.synchronous_generator.dyr_fields import (
    DYR_RECORDS,
    SIGNALS_OF_BUSES,
    DyrField,
    DyrRecord,
)
from fmus.wecc_renewable.dyr_fields import PLANT_RECORDS
from orchestrator.cases.form.remedies import APPROXIMATING, replacement_of, without_models
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.psse.dyr_records import EVENT, DynamicRecord, given_values
from orchestrator.cases.networks.psse.missing_models import (
    OF_MACHINES,
    RESTS,
    MissingModel,
    in_words,
    is_own,
    is_resting,
    kind_of,
    missing_models,
)
from orchestrator.cases.networks.psse.raw import Machine, unit_labels
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord
from orchestrator.cases.networks.unit_row import DoubtOfRecord
from orchestrator.core.errors import InputError, few, first_of

_KNOWN = DYR_RECORDS | REGFM_A1_RECORDS | STATIC_VAR_RECORDS | PLANT_RECORDS
_COUPLED = {record.part for record in REGFM_A1_RECORDS.values()}
"""Models whose coupling impedance is ZSORCE of the network data."""

_OF_CONVERTERS = ("converter", "electrical", "plant")
"""Kinds of records that a converter is made of."""

MEASURING_ELSEWHERE = "regca1_repca1_remote_phasor"
"""The model of a plant whose controller measures at another point of the network."""

MANUAL = "manual"
"""The exciter without a regulator, on which neither a stabiliser nor a compensator acts."""

CLASSICAL = "classical"
WITHOUT_INERTIA = {"machine.H": 0.0, "machine.D": 0.0}
"""Parameters with which a classical machine is an infinite bus."""

COMPENSATION = ("exciter.R_C", "exciter.X_C")
"""Parameters of an exciter that a compensator's record sets."""

_PLACES = 4  # first values of REPCA1: the bus and the branch that are measured
_MOST_SHOWN = 20
_SAME = 1e-3  # part by which two figures for one reactance may differ: files round them

_STRANGE = (
    2  # machines that one file has alone, in each, from which on the files may be of two networks
)
_NAMED = 8  # buses that one problem names


@dataclass(frozen=True)
class MachineModel:
    """What a generator is made of, and the parameters that its records set; or the model of a converter.

    ``partial``: a record of it was left out, and the case says what stands for it. ``doubts`` are texts with the
    parameter and the place that they are about; ``replaced`` are lines of records that an approximation stands for,
    with what it leaves out; ``lines`` are the records' by parameter."""

    parts: Mapping[str, str]
    parameters: Mapping[str, float]
    converter: str | None = None
    doubts: tuple[DoubtOfRecord, ...] = ()
    replaced: tuple[tuple[int, str], ...] = ()
    partial: bool = False
    lines: Mapping[str, int] = dataclasses.field(default_factory=dict)
    measured: MeasuredPoint | None = None


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
    left = {name.upper() for name in leaving_out}
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
        if (record.bus, record.machine) not in there and record.name in _KNOWN
    ]
    for record in records:
        key = (record.bus, record.machine)
        if key in at:
            of[key].append(record)
        if key not in at or record.name in left or (approximate and record.name in FIELDS):
            continue
        known = None if approximate and record.name == PLANT else _KNOWN.get(record.name)
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
            try:
                values[key] |= (own := _values(record, known))
                lines[key] |= dict.fromkeys(own, record.line)
            except InputError as error:
                problems.append(str(error))
    for key in (key for key, machine in at.items() if machine.is_infinite and not of[key]):
        parts[key]["machine"] = CLASSICAL
        values[key] |= WITHOUT_INERTIA
    measured = _measured_points(of, parts, problems)
    following = _followed(of, left, problems, labels) if approximate else {}
    for key in following:
        parts[key]["converter"] = MODEL
    unmodelled = _without_machine(parts)
    passed = {*_KNOWN, *without, *(left - _own_models(records, left, unmodelled))}
    passed |= {*(FIELDS if approximate else ())}
    missing = missing_models(records, at, passed, unmodelled)
    lacking |= {key for model in missing for key in _machines_of(model) if not model.may_go}
    missing = [model for model in missing if model.may_go or not _machines_of(model) <= {*replaced}]
    accounted = {*replaced, *lacking}
    bare = [key for key in unmodelled if key not in accounted]
    places = {(record.bus, record.machine) for record in strange}
    if min(len(places), len(bare)) >= _STRANGE:
        problems = [_other_network(strange, records, bare, len(at)), *problems]
        strange = []
        accounted |= {*bare}
    unfit = _unfit(parts, accounted, labels)
    problems = [*(_may_be_meant(strange) if bare else ()), *problems, *unfit]
    if problems or missing:
        counted_once = [*_count_repeats(problems, first)]
        listed = first_of(counted_once, _MOST_SHOWN, "gfor new lists all with --details")
        shown = [*in_words(missing, labels), *listed]
        raise InputError(
            "the dynamics data cannot be taken over; correct them, or name models that may go in [units] "
            "dyr_leave_out:\n  " + "\n  ".join(shown)
        )
    open_ = {(record.bus, record.machine) for record in records if record.name in left}
    return following | {
        key: replace(
            _model(at[key], parts[key], values[key], key in open_, measured.get(key)),
            lines=lines[key],
            replaced=tuple(_left_out_of_plant(parts[key], of[key], left)),
            measured=measured.get(key),
            doubts=tuple(_doubts(at[key], of[key], values[key])),
        )
        for key in at
        if {"machine", "converter"} & {*parts[key]} and key not in following
    }


def _own_models(
    records: Sequence[DynamicRecord],
    names: Collection[str],
    bare: Collection[tuple[int, str]],
) -> set[str]:
    """Names of models that a generator is itself, which cannot be left out, among those that records have.

    ``bare``: machines without a record of one."""
    found = set()
    for name in (name for name in names if name not in _KNOWN):
        own = [record for record in records if record.name == name]
        if own and is_own(name, own, bare):
            found.add(name)
    return found


def _machines_of(model: MissingModel) -> set[tuple[int, str]]:
    return {(record.bus, record.machine) for record in model.records}


def _count_repeats(problems: Sequence[str], first: Mapping[str, str]) -> Iterator[str]:
    """The problems, each once: of those with a place of a first record, how many more there are."""
    for text, count in Counter(problems).items():
        more = f" and {count - 1} more" if count > 1 else ""
        yield f"{first[text]}{more}: {text}" if text in first else text


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
    return [
        RecordUse(
            record.file,
            record.line,
            record.name,
            *(
                (UseOfRecord.NOT_USED, "a converter of ours replaces its machine", False)
                if (record.bus, record.machine) in ours
                else _use_of(record, machines, idle, left, approximate, excited)
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
) -> tuple[UseOfRecord, str, bool]:
    """Return what became of a record, why, and whether it is of no machine."""
    key = record.bus, record.machine
    if key in machines:
        if record.name in left:
            return UseOfRecord.NOT_USED, "dyr_leave_out names it", False
        if is_resting(record.name):
            return UseOfRecord.NOT_USED, RESTS, False
        if key not in excited and kind_of(record.name) in ("stabilizer", "compensator"):
            return UseOfRecord.NOT_USED, "its machine has no exciter", False
        stand_in = f"approximated as {MODEL}" if approximate and record.name in FIELDS else ""
        return UseOfRecord.USED, stand_in, False
    if key in idle:
        return UseOfRecord.NOT_USED, "its machine is out of service", False
    if record.name == EVENT:
        told = f"an event of ANDES, of {record.machine}; [scenarios] has events"
        return UseOfRecord.NOT_USED, told, False
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


def _unfit(
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    replaced: Collection[tuple[int, str]],
    labels: Mapping[tuple[int, str], str],
) -> Iterator[str]:
    """Machines whose records are too many or too few; ``labels`` are of their units."""
    for (bus, name), own in parts.items():
        if (bus, name) not in replaced:
            yield from _incomplete(f"machine {name!r} at bus {bus}", own, labels[bus, name])
        others = ", ".join(kind for kind in own if kind not in _OF_CONVERTERS)
        if "converter" in own and others:
            yield f"machine {name!r} at bus {bus} is a converter, and has records of its {others}; remove them"
    for bus, name in _without_machine(parts):
        if (bus, name) not in replaced:
            yield (
                f"machine {name!r} at bus {bus} has no record of a machine; add one, or write "
                f"{replacement_of(labels[bus, name])}, and a converter of ours stands there"
            )


def _measured_points(
    of: Mapping[tuple[int, str], Sequence[DynamicRecord]],
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    problems: list[str],
) -> dict[tuple[int, str], MeasuredPoint]:
    """Return where the controllers of plants measure that do not at their own terminal."""
    found: dict[tuple[int, str], MeasuredPoint] = {}
    for key, record in ((key, r) for key, own in of.items() for r in own if r.name == PLANT):
        if "plant" in parts[key] and len(record.values) >= _PLACES:
            try:
                point = _measured_point(record, key[0])
            except InputError as error:
                problems.append(str(error))
                continue
            found |= {key: point} if point is not None else {}
    return found


def _measured_point(record: DynamicRecord, own_bus: int) -> MeasuredPoint | None:
    """Return where a plant's controller measures; None at its own terminal."""
    numbers = []
    for name, text in zip(("BUSR", "BUS1", "BUS2"), record.values, strict=False):
        if not re.fullmatch(r"\d{1,9}", text):
            raise InputError(
                f"{record.place}: {record.name} has {name} = {text!r}; it must be the number of a bus, or 0"
            )
        numbers.append(int(text))
    bus, near, far = numbers
    if bool(near) != bool(far):
        raise InputError(
            f"{record.place}: {record.name} has BUS1 = {near} and BUS2 = {far}; give both ends of it, or 0 twice"
        )
    found = MeasuredPoint(
        0 if bus == own_bus else bus, near, far, record.values[3].strip(), record.place
    )
    return None if found.is_own else found


def _incomplete(machine: str, own: Mapping[str, str], unit: str) -> Iterator[str]:
    """Yield what the records of one of WECC's plants lack; ``unit``: the label of its unit."""
    needs = own.get("converter") == PLANT_RECORDS[CONVERTER].part
    if needs == ("electrical" in own) and (needs or "plant" not in own):
        return
    there = " and ".join(kind for kind in _OF_CONVERTERS if kind in own)
    missing = "REECA1 or REECB1" if needs else CONVERTER
    yield (
        f"{machine} has records of its {there} and no {missing}: together they are a plant of WECC's generic models; "
        f"add it, or write {replacement_of(unit)}, and a converter of ours stands there"
    )


def _left_out_of_plant(
    parts: Mapping[str, str], records: Sequence[DynamicRecord], left: Collection[str]
) -> Iterator[tuple[int, str]]:
    """Yield the line and the consequence of a plant's controller that the case leaves out."""
    for record in records:
        if record.name == PLANT and PLANT in left and "electrical" in parts:
            yield (
                record.line,
                f"{PLANT} left out, as dyr_leave_out says: the references are constant",
            )


def _without_machine(
    parts: Mapping[tuple[int, str], Mapping[str, str]],
) -> list[tuple[int, str]]:
    """Machines in service with neither a machine's record nor a converter's."""
    return [key for key, own in parts.items() if not {"machine", "converter"} & {*own}]


def _other_network(
    strange: Sequence[DynamicRecord],
    records: Sequence[DynamicRecord],
    bare: Sequence[tuple[int, str]],
    machines: int,
) -> str:
    """One problem for two files that do not belong together, with what each has alone."""
    places = dict.fromkeys((record.bus, record.machine) for record in strange)

    def names_of(keys: Iterable[tuple[int, str]]) -> str:
        return few((f"{bus} {name!r}" for bus, name in keys), _NAMED)

    known = sum(record.name in _KNOWN for record in records)
    return (
        f"{strange[0].file} and the RAW file do not belong together, as it seems: {len(strange)} of {known} records of "
        f"machines stand at buses or identifiers that the RAW file has no generator at ({names_of(places)}; first "
        f"{strange[0].name} in line {strange[0].line}), and {len(bare)} of {machines} machines have no record "
        f"({names_of(bare)}): give the DYR file of this network; if it is that one, correct these buses, "
        "or remove the records"
    )


def _may_be_meant(strange: Sequence[DynamicRecord]) -> Iterator[str]:
    """Yield one problem with the machines that the RAW file lacks, where another machine has no record: a slip."""
    own = [record for record in strange if _KNOWN[record.name].kind in ("machine", "converter")]
    if own:
        named = (
            f"{record.name} of machine {record.machine!r} at bus {record.bus}" for record in own
        )
        yield (
            f"{own[0].place}: the RAW file does not have {few(named, _NAMED)}; if one of them is meant for a machine "
            "without a record, correct its bus or identifier"
        )


def _followed(
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


def _doubts(
    machine: Machine, records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    yield from _omissions(records)
    yield from _chosen_limits(records)
    x_d2, x_source = values.get("machine.X_d2"), machine.source.imag
    if x_d2 is None or abs(x_source - x_d2) <= _SAME * abs(x_d2):
        return
    record = next(record for record in records if "machine.X_d2" in _sets(record.name))
    text = (
        f"{record.name} has X''d = {x_d2:g} pu, and the RAW file has ZX = {x_source:g} pu of the same machine in line "
        f"{machine.line}; PSS/E wants one figure in both, and X''d counts here; correct the one that is wrong"
    )
    yield DoubtOfRecord("machine.X_d2", record.place, text, "X''d unlike ZX of the RAW file")


def _omissions(records: Sequence[DynamicRecord]) -> Iterator[DoubtOfRecord]:
    """Return what a part of ours leaves out of its record, by the fields that ask for it."""
    for record in records:
        known = _KNOWN.get(record.name)
        if known is None or not known.omissions:
            continue
        given = given_values(record, known.fields, {*_KNOWN, *FIELDS})
        for name, text in known.omissions.items():
            if given[name]:
                said = f"{record.name} has {name} = {given[name]:g}: {text}"
                kind = f"{record.name} without {name}"
                yield DoubtOfRecord(known.kind, record.place, said, kind)


def _sets(name: str) -> set[str]:
    return {
        p for field in (_KNOWN[name].fields if name in _KNOWN else ()) for p in field.parameters
    }


def _model(
    machine: Machine,
    parts: Mapping[str, str],
    values: Mapping[str, float],
    partial: bool,
    measured: MeasuredPoint | None,
) -> MachineModel:
    if "converter" in parts:
        own = dict(values)
        if parts["converter"] in _COUPLED:
            own = {"RL": machine.source.real, "XL": machine.source.imag, **values}
        model = parts.get("plant", parts["converter"])
        return MachineModel({}, own, MEASURING_ELSEWHERE if measured is not None else model)
    source = {"machine.R_s": machine.source.real}
    if parts["machine"] == CLASSICAL:
        source["machine.X_d1"] = machine.source.imag
    step_up = {"transformer.X_t": 0.0, "transformer.R_t": 0.0}  # the network has them
    made_of = {kind: part for kind, part in parts.items() if kind != "compensator"}
    return MachineModel(made_of, {**source, **values, **step_up}, partial=partial)


_BUS = "BUSR"
"""Field of a converter's control that names a bus; 0 and the machine's own are its terminal."""


def _refuse_choice(record: DynamicRecord, field: DyrField, value: float) -> None:
    """Refuse a value that our part cannot stand for."""
    if field.name == _BUS:
        if value == record.bus:
            return
        raise InputError(
            f"{record.place}: {record.name} has {_BUS} = {value:g}: its control measures at another bus than its "
            f"terminal, which no part of ours does; write {_BUS} = 0 for the terminal, or {APPROXIMATING} for {MODEL}"
        )
    allowed = " or ".join(f"{x:g}" for x in field.only)
    raise InputError(
        f"{record.place}: {record.name} has {field.name} = {value:g}; only {allowed} can be modelled"
    )


_CEILING, _FLOOR = "VRMAX", "VRMIN"
"""Fields of an exciter's record with the limits of its regulator."""


def _chosen_ceiling(known: DyrRecord, given: Mapping[str, float]) -> float:
    """Return VRMAX that PSS/E chooses for a shaft's exciter that gives none [pu]; 0 where it is no such exciter.

    It holds the field voltage E2: SE(E2)·E2, with KE·E2 where KE exceeds 0. Sources: OpenIPSL
    (`calculate_dc_exciter_params.mo`), which leaves the factor E2 out where KE exceeds 0; IEEE 421.5."""
    choosing = any(field.name == "KE" and field.zero_sets for field in known.fields)
    if not choosing or given.get(_CEILING) != 0:
        return 0.0
    return (max(given["KE"], 0.0) + given["SE(E2)"]) * given["E2"]


def _read_numbers(record: DynamicRecord, known: DyrRecord) -> dict[str, float]:
    """Return the numbers of a record, with the limits that PSS/E chooses."""
    given = given_values(record, known.fields, {*_KNOWN, *FIELDS})
    ceiling = _chosen_ceiling(known, given)
    if ceiling > 0:
        given |= {_CEILING: ceiling, _FLOOR: -ceiling}
    return given


def _chosen_limits(records: Sequence[DynamicRecord]) -> Iterator[DoubtOfRecord]:
    """Ask about the limits that PSS/E chooses."""
    for record in (record for record in records if record.name in DYR_RECORDS):
        known = DYR_RECORDS[record.name]
        given = given_values(record, known.fields, {*_KNOWN, *FIELDS})
        ceiling = _chosen_ceiling(known, given)
        if ceiling <= 0:
            continue
        text = (
            f"{record.name} has {_CEILING} = 0, for which PSS/E chooses limits that hold the field voltage E2: "
            f"{_CEILING} = -{_FLOOR} = {ceiling:.4g} pu is taken"
        )
        if given["KE"] == 0:
            text += (
                ", and KE = 0 is such that V_R starts at a tenth of it, which moves modes (ANDES has no ceiling and "
                "KE = 0 there)"
            )
        kind = f"limits of {record.name} that PSS/E chooses"
        yield DoubtOfRecord("exciter.V_RMAX", record.place, text, kind)


def _values(record: DynamicRecord, known: DyrRecord) -> dict[str, float]:
    given = _read_numbers(record, known)
    found = dict.fromkeys(known.lacks, 0.0) | dict.fromkeys(known.without, False)
    for field in (field for field in known.fields if not field.is_text):
        value = given[field.name]
        if field.nothing_without and given[field.nothing_without] == 0:
            value = 0.0
        if field.only and value not in field.only:
            _refuse_choice(record, field, value)
        if (
            field.bus_of
            and value not in (0, record.bus)
            and given[field.bus_of] in SIGNALS_OF_BUSES
        ):
            raise InputError(
                f"{record.place}: {record.name} has {field.name} = {value:g}: its signal, {field.bus_of} = "
                f"{given[field.bus_of]:g}, is taken at another bus than the machine's own, which no part of ours does; "
                f"write {field.name} = 0 for the own bus, or {without_models([record.name])}, and no {record.name} acts"
            )
        if field.same_as and value != given[field.same_as]:
            raise InputError(
                f"{record.place}: {record.name} has {field.name} = {value:g} and {field.same_as} = "
                f"{given[field.same_as]:g}; our part has one value for both"
            )
        if field.not_zero and value == 0:
            raise InputError(
                f"{record.place}: {record.name} has {field.name} = 0, which PSS/E replaces; give its value"
            )
        if field.zero_sets:
            found[field.zero_sets] = value == 0
        product = (
            bool(value) if field.switch else value * given[field.times] if field.times else value
        )
        found |= dict.fromkeys(field.parameters, product) | dict.fromkeys(field.negated, -product)
    return found


_FAMILIES = ("REGC", "REEC", "REPC", "WTG", "WT4", "WT3", "PVGU", "PVEU", "PLNTB")
"""How the names of grid-following converters and their controls begin."""


def remedy_for(name: str, unit: str, *, approximate: bool) -> str:
    """Return what to do about a record that no part stands for; empty where it is of no grid-following converter.

    ``unit``: label of its machine's unit."""
    if not name.startswith(_FAMILIES):
        return ""
    if name == PLANT:
        return (
            f", the controller of a plant; write {without_models([PLANT])}, and the references of its "
            "converter are constant"
        )
    if approximate or name not in FIELDS:
        return f", a grid-following converter; write {replacement_of(unit)}, and a converter of ours stands there"
    return (
        f", a grid-following converter; write {APPROXIMATING} for {MODEL} in its place, with a list of what that "
        f"leaves out, or {replacement_of(unit)}, and a converter of ours stands there"
    )


# -- WECC's grid-following converters as the phasor converter, at the user's word --------------------


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
            raise InputError(
                f"{record.place}: a second {record.name} of machine {record.machine!r} at bus {record.bus}"
            )
        fields = tuple(DyrField(name) for name in FIELDS[record.name])
        values[record.name] = given_values(record, fields, FIELDS)
    try:
        parameters, texts = approximation(values)
    except ValueError as error:
        raise InputError(
            f"{own[0].place}: the converter at bus {own[0].bus} cannot be approximated: {error}; write "
            f"{replacement_of(unit)}, and a converter of ours stands there"
        ) from None
    replaced = [(own[0].line, text) for text in texts]
    for record in (record for record in records if record.name == PLANT and PLANT in left):
        replaced.append(
            (record.line, f"{PLANT} left out, as dyr_leave_out says: the references are constant")
        )
    return parameters, replaced
