"""Loads that are induction motors by their records CIM5, CIM6 and CIMW of dynamics data.

A record stands for the whole load. The motor draws the load's active power of the power flow; what its reactive power
differs by is a susceptance beside it. With MBASE = 0 its rating is PMULT times the load's MW."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid.element_data import Load
from fmus.induction_machine.dyr_records import MOTOR_RECORDS, SUBSYSTEMS
from fmus.toolchain.dyr_form import DyrRecord
from orchestrator.cases.networks.conversion import bus_of
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, number_of_field
from orchestrator.cases.networks.psse.dyr_values import values_of_record
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import RecordsOfLoads
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few, number_of
from orchestrator.core.units import whole_percent

MOTOR_NAMES = {
    f"{model}{subsystem}": record
    for model, record in MOTOR_RECORDS.items()
    for subsystem in SUBSYSTEMS
}
"""The records by their whole names."""

_NO_LETTER = re.compile(r"\W")
_SHOWN = 8  # buses that a remark names; the others are counted
_NEGLIGIBLE = 1e-6  # power [MW, Mvar] of a load of which nothing is left
_SATURATION = ("SE1", "SE2")

_LEAST_LOADING = 0.3
"""Active power [pu of its rating] below which a motor's loading is far from usual."""

_MOST_LOADING = 1.3
"""The same above which it is."""

_USUAL_LOADING = 0.8
"""Active power [pu of its rating] of a usual motor, by which a rating is proposed."""


@dataclass(frozen=True)
class MotorLoad:
    """A motor in the place of a load: its component's name, its bus, its model, and its parameters.

    ``load``: the file's load; ``record``: the record that stands for it; ``drawn``: the motor's part of it [MW,
    Mvar]."""

    name: str
    bus: str
    model: str
    parameters: Mapping[str, float]
    load: FileLoad
    record: DynamicRecord
    drawn: complex


def motor_loads(
    records: Sequence[DynamicRecord], file_loads: Sequence[FileLoad], loads: Sequence[Load]
) -> list[MotorLoad]:
    """Return a motor for each load that draws power and that a record names.

    Raises
    ------
    InputError
        If records have a value that cannot be, or give no rating; with all of them.
    """
    buses = {load.name: load.bus for load in loads}
    at_bus = Counter(load.bus for load in file_loads)
    of_loads = RecordsOfLoads(records)
    found, refusals = list[MotorLoad](), Refusals()
    for load in file_loads:
        record = _record_for(load, of_loads)
        if record is None or load.load not in buses or not load.drawn.real > 0:
            continue
        own = f"_{_NO_LETTER.sub('_', load.name)}" if at_bus[load.bus] > 1 else ""
        known = MOTOR_NAMES[record.name]
        name = f"motor{load.bus}{own}"
        at = buses[load.load]
        with refusals.keep():
            own_values = _parameters(record, known, load)
            motor = MotorLoad(name, at, known.part, own_values, load, record, drawn=load.drawn)
            found.append(motor)
    refusals.tell()
    return found


def loads_without(loads: Sequence[Load], motors: Sequence[MotorLoad]) -> Iterator[Load]:
    """Yield the case's loads less what the motors draw; none of which nothing is left."""
    taken: dict[str, complex] = {}
    for motor in motors:
        taken[motor.load.load] = taken.get(motor.load.load, 0j) + motor.drawn
    for load in loads:
        drawn = taken.get(load.name)
        if drawn is None:
            yield load
            continue
        left = complex(load.p_mw, load.q_mvar) - drawn
        if max(abs(left.real), abs(left.imag)) > _NEGLIGIBLE:
            yield replace(load, p_mw=left.real, q_mvar=left.imag)


def motor_remarks(motors: Sequence[MotorLoad], load_mw: float) -> Iterator[Problem]:
    """Tell what motors stand in the place of loads, and what that does to modes.

    ``load_mw``: active power of all loads, of the motors too."""
    for name in dict.fromkeys(motor.record.name for motor in motors):
        own = [motor for motor in motors if motor.record.name == name]
        p_mw = sum(motor.drawn.real for motor in own)
        buses = few([bus_of(str(motor.load.bus)) for motor in own], _SHOWN)
        saturated = any(_saturates(motor.record) for motor in own)
        text = (
            f"{name}: {number_of(len(own), 'induction motor')} for {p_mw:.4g} MW of load "
            f"({whole_percent(p_mw, load_mw)}; {buses}). "
            "Beside a load that follows the voltage alone, a motor's slip answers to voltage and frequency within "
            "tenths of a second, which moves the damping of modes, and it has modes of its own (`w` "
            f"of {own[0].name}); to see how much, leave them out: dyr_leave_out = ['{name}'] in [units]"
        )
        if saturated:
            text += "; their saturation (SE1, SE2) is left out"
        yield Problem(own[0].record.place, text, topic=QuestionTopic(f"{name} as induction motors"))
    for motor in motors:
        loading = motor.drawn.real / motor.parameters["S_n"]
        if not _LEAST_LOADING <= loading <= _MOST_LOADING:
            yield Problem(
                motor.record.place,
                _of_loading(motor, loading),
                topic=QuestionTopic("a motor's loading far from usual", motor.name),
            )


def _of_loading(motor: MotorLoad, loading: float) -> str:
    base, times = (
        _number_in(motor.record, MOTOR_NAMES[motor.record.name], name)
        for name in ("MBASE", "PMULT")
    )
    rated, p_mw = motor.parameters["S_n"], motor.drawn.real
    said = (
        f"MBASE = {base:g} MVA" if base > 0 else f"PMULT = {times:g}, which gives {rated:.4g} MVA"
    )
    wanted = f"MBASE, such as {p_mw / _USUAL_LOADING:.3g}" if base > 0 else "PMULT, such as 1.25"
    return (
        f"{motor.record.name} has {said} for {p_mw:.4g} MW of load at {bus_of(str(motor.load.bus))}: the motor draws "
        f"{100 * loading:.3g} % of its rating, and 40 to 120 % are usual; its inertia and its reactances are on that "
        f"rating. Correct {wanted}"
    )


def _record_for(load: FileLoad, records: RecordsOfLoads) -> DynamicRecord | None:
    for model in MOTOR_RECORDS:
        names = [f"{model}{subsystem}" for subsystem in SUBSYSTEMS]
        record = records.first(load, names)
        if record is not None:
            return record
    return None


def _parameters(record: DynamicRecord, known: DyrRecord, load: FileLoad) -> dict[str, float]:
    own = values_of_record(record, known)
    base, times = (_number_in(record, known, name) for name in ("MBASE", "PMULT"))
    rating = base if base > 0 else times * load.drawn.real
    if not rating > 0:
        raise InputError.at(
            record.place,
            f"{record.name} has MBASE = {base:g} and PMULT = {times:g}: one of them gives "
            "the rating; write MBASE in MVA, or PMULT as the rating by the load's MW, "
            "such as 1.2",
        )
    drawn = load.drawn / rating
    return {**own, "S_n": rating, "P_0": -drawn.real, "Q_0": -drawn.imag}


def _number_in(record: DynamicRecord, known: DyrRecord, name: str) -> float:
    """Return a field's number that sets no parameter; the record has as many values as fields."""
    at = next(k for k, field in enumerate(known.fields) if field.name == name)
    return number_of_field(record, known.fields[at], record.values[at])


def _saturates(record: DynamicRecord) -> bool:
    known = MOTOR_NAMES[record.name]
    return any(_number_in(record, known, name) != 0 for name in _SATURATION)
