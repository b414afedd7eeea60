"""Composite loads of CMLDBLU1 and CMLDBLU2 (WECC's CMPLDW), approximated: motors A to C, and the rest as a load with a
law.

Each of the motors A to C with three phases is an induction machine with the record's reactances and time constants, and
draws its share of the load's P and Q; a susceptance is beside it. Motor D is air conditioners while they run
(`air_conditioners`), the electronic load draws constant powers, and the static load follows its exponents and its
frequency. Left out: the transformer and the feeder before the load, tripping and stalling, and what distributed
generation the record has.

Source: WECC, "Composite Load Model for Dynamic Simulations" (2012); the order of the fields as parsers of PSS/E's files
have it (InterPSS, and GridPACK for CMLDBLU1; a public script that writes both)."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan

from fmus.grid.element_data import LAWS, Load, Zip
from fmus.induction_machine.dyr_records import SUBSYSTEMS
from orchestrator.cases.form.remedies import without_models
from orchestrator.cases.networks.conversion import bus_of
from orchestrator.cases.networks.psse.air_conditioners import FIELDS, running_law
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, number_in
from orchestrator.cases.networks.psse.load_records import (
    RecordedLaw,
    mean_of_laws,
    mixture,
)
from orchestrator.cases.networks.psse.motor_loads import MotorLoad
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import RecordsOfLoads
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few, number_of

_NUMBERS = {"U2": 133, "U1": 132}
"""How many numbers a record has behind those that describe a user's model, by the end of its name: CMLDBLU2 of PSS/E 35
has one more than CMLDBLU1, at its end."""

COMPOSITE_NAMES = tuple(
    f"CMLD{subsystem}{edition}" for edition in _NUMBERS for subsystem in SUBSYSTEMS
)
"""The records, those of one edition together, and of these the narrower first."""
MODEL = "induction_generator_phasor"  # the machine by its reactances
_SHARES = slice(18, 23)  # of motors A to D and of the electronic load
_D = 3  # place of motor D among them
_SUM_OF_PERCENT = 2.0
"""Sum of the shares [pu] above which they are in percent, as it seems."""

_COUNTS = 7
"""How many whole values describe a user's model: two codes, and the counts of ICONs, CONs, states, variables and
reserved ICONs."""

_ICONS = 2  # place of the number of whole values behind these seven
_CONS = 3  # place of the number of the other values
_HIGHEST_REACTANCE = 1
"""Reactance of a feeder [pu], which stands in the place of the number of CONs where nothing describes the model."""

_STATIC = slice(27, 37)  # exponent and share, twice, and factor of the frequency: of P, then of Q
_MOTORS = {"a": 37, "b": 57, "c": 77}  # place of each motor's numbers
_AIR_CONDITIONER = slice(97, 97 + len(FIELDS))  # motor D
_OF_MOTOR = ("RA", "X", "Xp", "Xpp", "Tp", "Tpp", "H", "E")  # behind its type and its loading
_THREE_PHASES = 3.0
_ONE_PHASE = 1.0
LEAKAGE = 0.8
"""Leakage by subtransient reactance: the record has none, and the model's equations leave it out."""
_SHOWN = 8
_NO_LETTER = re.compile(r"\W")


@dataclass(frozen=True)
class CompositeLoads:
    """Motors of composite loads, and the laws of what is left, by the name of the case's load."""

    motors: tuple[MotorLoad, ...]
    laws: Mapping[str, RecordedLaw]
    records: tuple[DynamicRecord, ...]


def composite_loads(
    records: Sequence[DynamicRecord], file_loads: Sequence[FileLoad], loads: Sequence[Load]
) -> CompositeLoads:
    """Return the motors and the laws of the loads that draw power and that a record names."""
    elements = {load.name: load for load in loads}
    at_bus = Counter(load.bus for load in file_loads)
    motors: list[MotorLoad] = []
    rests: dict[str, list[tuple[FileLoad, float, RecordedLaw]]] = {}
    of_loads = RecordsOfLoads(records)
    used, refusals = list[DynamicRecord](), Refusals()
    for load in file_loads:
        record = _record_for(load, of_loads)
        if record is None or load.load not in elements or not load.drawn.real > 0:
            continue
        with refusals.keep():
            numbers = _numbers(record)
            bus = elements[load.load].bus
            own = list(_motors(load, record, numbers, bus, at_bus[load.bus] > 1))
            motors += own
            used.append(record)
            left = 1 - sum(motor.drawn.real for motor in own) / load.drawn.real
            law = _law(load, record, numbers, left)
            rests.setdefault(load.load, []).append((load, left, law))
    refusals.tell()
    laws = {name: _law_of_all(elements[name], own) for name, own in rests.items()}
    return CompositeLoads(tuple(motors), laws, tuple(dict.fromkeys(used)))


def composite_remarks(found: CompositeLoads) -> Iterator[Problem]:
    """Tell what stands for composite loads."""
    for name in dict.fromkeys(record.name for record in found.records):
        own = [motor for motor in found.motors if motor.record.name == name]
        place = next(record.place for record in found.records if record.name == name)
        p_mw = sum(motor.drawn.real for motor in own)
        buses = few(dict.fromkeys(bus_of(str(motor.load.bus)) for motor in own), _SHOWN)
        of_motors = (
            f"{number_of(len(own), 'induction motor')} A to C for {p_mw:.4g} MW ({buses})"
            if own
            else "none of motors A to C draws power"
        )
        text = (
            f"{name}, a composite load, is approximated: {of_motors}, motor D by what it draws while it runs, the "
            "electronic load as a constant power, the static load by its exponents. The transformer and the feeder "
            "before it, tripping and stalling are left out; to see what that is worth, leave it out: "
            f"dyr_leave_out = ['{name}'] in [units]"
        )
        yield Problem(place, text, topic=QuestionTopic(f"{name} approximated"))
    for record in found.records:
        yield from _of_types(record)


def _of_types(record: DynamicRecord) -> Iterator[Problem]:
    """Ask about motors A to C that draw power and are of a type that there is not."""
    numbers = _numbers(record)
    for (letter, at), share in zip(_MOTORS.items(), numbers[_SHARES], strict=False):
        if share and numbers[at] not in (_THREE_PHASES, _ONE_PHASE):
            text = (
                f"{record.name} has the type {numbers[at]:g} of motor {letter.upper()}, which draws {share:g} of the "
                "load; there are 3, of three phases, and 1, of one. It is taken as a constant power; correct the type"
            )
            topic = QuestionTopic("a motor of no known type", record.name)
            yield Problem(record.place, text, topic=topic)


def _record_for(load: FileLoad, records: RecordsOfLoads) -> DynamicRecord | None:
    """Return the record that names a load; of two editions the newer goes first."""
    for edition in _NUMBERS:
        names = [name for name in COMPOSITE_NAMES if name.endswith(edition)]
        record = records.first(load, names)
        if record is not None:
            return record
    return None


def _numbers(record: DynamicRecord) -> list[float]:
    wanted = next(count for edition, count in _NUMBERS.items() if record.name.endswith(edition))
    numbers = [number_in(text) for text in _texts(record, wanted)]
    if any(map(isnan, numbers)):
        at = next(k for k, number in enumerate(numbers) if isnan(number))
        text = record.values[len(record.values) - wanted + at]
        raise InputError.at(
            record.place,
            f"{record.name} has {text!r} as number {at + 1} of its {wanted}; it must be a number",
        )
    shares = numbers[_SHARES]
    if min(shares) < 0 or sum(shares) > 1 + 1e-6:
        told = ", ".join(f"{share:g}" for share in shares)
        ask = "; are they in percent?" if sum(shares) > _SUM_OF_PERCENT else ""
        raise InputError.at(
            record.place,
            f"{record.name} has the shares {told} of motors A to D and the electronic load; each is "
            f"0 or more, and their sum 1 at most{ask}",
        )
    return numbers


def _texts(record: DynamicRecord, wanted: int) -> Sequence[str]:
    """Return the texts of a record's numbers, as many as it needs and as those before them declare.

    Raises
    ------
    InputError
        If there are others: by their end alone all would be taken for their neighbours.
    """
    texts, counts = record.values, record.values[:_COUNTS]
    remedy = f"correct the record, or write {without_models([record.name])}"
    if not _are_counts(counts):
        if len(texts) == wanted:
            return texts
        raise InputError.at(
            record.place,
            f"{record.name} has {number_of(len(texts), 'value')} behind its name; it ends with {wanted} numbers, "
            f"behind the {_COUNTS} whole ones of a user's model where it is written as USRLOD; {remedy}",
        )
    declared, before = int(counts[_CONS]), _COUNTS + int(counts[_ICONS])
    if declared != wanted:
        fit = next((edition for edition, count in _NUMBERS.items() if count == declared), None)
        other = f", as {record.name[: -len('U1')]}{fit} has" if fit else ""
        raise InputError.at(
            record.place,
            f"{record.name} declares {declared} numbers{other}, and needs {wanted}; {remedy}",
        )
    there = len(texts) - before
    if there != wanted:
        raise InputError.at(
            record.place,
            f"{record.name} has {number_of(max(there, 0), 'number')} behind the {before} values that describe it, "
            f"where {declared} are declared; {remedy}",
        )
    return texts[before:]


def _are_counts(texts: Sequence[str]) -> bool:
    """Return whether values describe a user's model."""
    whole = len(texts) == _COUNTS and all(text.isdigit() for text in texts)
    return whole and int(texts[_CONS]) > _HIGHEST_REACTANCE


def _motors(
    load: FileLoad, record: DynamicRecord, numbers: Sequence[float], bus: str, is_named: bool
) -> Iterator[MotorLoad]:
    own = f"_{_NO_LETTER.sub('_', load.name)}" if is_named else ""
    for (letter, at), share in zip(_MOTORS.items(), numbers[_SHARES], strict=False):
        kind, loading, *of_motor = numbers[at : at + 2 + len(_OF_MOTOR)]
        if not share or kind != _THREE_PHASES:
            continue
        if not loading > 0:
            raise InputError(
                f"{record.place}: {record.name} has the loading LFm = {loading:g} of motor {letter.upper()}; it must "
                "exceed 0"
            )
        drawn = share * load.drawn
        rating = drawn.real / loading
        parameters = dict(zip(_OF_MOTOR, of_motor, strict=True))
        parameters |= {"Xl": LEAKAGE * (parameters["Xpp"] or parameters["Xp"]), "S_n": rating}
        parameters |= {"P_0": -drawn.real / rating, "Q_0": -drawn.imag / rating}
        name = f"motor{load.bus}{own}_{letter}"
        yield MotorLoad(name, bus, MODEL, parameters, load, record, drawn=drawn)


def _law(
    load: FileLoad, record: DynamicRecord, numbers: Sequence[float], left: float
) -> RecordedLaw:
    """The law of what no motor A to C draws: the static load, which has the rest of the shares, motor D, constants."""
    place = (record.file, record.line)
    static = max(0.0, 1 - sum(numbers[_SHARES]))
    of_p, of_q = numbers[_STATIC][:5], numbers[_STATIC][5:]
    laws = [RecordedLaw(place, _static(of_p), _static(of_q), of_p[4], of_q[4])]
    shares = [static]
    of_d = numbers[_SHARES][_D]
    if of_d:
        running = running_law(record, numbers[_AIR_CONDITIONER], of_d * load.drawn, load.v_pu)
        laws.append(
            RecordedLaw(place, running.active, running.reactive, running.k_pf, running.k_qf)
        )
        shares.append(of_d)
    constant = max(0.0, left - sum(shares))
    laws.append(RecordedLaw(place, LAWS["power"], LAWS["power"], 0.0, 0.0))
    shares.append(constant)
    return mean_of_laws(laws, [complex(share, share) for share in shares])


def _static(numbers: Sequence[float]) -> Zip:
    """The law of a static load; what both shares leave is a constant power."""
    first, of_first, second, of_second, _ = numbers
    return mixture((of_first, of_second, 1 - of_first - of_second), (first, second, 0.0), 1.0)


def _law_of_all(element: Load, own: Sequence[tuple[FileLoad, float, RecordedLaw]]) -> RecordedLaw:
    """The law of one element of the case; loads beside at its bus keep theirs."""
    parts = [(left * load.drawn, law) for load, left, law in own]
    others = complex(element.p_mw, element.q_mvar) - sum(load.drawn for load, _, _ in own)
    if abs(others) > 1e-6:
        place = own[0][2].place
        law = RecordedLaw(place, element.active, element.reactive, element.k_pf, element.k_qf)
        parts.append((others, law))
    powers, laws = zip(*parts, strict=True)
    return mean_of_laws(laws, powers)
