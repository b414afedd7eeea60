"""The list that `gfor new --models` prints: what each record becomes, by which source, and what is left out.

The records themselves, with their fields: `dyr_unit_records`, and beside each model."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.dc_line.dyr_records import DC_LINE_RECORDS, INVERTER
from fmus.distributed_generation.dyr_records import DISTRIBUTED_RECORDS
from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from fmus.induction_machine.dyr_records import INDUCTION_RECORDS
from fmus.regfm_a1.dyr_records import REGFM_A1_RECORDS
from fmus.regfm_b1.dyr_records import REGFM_B1_RECORDS
from fmus.static_var.dyr_records import STATIC_VAR_RECORDS
from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from fmus.toolchain.dyr_form import DyrRecord
from fmus.wecc_renewable.dyr_records import (
    CONTROLLER,
    CONTROLLER_RECORD,
    OF_FIRST_GENERATION,
    PLANT_RECORDS,
    TYPE_4,
)
from orchestrator.cases.networks.psse.air_conditioners import AIR_CONDITIONERS
from orchestrator.cases.networks.psse.composite_loads import COMPOSITE_NAMES
from orchestrator.cases.networks.psse.composite_loads import MODEL as MODEL_OF_MOTORS
from orchestrator.cases.networks.psse.dyr_file import NUMBERED
from orchestrator.cases.networks.psse.frequency_records import FREQUENCY_RECORDS
from orchestrator.cases.networks.psse.limiter_records import LIMITERS
from orchestrator.cases.networks.psse.load_records import LOAD_RECORDS
from orchestrator.cases.networks.psse.load_relay_records import LOAD_RELAYS
from orchestrator.cases.networks.psse.motor_loads import MOTOR_NAMES
from orchestrator.cases.networks.psse.relay_records import OF_BUSES

_LIBRARY = "PSS/E's model library as PowerWorld's and NEPLAN's guides and ANDES' reader describe it"
_COMPENSATORS = "PowerWorld's guide to PSS/E's models; CSVGN5 and SVSMO1 as InterPSS reads them"
_OF_LIMITERS = "IEC 61970-302, STEPSS' page of RAMSES' exciters, Dynawo, OpenIPSL; PowerWorld's help (OEL3C, OEL4C)"
_SOURCES = {
    "supervisor": "STEPS' reader and model of LCFB1, IEC 61970-302, PowerWorld's help on LCFB1_PTI"
}
"""Sources of the records of machines that are of a kind of their own."""
_REGFM = "WECC's specification of REGFM_A1; GDFORM as GridPACK reads it"
_REGFM_B1 = "WECC's specification of REGFM_B1, in PNNL's script for PSS/E"
_LOADS = "GridPACK's reader and model"
_OF_SEVERAL = "WECC's REPC_B as PowerWorld's help lists it; fields as InterPSS reads them"
_DISTRIBUTED = {
    "DERA1": "WECC's specification of DER_A; fields as PowerSystems.jl lists PSS/E's",
    "PVD1": "WECC's PVD1 as PowerWorld's help and ANDES have it; fields as Argonne's DYN reads them",
}
_DC_LINES = "PowerWorld's help on PSS/E's models of DC lines; fields as STEPS reads them"
_OF_LINE = f"{INVERTER} at the other end; no inductance of the line"
_INDUCTION = "PowerWorld's guide to PSS/E's machine models"
_FREQUENCY = "PowerWorld's guide to PSS/E's load models"
_RELAYS = "PowerWorld's guide to PSS/E's relay models; fields as InterPSS and GridPACK read them"
_OF_BUS = "three-winding transformers at the bus stay on"
_NOT_SHED = "a load for which motors stand keeps its power"
_COMPOSITE = "WECC's composite load model; fields as InterPSS and GridPACK read them"
_AIR_CONDITIONERS = (
    "WECC's composite load model, motor D; fields and equations as GridPACK has them"
)
_RUNNING = "what it draws while it runs, near v_0; stalling and trips left out"
_LEFT_OUT = "motors A to C by their share, the rest a load; feeder, trips, stalling left out"
_MOTORS = "PowerWorld's guide to PSS/E's load models, and STEPS' reader"
_GENERIC = (
    "WECC's generic converters: fields as ANDES and GridPACK read them, diagrams of WECC's guide"
)
_FIRST = "WECC's first generic turbines: fields and diagrams as InterPSS has them"
_OF_TYPE_4 = f"{_FIRST}, diagrams as OPAL-RT shows them"


@dataclass(frozen=True, slots=True)
class KnownRecord:
    """A record: PSS/E's name, its kind, our part, where its fields are known from, and what is approximated.

    ``held_against``: what the part was compared with."""

    name: str
    kind: str
    part: str
    source: str
    approximated: str = ""
    held_against: str = ""


def known_records() -> list[KnownRecord]:
    """All records, by kind in the order of the tables that hold them."""
    found = [
        *_of_machines(),
        *_of_table(REGFM_A1_RECORDS, _REGFM),
        *_of_table(REGFM_B1_RECORDS, _REGFM_B1),
        *_of_table(STATIC_VAR_RECORDS, _COMPENSATORS, "device"),
        *_of_names(LOAD_RECORDS, _LOADS, "an exponent other than 0, 1, 2 near v_0"),
        *_of_table(INDUCTION_RECORDS, _INDUCTION, "machine"),
        *_of_names(FREQUENCY_RECORDS, _FREQUENCY, "r, s not used; no constant impedances"),
        *_of_names(AIR_CONDITIONERS, _AIR_CONDITIONERS, _RUNNING),
        *_of_names(COMPOSITE_NAMES, _COMPOSITE, _LEFT_OUT, MODEL_OF_MOTORS),
        *_of_table(MOTOR_NAMES, _MOTORS, "load"),
        *_of_plants(),
        KnownRecord(CONTROLLER, "plants of several units", CONTROLLER_RECORD.part, _OF_SEVERAL),
        *_of_distributed(),
        *_of_lines(),
        *_of_relays(),
    ]
    by_name = _peers()
    return [replace(r, held_against=by_name.get(r.name, _BY_HAND)) for r in found]


def _of_table(
    records: Mapping[str, DyrRecord], source: str, kind: str | None = None
) -> Iterator[KnownRecord]:
    """Yield the records of a table with one source; ``kind``: where it is not the record's own."""
    for name, record in records.items():
        yield KnownRecord(name, kind or record.kind, record.part, source, _limits(record))


def _of_names(
    names: Iterable[str], source: str, approximated: str, part: str = "load_model"
) -> Iterator[KnownRecord]:
    """Yield the records of loads that become one part with one approximation."""
    for name in names:
        yield KnownRecord(name, "load", part, source, approximated)


def _of_machines() -> Iterator[KnownRecord]:
    for name, record in DYR_RECORDS.items():
        kind = _KINDS.get(record.kind, record.kind)
        source = _OF_LIMITERS if record.kind in LIMITERS else _SOURCES.get(record.kind, _LIBRARY)
        yield KnownRecord(name, kind, record.part, source, _limits(record))


def _of_plants() -> Iterator[KnownRecord]:
    for name, record in PLANT_RECORDS.items():
        first = _OF_TYPE_4 if name in TYPE_4 else _FIRST
        source = first if name in OF_FIRST_GENERATION else _GENERIC
        yield KnownRecord(name, _KINDS[record.kind], record.part, source, _of_plant(name))


def _of_distributed() -> Iterator[KnownRecord]:
    for name, record in DISTRIBUTED_RECORDS.items():
        yield KnownRecord(name, "converter", record.part, _DISTRIBUTED[name], _limits(record))


def _of_lines() -> Iterator[KnownRecord]:
    for name, record in DC_LINE_RECORDS.items():
        yield KnownRecord(name, "device (DC line)", record.part, _DC_LINES, _of_line(record))


def _of_relays() -> Iterator[KnownRecord]:
    for name in NUMBERED:
        approximated = _OF_BUS if name in OF_BUSES else ""
        yield KnownRecord(name, "relay", "unit_trip", _RELAYS, approximated)
    for form in LOAD_RELAYS:
        for name in form.names:
            yield KnownRecord(name, "relay", "load_change", _RELAYS, _NOT_SHED)


_BY_HAND = "its diagram's equations, by hand"


def _of_line(record: DyrRecord) -> str:
    """Return what is approximated of a DC line, and which of its interruptions are left out."""
    return _together(_OF_LINE, _limits(record))


def _peers() -> dict[str, str]:
    """Return what parts were compared with beside their diagrams, by the record's name."""
    path = Path(__file__).with_name("held_against.toml")
    table: dict[str, str] = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: peer for peer, names in table.items() for name in names.split()}


_KINDS = {
    "oel": "limiter of overexcitation",
    "uel": "limiter of underexcitation",
    "supervisor": "supervisor of a governor",
    "converter": "converter",
    "electrical": "converter control",
    "plant": "plant control",
    "shaft": "plant shaft",
    "aerodynamics": "plant aerodynamics",
    "pitch": "plant pitch control",
    "torque": "plant torque control",
}
"""Words for the kinds of limiters and of a plant's records."""


def _of_plant(name: str) -> str:
    """Return what is approximated of a plant's record, and what stands for it at the user's word."""
    by_word = f"with dyr_approximate = true: {MODEL}" if name in FIELDS else ""
    return _together(_limits(PLANT_RECORDS[name]), by_word)


def _together(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _limits(record: DyrRecord) -> str:
    """Return what a part of ours cannot take of a record, and what it does not use."""
    unused = _unused(record)
    not_used = f"{', '.join(unused)} not used" if unused else ""
    return _together(*_limited_fields(record), not_used, record.approximated)


def _limited_fields(record: DyrRecord) -> Iterator[str]:
    for field in record.fields:
        if field.bus_of:
            yield f"{field.name} only the machine's own"
        if field.only and not field.all_there:
            yield f"{field.name} only {' or '.join(f'{value:g}' for value in field.only)}"
        if field.same_as:
            yield f"{field.name} only as {field.same_as}"


def _unused(record: DyrRecord) -> list[str]:
    """Return the fields that nothing of ours takes."""
    used = {name for f in record.fields for name in (f.times, f.same_as, f.nothing_without) if name}
    return [
        f.name
        for f in record.fields
        if not (
            f.is_text
            or f.parameters
            or f.negated
            or f.only
            or f.bus_of
            or f.same_as
            or f.zero_sets
            or f.name in used
        )
    ]
