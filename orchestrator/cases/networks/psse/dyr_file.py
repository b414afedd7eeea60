"""Records of a PSS/E dynamics file (DYR), as they stand there."""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from fmus.toolchain.dyr_form import DyrField
from orchestrator.core.errors import InputError, few, number_of
from orchestrator.core.foreign_files import read_text, visible
from orchestrator.core.units import LARGEST

MOST_BYTES = 100_000_000  # of a file
_TOKEN = re.compile(
    r"""(?P<quoted>'[^']*'|"[^"]*")|(?P<plain>[^\s,'"/]+)|(?P<slash>/)|(?P<comma>,)"""
)
_MODEL = re.compile(r"[A-Za-z]\w{2,}")  # of a DC line, whose name stands where others have a bus
_WHOLE_PAIR = re.compile(r"[-+]?\d+,\d+")
_NAMED_PAIRS = 4  # that one question names
_COMMENTS = ("//", "@!", "#")  # beginnings of lines that hold no record; # as public files have it
EVENT = "TOGGLE"  # an event of ANDES, which writes some into its files of dynamics data
_OF_HEAD = 3  # values with which a record begins: its bus, model and identifier
_BLANK = "0"  # what a blank text among the numbers says: IEEEG1 writes '' for a second machine that there is not
_OWN_MODELS = (
    "USRMDL",
    "USRLOD",
)  # a user's model of a machine or a load: its name is the first value

_OF_PLANTS = ("PLNTBU1", "REAX3BU1", "REAX4BU1")  # models of PSS/E that files write as a user's

_OF_BUS = "USRBUS"  # a user's model of a bus: its name stands where others have a machine

OF_USERS = ("VTGTPA", "VTGDCA", "FRQTPA", "FRQDCA")
"""Relays that are written as a user's model."""

NUMBERED = (*(f"{name}T" for name in OF_USERS), *OF_USERS)
"""Relays whose records begin with a number of their own, where others have a bus; the same as models of PSS/E first."""

OF_SHUNTS = {"SVSMO1T2": False, "SVSMO1T3": True}
"""Models of switched shunts, and whether the shunt's identifier follows the name: it does from revision 35 on."""

OF_FACTS = ("CSTCNT",)
"""Records of a FACTS device that are its model."""

AT_BUS = " AT "
"""Stands between a model and the bus whose records of it are left out."""

ONLY_SHUNT = "1"
"""Identifier of a switched shunt where there is only one at a bus."""

_BEFORE_ICONS = (
    6  # numbers of a user's model: its two codes, and how many of four kinds of values there are
)
_ICONS = 2  # place of the number of whole values among these
_CONS = 3  # place of the number of other values
_OF_NUMBERED = 3  # whole values of a relay: the bus watched, the generator's bus, its identifier
_LIMITS = 4  # other values: two limits and two times


@dataclass(frozen=True)
class DynamicRecord:
    file: str
    line: int
    bus: int
    name: str
    machine: str
    values: tuple[str, ...]
    line_of_dc: str = (
        ""  # name of the DC line or FACTS device that a record is of, in the place of its bus
    )
    surplus: tuple[str, ...] = ()  # values that its model has no fields for, and that are not used
    lacking: int = 0  # how many of its last values are missing, and are taken as 0
    # whole numbers among its values with a comma and no blank between them, as a decimal comma leaves them
    whole_pairs: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        return f"{self.file}, line {self.line}"

    @property
    def model(self) -> str:
        """Return the name of its model alone, where ``name`` is that of its bus as well."""
        return self.name.partition(AT_BUS)[0]

    @property
    def name_at_bus(self) -> str:
        """Return the name that is of the records of its model at its bus alone, as ``WSIEG1 AT 3106``."""
        return f"{self.model}{AT_BUS}{self.bus}"


def read_dyr(path: Path) -> list[DynamicRecord]:
    if not path.is_file():
        raise InputError.at(f"{path}", "there is no such file; give the path of a PSS/E DYR file")
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise InputError.at(f"{path}", f"it has {size} bytes; at most {MOST_BYTES} are read")
    text = read_text(path, MOST_BYTES, "utf-8-sig", "replace")
    return list(_records_in(str(path), visible(text)))


@lru_cache(maxsize=2)
def _records_in(file: str, text: str) -> tuple[DynamicRecord, ...]:
    """Return the records of a text; the last ones are kept, as an outage of a screening reads its file three times."""
    records: list[DynamicRecord] = []
    tokens: list[str] = []
    begin = 0
    names = 0  # values in quotes with which the record begins
    commas = 0  # since the last value
    pairs: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith(_COMMENTS):
            continue
        for token in _TOKEN.finditer(line):
            if token["slash"]:
                if tokens:  # else a comment, or a slash alone
                    record = _record(file, begin, tokens, names)
                    records.append(replace(record, whole_pairs=tuple(pairs)) if pairs else record)
                tokens, pairs, commas = [], [], 0
                break  # what follows on the line is a comment
            if token["comma"]:
                commas += bool(tokens)
            else:
                begin, names = (begin, names) if tokens else (number, 0)
                tokens += _empty_fields(f"{file}, line {begin}", tokens, commas)
                if commas == 1 and len(tokens) > _OF_HEAD:
                    pairs += _whole_pair(line, token, tokens[-1])
                commas = 0
                names += bool(token["quoted"]) and names == len(tokens)
                text = token["plain"] or token["quoted"][1:-1].strip()
                tokens.append(text or (_BLANK if len(tokens) >= _OF_HEAD else ""))
    if tokens:
        raise InputError.at(
            f"{file}, line {begin}", "the record does not end with a slash; the file is cut short"
        )
    return tuple(records)


def _empty_fields(place: str, before: Sequence[str], commas: int) -> list[str]:
    """Return the empty fields that stand between two values; the second of two commas ends one.

    Those behind the last value are no fields: a record may end early.

    Source: list-directed input of Fortran, in which a null value keeps its place.

    Raises an `InputError` where the bus, the model or the identifier is empty."""
    empty = [""] * (commas - 1)
    if empty and len(before) < _OF_HEAD:
        raise InputError.at(
            place,
            f"the record that begins with {' '.join(before)!r} has two commas with nothing between them where its bus, "
            "model and identifier stand; write what is missing, or take one of the commas out",
        )
    return empty


def _whole_pair(line: str, token: re.Match[str], before: str) -> list[str]:
    """Return a value with the one before it as ``120,0``, where both are whole numbers with a comma alone between."""
    pair = f"{before},{token['plain']}"
    is_whole = _WHOLE_PAIR.fullmatch(pair) is not None
    return [pair] if is_whole and line[: token.end()].endswith(pair) else []


def decimal_commas(record: DynamicRecord, needed: int) -> str:
    """Return what to ask of a record with more values than needed, where decimal commas may be why; else nothing."""
    surplus = len(record.values) + len(record.surplus) - needed
    if surplus <= 0 or len(record.whole_pairs) < surplus:
        return ""
    pair = record.whole_pairs[0]
    return (
        f"; a decimal comma makes two values of one: is it so in {few(record.whole_pairs, _NAMED_PAIRS)}? Write "
        f"{pair.replace(',', '.')} for {pair}"
    )


def facts_name(device: str) -> str:
    """Return what a FACTS device's unit is called beside machines at its bus, which have short names of their own."""
    return f"facts {device.strip().casefold()}"


def shunt_name(identifier: str) -> str:
    """Return what a switched shunt's unit is called beside machines at its bus, which have short names of their own."""
    return f"shunt {identifier}"


def _record(file: str, line: int, tokens: Sequence[str], names: int) -> DynamicRecord:
    if len(tokens) > 2 and tokens[1].upper() == EVENT:
        return DynamicRecord(file, line, 0, EVENT, tokens[2], tuple(tokens[3:]))
    if names > 1 and not tokens[0].isdigit() and _MODEL.fullmatch(tokens[1]):
        name, values = tokens[1].upper(), tuple(tokens[2:])
        unit = facts_name(tokens[0]) if name in OF_FACTS else ""
        return DynamicRecord(file, line, 0, name, unit, values, line_of_dc=tokens[0])
    if len(tokens) < 3 or not re.fullmatch(r"\d{1,9}", tokens[0]):
        raise InputError.at(
            f"{file}, line {line}",
            f"{' '.join(tokens[:4])!r} is no record; one is bus 'MODEL' id values … /",
        )
    name, machine, values = tokens[1].upper(), tokens[2].strip(), tuple(tokens[3:])
    if name == _OF_BUS:
        name = machine.upper()
        values = _behind_counts(values) if name in _OF_PLANTS else values
        return DynamicRecord(file, line, int(tokens[0]), name, "", values)
    if name in _OWN_MODELS and values:
        name, values = values[0].upper(), values[1:]
        if name in OF_USERS:
            return DynamicRecord(file, line, 0, name, "", _of_users_relay(values))
        values = _behind_counts(values) if name in _OF_PLANTS else values
    if name in OF_SHUNTS:
        values = values if OF_SHUNTS[name] else (machine, *values)
        identifier = machine if OF_SHUNTS[name] else ONLY_SHUNT
        return DynamicRecord(file, line, int(tokens[0]), name, shunt_name(identifier), values)
    if name in NUMBERED:
        return DynamicRecord(file, line, 0, name, "", (machine, *values))
    return DynamicRecord(file, line, int(tokens[0]), name, machine, values)


def _of_users_relay(values: tuple[str, ...]) -> tuple[str, ...]:
    """Return the values of a relay that is written as a user's model; all as they are where they are not these."""
    counts, rest = values[:_BEFORE_ICONS], values[_BEFORE_ICONS:]
    if len(counts) < _BEFORE_ICONS or not all(text.isdigit() for text in counts):
        return values
    first = int(counts[_ICONS])
    return (*rest[:first][:_OF_NUMBERED], *rest[first : first + int(counts[_CONS])][:_LIMITS])


def _behind_counts(values: tuple[str, ...]) -> tuple[str, ...]:
    """Return the values of a user's model without its codes and counts; all as they are where these are not there."""
    counts, rest = values[:_BEFORE_ICONS], values[_BEFORE_ICONS:]
    are_counts = len(counts) == _BEFORE_ICONS and all(text.isdigit() for text in counts)
    is_whole = are_counts and int(counts[_ICONS]) + int(counts[_CONS]) == len(rest)
    return rest if is_whole else values


def swallowed_machines(record: DynamicRecord, known: Collection[str]) -> list[tuple[int, str]]:
    """Return bus and identifier of the machines whose records follow one without a slash, and are lost in it.

    ``known``: names of models."""
    triples = zip(record.values, record.values[1:], record.values[2:], strict=False)
    return [
        (int(bus), machine)
        for bus, name, machine in triples
        if name.upper() in known and bus.isdigit()
    ]


def refuse_next(record: DynamicRecord, known: Collection[str]) -> None:
    """Refuse a record that runs into the next one; ``known``: names of models."""
    following = next((text for text in record.values[1:] if text.upper() in known), None)
    if following:
        raise InputError.at(
            record.place,
            f"the record {record.name} has no slash at its end, and runs into the next, "
            f"{following}; write the slash",
        )


def given_values(
    record: DynamicRecord, fields: Sequence[DyrField], known: Collection[str]
) -> dict[str, float]:
    """Return the numbers of a record by the names of its fields.

    ``known``: names of models, which stand among its values where it has no slash at its end."""
    refuse_next(record, known)
    for number, (field, text) in enumerate(zip(fields, record.values, strict=False), start=1):
        if not text and not field.is_text:
            raise _error_of_empty(record, f"field {number} ({field.name})")
    if len(record.values) != len(fields):
        raise InputError.at(
            record.place,
            f"{record.name} has {number_of(len(record.values), 'value')}, and needs {len(fields)}: "
            f"{', '.join(field.name for field in fields)}{decimal_commas(record, len(fields))}",
        )
    return {
        field.name: number_of_field(record, field, text)
        for field, text in zip(fields, record.values, strict=True)
        if not field.is_text
    }


def number_of_field(record: DynamicRecord, field: DyrField, text: str) -> float:
    """Return a field's number; an `InputError` where it is none."""
    if not text:
        raise _error_of_empty(record, field.name)
    value = number_in(text)
    if not abs(value) < LARGEST:
        raise InputError.at(
            record.place, f"{record.name} has {field.name} = {text!r}; it must be a number"
        )
    return value


def _error_of_empty(record: DynamicRecord, field: str) -> InputError:
    """Return the error about a field without a value, which keeps its place among the others."""
    return InputError.at(
        record.place,
        f"{record.name}: {field} is empty: PSS/E's default for it is not in the file; write its value there, or "
        "take one of the two commas out if no value is missing",
    )


def number_in(text: str) -> float:
    """Return the number that a text is, as Fortran writes it too (1.5D-3); not a number where it is none."""
    try:
        return float(text.upper().replace("D", "E"))
    except ValueError:
        return math.nan
