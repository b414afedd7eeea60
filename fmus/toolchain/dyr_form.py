"""The form of ``dyr_records.toml``: which part of a model a record of a PSS/E dynamics file (DYR) is, and what it sets.

Plain data without equations. Fields stand in the file's order: ``bus 'NAME' id field field … /``. Field names are
PSS/E's; the first lines of `fmus/synchronous_generator/dyr_records.toml` say how a field is written."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class DyrField:
    """One number of a record.

    ``name``: PSS/E's name of the field; ``parameters``: parameters of the component that take the value; none where the
    field only chooses something; ``negated``: parameters that take the negative value; ``times``: name of another field
    of the record; the parameters take the product of both. PSS/E gives some leads as T_A/T_B; ``only``: the only values
    that our part can stand for; empty where it takes every one; ``all_there``: whether these are all that PSS/E knows;
    ``bus_of``: name of the field that chooses a signal, of another bus than the machine's own where this field, a bus,
    names one; ``same_as``: name of another field that must have the
    same value, because our part has one parameter for both; ``not_zero``: whether 0, by which PSS/E means that it
    chooses a value itself, must be refused; ``zero_sets``: parameter that is true at 0, by which the part chooses the
    value as PSS/E does; ``switch``: whether the parameters are truth values; 0 is false;
    ``nothing_without``: name of another field; where that one is 0, PSS/E reads 0 here too, whatever stands here;
    ``is_text``: whether a text stands there, such as a circuit's identifier, which nothing here reads."""

    name: str
    parameters: tuple[str, ...] = ()
    negated: tuple[str, ...] = ()
    times: str = ""
    only: tuple[float, ...] = ()
    all_there: bool = False
    bus_of: str = ""
    same_as: str = ""
    not_zero: bool = False
    zero_sets: str = ""
    switch: bool = False
    nothing_without: str = ""
    is_text: bool = False


@dataclass(frozen=True)
class DyrRecord:
    """One kind of record.

    ``kind``: key of the component's table: ``machine``, ``exciter``, ``governor``, ``stabilizer``, ``oel`` or ``uel``;
    ``compensator`` for what an exciter measures, which is no part of its own; ``supervisor`` for a slow loop around a
    governor, whose part is the end of the governor's name; ``converter`` for a record that is a
    whole component, to which ``electrical`` and ``plant`` may belong as its control and its plant's, ``shaft``,
    ``aerodynamics``, ``pitch`` and ``torque`` as its wind turbine's; ``plants`` for a controller of several units, a
    component of its own; ``load`` for one that is a load's; ``dc line`` for one of a DC line;
    ``part``: its value, the name of our part; for a whole component, its model;
    ``fields``: in the file's order; ``lacks``: parameters of our part that 0 leaves out, as the record has none;
    ``omissions``: what our part leaves out where a field, by its name, is not 0;
    ``without``: switches of our part that are off, as the record does not have what they switch; ``switched_on``:
    those that are on, as the record always has it; ``hears``: where limiters, by their kind, act on an exciter: ``0``
    added to its voltage reference, ``1`` or ``2`` at a gate; behind ``UEL=2:`` where that field has that value;
    ``approximated``: what the lists of models say where public sources differ."""

    kind: str
    part: str
    fields: tuple[DyrField, ...]
    lacks: tuple[str, ...] = ()
    omissions: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    switched_on: tuple[str, ...] = ()
    hears: Mapping[str, str] = field(default_factory=dict)
    approximated: str = ""


SIGNALS_OF_BUSES = (2, 5, 6)
"""Numbers of stabilisers' signals that PSS/E can take at another bus: frequency, voltage, its rate."""

_WORD = re.compile(
    r"(?P<name>[^:=!&@%-]+)(@(?P<bus_of>\w+))?(:(?P<sets>[\w+]+))?(-(?P<negated>[A-Za-z]\w*))?(\*(?P<times>[^=!&]+))?(==(?P<same>\w+))?(=(?P<only>[-\d|.]+))?"
    r"(!(?P<chooser>\w*))?(?P<switch>\??)(&(?P<without>[^%\s]+))?(?P<text>%?)"
)
"""A field as the table has it."""

_SCOPES = {
    "machine": "machine.",
    "exciter": "exciter.",
    "governor": "governor.",
    "supervisor": "governor.lcfb1.",
    "stabilizer": "pss.",
    "compensator": "exciter.",
    "oel": "oel.",
    "uel": "uel.",
    "converter": "",
    "load": "",
    "dc line": "",
    "electrical": "electrical.",
    "plant": "plant.",
    "plants": "",
    "shaft": "shaft.",
    "aerodynamics": "aerodynamics.",
    "pitch": "pitch.",
    "torque": "torque.",
}


def _allowed(text: str) -> tuple[tuple[float, ...], bool]:
    """The values of ``1|3`` or ``1..6``, and whether these are all that there are."""
    first, dots, last = text.partition("..")
    if dots:
        return tuple(map(float, range(int(first), int(last) + 1))), True
    return tuple(map(float, text.split("|"))) if text else (), False


def _record(table: Mapping[str, Any]) -> DyrRecord:
    scope, fields = _SCOPES[table["kind"]], []
    for word in table["fields"].split():
        found = _WORD.fullmatch(word)
        assert found is not None, word
        sets, negated = (
            tuple(f"{scope}{p}" for p in (found[group] or "").split("+") if p)
            for group in ("sets", "negated")
        )
        only, all_there = _allowed(found["only"] or "")
        times, same = found["times"] or "", found["same"] or ""
        chooser = f"{scope}{found['chooser']}" if found["chooser"] else ""
        one = DyrField(
            name=found["name"],
            parameters=sets,
            negated=negated,
            times=times,
            only=only,
            all_there=all_there,
            bus_of=found["bus_of"] or "",
            same_as=same,
            not_zero=found["chooser"] == "",
            zero_sets=chooser,
            switch=found["switch"] != "",
            nothing_without=found["without"] or "",
            is_text=found["text"] != "",
        )
        fields.append(one)

    def names_of(key: str) -> tuple[str, ...]:
        return tuple(f"{scope}{name}" for name in table.get(key, ()))

    return DyrRecord(
        table["kind"],
        table["part"],
        tuple(fields),
        names_of("lacks"),
        table.get("omissions", {}),
        without=names_of("without"),
        switched_on=names_of("switched_on"),
        hears=table.get("hears", {}),
        approximated=table.get("approximated", ""),
    )


def records_beside(module: str) -> dict[str, DyrRecord]:
    """The records of ``dyr_records.toml`` beside a module's file, by PSS/E's name."""
    tables = tomllib.loads(Path(module).with_name("dyr_records.toml").read_text(encoding="utf-8"))
    return {name: _record(_whole(table, tables)) for name, table in tables.items()}


def _whole(table: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A table with what it has from the record that it names in ``as``."""
    if "as" not in table:
        return dict(table)
    first = _whole(tables[table["as"]], tables)
    fields = f"{first['fields']} {table.get('fields', '')}"
    return {**first, **table, "fields": fields}
