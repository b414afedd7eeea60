"""Operating points from a CSV file: one row each."""

import fnmatch
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from orchestrator.cases.flow.sharing import load_of
from orchestrator.cases.form.csv_rows import PLACE, Row, place_of, rows_of
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, Problem, few
from orchestrator.core.given_files import ShownFile
from orchestrator.core.units import read_value
from orchestrator.studies.operating_points.point_columns import (
    ACTIVE,
    IN_SERVICE,
    Elements,
    Reading,
    Setting,
    feeding_loads,
    least_scale,
    own_power,
    reading_of,
)

_LABELS = ("time", "name")
# times smaller than the case's own is a whole column of powers that is asked about
_ANOTHER_UNIT = 25.0
_LEFT = 0.05  # part of the case's load that is asked about where points leave it to the slack


_FACTORS = ("generation", "static")  # columns whose values for a unit other columns go before
_SCALES = ("scale", "fed_scale")
_TRACE = 1e-5  # scale of a load up to which it is off, and keeps a voltage at most


@dataclass(frozen=True)
class OperatingCase:
    name: str  # time or name of the row
    hours: float  # how long the point lasts [h]; the weight in duration curves
    values: dict[str, Value]  # by ``component.variable``
    out: tuple[str, ...]  # elements out of service
    place: str


def read_points(path: Path, prepared: PreparedScenario, elements: Elements) -> list[OperatingCase]:
    """The operating points of a file, for one scenario.

    Raises an `InputError` with file and line: if a column or a cell has no meaning, a name is missing or repeated, two
    columns set one value or switch one element, or there is no row."""
    rows, label, meant = _labelled(path)
    readings = {name: _reading(path, name, elements, prepared) for name in meant}
    seen: dict[str, str] = {}
    found = []
    for row in rows:
        point = _point(row, label, readings, elements, prepared)
        if point.name in seen:
            raise InputError(
                f"{point.place}: {label} = {point.name!r} stands in {seen[point.name]} already"
            )
        seen[point.name] = point.place
        found.append(point)
    return found


def settings_in(path: Path) -> dict[str, dict[str, Value]]:
    """Values by point, of a file whose columns are variables; an empty cell leaves the variable as it is. A device,
    which is no variable, stands in each row or in none."""
    rows, label, columns = _labelled(path)
    found: dict[str, dict[str, Value]] = {}
    for row in rows:
        name = _name_of(row, label)
        if folder_of(name) in map(folder_of, found):
            raise InputError(
                f"{place_of(row)}: {label} = {name!r} stands in an earlier row, or shares its folder"
            )
        if "device" in columns and not row["device"].strip():
            raise InputError(
                f"{place_of(row)}: device is empty; name the scan that is judged at {name}"
            )
        found[name] = {
            column: read_value(text) for column in columns if (text := row[column].strip())
        }
    return found


def folder_of(point: str) -> str:
    return re.sub(r"[^\w.+-]", "_", point)


def _labelled(path: Path) -> tuple[list[Row], str, list[str]]:
    """Rows, the column that names them, and those with what differs."""
    rows = rows_of(path, ())
    if not rows:
        raise InputError(
            f"{ShownFile.of(path)}: it has no row; give one for each operating point, with a column 'time' or 'name'"
        )
    columns = [name for name in rows[0] if name and name != PLACE]
    label = next((name for name in _LABELS if name in columns), None)
    if label is None:
        raise InputError(
            f"{ShownFile.of(path)}: column 'time' or 'name' is missing; it names the operating points"
        )
    return rows, label, [name for name in columns if name not in (label, "hours")]


def _name_of(row: Row, label: str) -> str:
    if row.get(None):  # type: ignore[call-overload]
        raise InputError(f"{place_of(row)}: the row has more cells than the first line has columns")
    name = (row[label] or "").strip()
    if not name:
        raise InputError(f"{place_of(row)}: {label} is empty; it names the operating point")
    return name


def questions_about(
    path: Path, points: Sequence[OperatingCase], prepared: PreparedScenario, elements: Elements
) -> Iterator[Problem]:
    """Questions about a file that `read_points` has read: powers that cannot act, or look like pu, or that nobody but
    the slack feeds."""
    rows = rows_of(path, ())
    for column in rows[0]:
        place = f"{ShownFile.of(path).at_line(1)}: column {column!r}"
        own = own_power(column, elements, prepared)
        cells = [text for row in rows if (text := (row[column] or "").strip())]
        most = max((abs(float(text)) for text in cells if own), default=0.0)
        units = elements.balancing_in(column)
        if cells and units:
            left = f"cannot act on {', '.join(units)}: {elements.slack} is the slack and feeds what is left"
            yield Problem(place, f"{left}; leave it out, or name another slack in [power_flow]")
        elif own and 0 < _ANOTHER_UNIT * most < abs(own):
            unit = "MW" if column.endswith(ACTIVE) else "Mvar"
            text = f"at most {most:g} {unit}, where the case itself has {own:.4g} {unit}; are these values in pu?"
            yield Problem(place, text)
    yield from _static_question(path, rows[0], prepared, elements)
    feeding = [unit for unit in elements.units if unit not in elements.balancing]
    fed = {unit: own_power(f"{unit}.{ACTIVE}", elements, prepared) or 0.0 for unit in feeding}
    load = load_of(elements.loads, prepared.system.components[elements.grid])
    # a factor of 1 for generation leaves it to the slack by intention
    leaves = {
        point.name: _share_of_slack(point, prepared, elements, fed, load)
        for row, point in zip(rows, points, strict=True)
        if float((row.get("generation") or "").strip() or 0) != 1
    }
    worst = max(leaves, key=lambda name: abs(leaves[name]), default="")
    more = leaves.get(worst, 0.0)
    if abs(more) > _LEFT * abs(load):
        who = ", ".join(elements.balancing) or elements.slack
        text = f"at {worst} the slack ({who}) feeds {abs(more):.4g} MW {'more' if more > 0 else 'less'}, as the other"
        remedy = "add UNIT.P_mw or a factor 'generation', 1 where the slack is meant"
        yield Problem(str(path), f"{text} units' powers do not follow the load there: {remedy}")


def _static_question(
    path: Path, row: Row, prepared: PreparedScenario, elements: Elements
) -> Iterator[Problem]:
    feeding = feeding_loads(elements, prepared)
    if "load" not in row or "static" in row or not feeding:
        return
    who = few([f"{name} ({power:.4g} MW)" for name, power in feeding.items()], 3)
    yield Problem(
        f"{ShownFile.of(path).at_line(1)}: column 'load'",
        f"does not scale static generation, loads that feed: {who}; a column 'static' gives their factor: 1 leaves "
        "them as they are, the value of 'load' scales them alike",
    )


def _share_of_slack(
    point: OperatingCase,
    prepared: PreparedScenario,
    elements: Elements,
    others: Mapping[str, float],
    load: float,
) -> float:
    """Return what a point leaves to the slack [MW] of what the loads draw more and units out of service fed; 0 where
    that is nearer to the slack's own share than to all of it. ``others``: units beside the slack's, and what each
    feeds."""
    wanted, given = _drawn(point, prepared, elements) - load, 0.0
    for unit, power in others.items():
        switches = f"{unit}.connected", f"{elements.grid}.{unit}.connected"
        if unit in point.out or any(point.values.get(switch) is False for switch in switches):
            wanted += power
        elif f"{unit}.P_0" in point.values or f"{unit}.S_n" in point.values:
            rating = prepared.system.components[unit].number("S_n")
            per_unit = point.values.get(f"{unit}.P_0", power / rating)
            given += float(per_unit) * float(point.values.get(f"{unit}.S_n", rating)) - power
    share = min(max(1 - sum(others.values()) / load, 0.0), 1.0) if load else 0.0
    return (
        wanted - given if others and wanted and (wanted - given) / wanted > (1 + share) / 2 else 0.0
    )


def _drawn(point: OperatingCase, prepared: PreparedScenario, elements: Elements) -> float:
    """Active power of the loads at a point [MW]."""
    plan, head = prepared.system.components[elements.grid], f"{elements.grid}."
    own = {
        k.removeprefix(head): v
        for k, v in point.values.items()
        if k.startswith(head) and not isinstance(v, str)
    }
    return load_of(
        [x for x in elements.loads if x not in point.out],
        replace(plan, parameters=plan.parameters | own),
    )


def _reading(path: Path, column: str, elements: Elements, prepared: PreparedScenario) -> Reading:
    try:
        return reading_of(column, elements, prepared)
    except InputError as error:
        raise InputError(f"{ShownFile.of(path).at_line(1)}: column {column!r}: {error}") from error


def _point(
    row: Row,
    label: str,
    readings: dict[str, Reading],
    elements: Elements,
    prepared: PreparedScenario,
) -> OperatingCase:
    place = place_of(row)
    name = _name_of(row, label)
    settings: dict[str, Setting] = {}
    for column, reading in readings.items():
        text = (row[column] or "").strip()
        if text:
            try:
                settings[column] = reading(text)
            except ValueError as error:
                raise InputError(f"{place}: {error}") from error
    out = tuple(dict.fromkeys(element for setting in settings.values() for element in setting.out))
    _check_slack(out, elements, place)
    _check_switches(settings, elements, place)
    values = _Values(place)
    for column in _FACTORS:
        if column in settings:
            values.take(column, settings[column].values)
    for column, setting in settings.items():
        values.take(column, {} if column in _FACTORS else setting.values)
    for column, setting in settings.items():
        if setting.fed is not None:
            values.take(column, _fed(column, *setting.fed, out, prepared, values.found, place))
    feeding = feeding_loads(elements, prepared)
    scale, fed_scale = (_first(getattr(one, name) for one in settings.values()) for name in _SCALES)
    columns = {load: "static" if load in feeding else "load" for load in elements.loads}
    factors = {"load": scale, "static": fed_scale, "": None}
    columns |= dict.fromkeys(
        prepared.device_loads, ""
    )  # DC lines and the like have a power of their own
    scales = {
        load: _scale_of(
            load,
            factors[column],
            column=column,
            elements=elements,
            prepared=prepared,
            values=values.found,
            place=place,
        )
        for load, column in columns.items()
    }
    for load, column in columns.items():
        if factors[column] is not None:
            values.take(column, {f"{elements.grid}.{load}.scale": scales[load]})
    for column, setting in settings.items():
        for key, power in setting.drawn.items():
            values.take(column, {key: _unscaled(column, power, scales[key.split(".")[-2]], place)})
    idle = {f"{unit}.P_0" for unit in elements.balancing}  # as `questions_about` says
    acting = {key: value for key, value in values.found.items() if key not in idle}
    return OperatingCase(name, _hours(row, place), acting, out, place)


class _Values:
    """The values of a row, each from one column."""

    def __init__(self, place: str) -> None:
        self.found: dict[str, Value] = {}
        self._place, self._by = place, dict[str, str]()

    def take(self, column: str, values: Mapping[str, Value]) -> None:
        """Add a column's values; a unit's own power goes before the factor of all, `_FACTORS` in their order."""
        for key, value in values.items():
            if self._by.get(key, _FACTORS[0]) not in _FACTORS:
                both = f"the columns {self._by[key]} and {column} both set {key}; leave one of them empty"
                raise InputError(f"{self._place}: {both}")
            self.found[key], self._by[key] = value, column


def _fed(
    column: str,
    members: tuple[str, ...],
    power: float,
    out: tuple[str, ...],
    prepared: PreparedScenario,
    values: Mapping[str, Value],
    place: str,
) -> dict[str, Value]:
    """P_0 of the units in service that together feed a power [MW]."""
    feeding = [unit for unit in members if unit not in out]
    if not feeding:
        if power:
            raise InputError(
                f"{place}: {column} = {power:g}, but {', '.join(members)} is out of service; write 0"
            )
        return {}
    ratings = (
        values.get(f"{unit}.S_n", prepared.system.components[unit].number("S_n"))
        for unit in feeding
    )
    rating = sum(float(r) for r in ratings)
    return {f"{unit}.P_0": power / rating for unit in feeding}


def _first(given: Iterator[float | None]) -> float | None:
    return next((one for one in given if one is not None), None)


def _scale_of(
    load: str,
    scale: float | None,
    column: str,
    elements: Elements,
    prepared: PreparedScenario,
    values: Mapping[str, Value],
    place: str,
) -> float:
    key = f"{elements.grid}.{load}.scale"
    if scale is not None and key in values:
        raise InputError(
            f"{place}: the columns {column} and {key} both scale {load}; leave one of them empty"
        )
    grid = prepared.system.components[elements.grid]
    own = grid.number(f"{load}.scale")
    if scale is None:
        return float(values.get(key, own))
    return max(scale * own, least_scale(load, grid))


def _unscaled(column: str, power: float, scale: float, place: str) -> float:
    if scale <= _TRACE:
        raise InputError(
            f"{place}: {column} = {power:g}, but the load is switched off (its scale is 0)"
        )
    return power / scale


def _hours(row: Row, place: str) -> float:
    text = (row.get("hours") or "1").strip()
    try:
        hours = float(text)
    except ValueError:
        hours = float("nan")
    if not 0 < hours < float("inf"):
        raise InputError(
            f"{place}: hours = {text!r}; it must be a number above 0: how long the point lasts"
        )
    return hours


def _check_switches(settings: Mapping[str, Setting], elements: Elements, place: str) -> None:
    switched = {
        column.partition(".")[0]: column for column in settings if column.endswith(f".{IN_SERVICE}")
    }
    for column in settings:
        for name, other in switched.items():
            switches = (f"{name}.connected", f"{elements.grid}.{name}.connected")
            if any(fnmatch.fnmatchcase(switch, column) for switch in switches):
                both = (
                    f"the columns {other} and {column} both switch {name}; leave one of them empty"
                )
                raise InputError(f"{place}: {both}")


def _check_slack(out: tuple[str, ...], elements: Elements, place: str) -> None:
    left = {bus for unit, bus in elements.units.items() if unit not in out}
    if elements.slack and elements.slack not in left:
        raise InputError(
            f"{place}: all units at the slack bus {elements.slack} are out of service, "
            "so nothing feeds what is left; take another slack in [power_flow]"
        )
