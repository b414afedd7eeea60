"""PSS/E dynamics data (DYR): machines with their controls, and converters, of the generators of a RAW file."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.regfm_a1.dyr_fields import REGFM_A1_RECORDS
from fmus.synchronous_generator.dyr_fields import DYR_RECORDS, DyrField, DyrRecord
from orchestrator.cases.psse.raw import Machine
from orchestrator.errors import InputError

MOST_BYTES = 100_000_000
"""Of a file."""

_KNOWN = DYR_RECORDS | REGFM_A1_RECORDS

_TOKEN = re.compile(r"'([^']*)'|([^\s,'/]+)|(/)|(,)")
_MOST_SHOWN = 20
_WITHOUT = {"exciter": "manual", "governor": "constant_power", "stabilizer": "none"}
"""Parts of a generator for which a file has no record: what PSS/E assumes."""

_FOLLOWING = ("REGC", "REEC", "REPC", "WTG", "WT4", "WT3", "PVGU", "PVEU", "PLNTB")
"""How the names of grid-following converters and their controls begin."""


@dataclass(frozen=True)
class DynamicRecord:
    """One record: ``bus 'NAME' id values … /``."""

    place: str
    bus: int
    name: str
    machine: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class MachineModel:
    """What a generator is made of, and the parameters that its records set; or the model of a converter."""

    parts: Mapping[str, str]
    parameters: Mapping[str, float]
    converter: str | None = None


def read_dyr(path: Path) -> list[DynamicRecord]:
    """Records of a DYR file.

    Raises
    ------
    InputError
        If there is no such file, it is too large, or a record is not of that form.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a PSS/E DYR file")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise InputError(f"{path}: it has {size} bytes; at most {MOST_BYTES} are read")
    records: list[DynamicRecord] = []
    tokens: list[str] = []
    begin = 0
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if line.lstrip().startswith(("//", "@!")):
            continue
        for quoted, plain, slash, _ in _TOKEN.findall(line):
            if slash:
                records.append(_record(f"{path}, line {begin or number}", tokens))
                tokens = []
                break  # what follows on the line is a comment
            if quoted or plain:
                begin = begin if tokens else number
                tokens.append(quoted.strip() or plain)
    if tokens:
        raise InputError(f"{path}, line {begin}: the record does not end with a slash; the file is cut short")
    return records


def _record(place: str, tokens: Sequence[str]) -> DynamicRecord:
    if len(tokens) < 3 or not re.fullmatch(r"\d{1,9}", tokens[0]):
        raise InputError(f"{place}: {' '.join(tokens[:4])!r} is no record; one is bus 'MODEL' id values … /")
    return DynamicRecord(place, int(tokens[0]), tokens[1].upper(), tokens[2].strip(), tuple(tokens[3:]))


def machine_models(
    records: Sequence[DynamicRecord],
    machines: Sequence[Machine],
    leaving_out: Sequence[str] = (),
    replaced: Collection[tuple[int, str]] = (),
    idle: Collection[tuple[int, str]] = (),
) -> dict[tuple[int, str], MachineModel]:
    """Models of the machines in service, by bus and identifier.

    Parameters
    ----------
    records
        Of the DYR file.
    machines
        Of the RAW file.
    leaving_out
        Models whose records may be left out; their generators keep what the case says of that part.
    replaced
        Machines in whose place a converter of the case stands: they need no record.
    idle
        Machines of the RAW file that are out of service.

    Raises
    ------
    InputError
        With every machine that has no machine record, every record of a machine that is not there, every model that is
        unknown, and every value that our part cannot have.
    """
    at = {(machine.bus, machine.name.strip()): machine for machine in machines}
    problems: list[str] = []
    parts: dict[tuple[int, str], dict[str, str]] = {key: {} for key in at}
    values: dict[tuple[int, str], dict[str, float]] = {key: {} for key in at}
    left = {name.upper() for name in leaving_out}
    for record in records:
        key = (record.bus, record.machine)
        if key not in at and key not in idle and record.name in _KNOWN:
            ids = sorted(name for bus, name in {*at, *idle} if bus == record.bus)
            there = f"which has {', '.join(map(repr, ids))}" if ids else "which has no generator in the RAW file"
            problems.append(
                f"{record.place}: {record.name} is of machine {record.machine!r} at bus {record.bus}, {there}; correct "
                "its bus or identifier, or remove the record"
            )
        if key not in at or record.name in left:
            continue
        known = _KNOWN.get(record.name)
        if known is None:
            problems.append(f"{record.place}: no part of ours stands for {record.name} (bus {record.bus})")
            if record.name.startswith(_FOLLOWING):
                problems[-1] += (
                    ", a grid-following converter; name its records in dyr_leave_out, and give its unit alpha = 1 with "
                    "a converter of ours"
                )
        elif known.kind in parts[key]:
            problems.append(f"{record.place}: a second {known.kind} of machine {record.machine!r} at bus {record.bus}")
        else:
            parts[key][known.kind] = known.part
            try:
                values[key] |= _values(record, known)
            except InputError as error:
                problems.append(str(error))
    for (bus, name), own in parts.items():
        if "converter" in own and len(own) > 1:
            others = ", ".join(kind for kind in own if kind != "converter")
            problems.append(
                f"machine {name!r} at bus {bus} is a converter, and has records of its {others}; remove them"
            )
        elif not {"machine", "converter"} & {*own} and (bus, name) not in replaced:
            problems.append(f"machine {name!r} at bus {bus} has no record of a machine")
    if problems:
        more = f"\n  and {len(problems) - _MOST_SHOWN} more" if len(problems) > _MOST_SHOWN else ""
        raise InputError(
            "the dynamics data cannot be taken over; correct them, or name models that may go in [units] "
            "dyr_leave_out:\n  " + "\n  ".join(problems[:_MOST_SHOWN]) + more
        )
    open_ = {(record.bus, record.machine) for record in records if record.name in left}
    return {
        key: _model(at[key], parts[key], values[key], key in open_)
        for key in at
        if {"machine", "converter"} & {*parts[key]}
    }


def _model(machine: Machine, parts: Mapping[str, str], values: Mapping[str, float], partial: bool) -> MachineModel:
    """The model of a machine; ``partial``: a record of it was left out, and the case says what stands for it."""
    if "converter" in parts:
        coupling = {"RL": machine.source.real, "XL": machine.source.imag}
        return MachineModel({}, {**coupling, **values}, parts["converter"])
    absent = {} if partial else {kind: part for kind, part in _WITHOUT.items() if kind not in parts}
    source = {"machine.R_s": machine.source.real}
    if parts["machine"] == "classical":
        source["machine.X_d1"] = machine.source.imag
    step_up = {"transformer.X_t": 0.0, "transformer.R_t": 0.0}  # the network has them
    return MachineModel({**absent, **parts}, {**source, **values, **step_up})


def _values(record: DynamicRecord, known: DyrRecord) -> dict[str, float]:
    """Parameters that a record sets."""
    following = next((text for text in record.values[2:] if text.upper() in _KNOWN), None)
    if following is not None:
        raise InputError(
            f"{record.place}: the record {record.name} has no slash at its end, and runs into the next, {following}"
        )
    if len(record.values) != len(known.fields):
        raise InputError(
            f"{record.place}: {record.name} has {len(record.values)} values, and needs {len(known.fields)}: "
            f"{', '.join(field.name for field in known.fields)}"
        )
    given = {field.name: _number(record, field, text) for field, text in zip(known.fields, record.values, strict=False)}
    found: dict[str, float] = {}
    for field in known.fields:
        value = given[field.name]
        if field.only and value not in field.only:
            allowed = " or ".join(f"{x:g}" for x in field.only)
            raise InputError(
                f"{record.place}: {record.name} has {field.name} = {value:g}; only {allowed} can be modelled"
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
        product = bool(value) if field.switch else value * given[field.times] if field.times else value
        found |= dict.fromkeys(field.parameters, product) | dict.fromkeys(field.negated, -product)
    return found


def _number(record: DynamicRecord, field: DyrField, text: str) -> float:
    try:
        value = float(text.upper().replace("D", "E"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{record.place}: {record.name} has {field.name} = {text!r}; it must be a number")
    return value
