"""Networks and lists of units from tables: what a case file refers to instead of writing it out."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.grid.network import Line, Load
from orchestrator.cases.schema import ComponentTable, NetworkTable, UnitsTable
from orchestrator.errors import InputError

UNIT_KINDS = ("sg", "gfor")
"""Beginnings of the names of a unit's generator and converter."""


@dataclass(frozen=True, slots=True)
class UnitRow:
    """One generating unit: its bus, rating [MVA], active power [MW] and voltage [pu]."""

    label: str
    bus: str
    rating_mva: float
    p_mw: float
    v_pu: float


def network_elements(table: NetworkTable, directory: Path) -> tuple[tuple[str, ...], list[Line], list[Load]]:
    """Buses, lines and loads of a network table, its files included.

    Raises
    ------
    InputError
        If a file is missing, lacks a column or holds something that is not a number.
    """
    lines = [Line(n, t.from_bus, t.to_bus, t.X, t.R, t.B) for n, t in table.lines.items()]
    loads = [Load(n, t.bus, t.p, t.q) for n, t in table.loads.items()]
    if table.lines_file is not None:
        for row in _rows(directory / table.lines_file, ("from", "to", "R", "X", "B")):
            name = f"line_{row['from']}_{row['to']}"
            ends = bus_name(row["from"]), bus_name(row["to"])
            lines.append(Line(name, *ends, X=_number(row, "X"), R=_number(row, "R"), B=_number(row, "B")))
    if table.loads_file is not None:
        for row in _rows(directory / table.loads_file, ("bus", "p_mw", "q_mvar")):
            bus = bus_name(row["bus"])
            loads.append(Load(f"load_{row['bus']}", bus, _number(row, "p_mw"), _number(row, "q_mvar")))
    buses = dict.fromkeys(table.buses)
    if not buses:  # nothing to check the lines' ends against: they are the list
        buses = dict.fromkeys(bus for line in lines for bus in (line.from_bus, line.to_bus))
    return tuple(buses), lines, loads


def unit_rows(table: UnitsTable, directory: Path) -> list[UnitRow]:
    """The units of a units table's file.

    Raises
    ------
    InputError
        As `network_elements`.
    """
    path = directory / table.file
    rows = []
    for row in _rows(path, ("bus", "rating_mva", "p_mw", "v_pu")):
        unit = UnitRow(
            row["bus"], bus_name(row["bus"]), _number(row, "rating_mva"), _number(row, "p_mw"), _number(row, "v_pu")
        )
        if abs(unit.p_mw) > unit.rating_mva:
            raise InputError(
                f"{path}: the unit at bus {unit.label} feeds {unit.p_mw:g} MW, more than its rating of "
                f"{unit.rating_mva:g} MVA; raise the rating or lower p_mw"
            )
        rows.append(unit)
    return rows


def unit_components(table: UnitsTable, alpha: float, rows: Sequence[UnitRow]) -> dict[str, ComponentTable]:
    """Generators ``sg<bus>`` and converters ``gfor<bus>`` that share each unit's rating and power 1 − α to α."""
    shares = (1 - alpha, alpha)
    models = ((table.generator, table.generator_parameters), (table.converter, table.converter_parameters))
    components = {}
    for kind, share, (model, common) in zip(UNIT_KINDS, shares, models, strict=True):
        for row in rows if share > 0 else ():
            own = {"S_n": share * row.rating_mva, "P_0": row.p_mw / row.rating_mva, "v_0": row.v_pu}
            components[f"{kind}{row.label}"] = ComponentTable(model=model, bus=row.bus, parameters=common | own)
    return components


def bus_name(label: str) -> str:
    """Name of a bus in FMU variables, which cannot begin with a digit: ``12`` → ``bus_12``."""
    return f"bus_{label}" if label[:1].isdigit() else label


def _rows(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; it should hold the columns {', '.join(columns)}")
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [c for c in columns if c not in (reader.fieldnames or ())]
        if missing:
            raise InputError(f"{path}: column {', '.join(missing)} is missing; it should hold {', '.join(columns)}")
        return [row | {"_place": f"{path}, line {number}"} for number, row in enumerate(reader, start=2)]


def _number(row: dict[str, str], column: str) -> float:
    try:
        return float(row[column])
    except (TypeError, ValueError):
        raise InputError(f"{row['_place']}: {column} = {row[column]!r} is not a number") from None
