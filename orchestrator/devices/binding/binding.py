"""Bindings: what a foreign FMU's variables mean at our port, read from ``vendor.toml`` and checked with their units."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import cos, radians, sin
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.errors import BindingError, ErrorKind, Problem
from orchestrator.core.toml_files import fault_of, read_toml
from orchestrator.core.units import to_unit
from orchestrator.devices.binding.scales import (
    PER_UNIT,
    Bases,
    UnitsDifferError,
    amount,
    angle_unit_of,
    unit_of,
)
from orchestrator.devices.binding.tables import BindingTable, PhasorTable, SignalTable, StartTable
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo, read_description
from orchestrator.devices.fmi.port_mapping import (
    START,
    BoundDescription,
    Form,
    Matrix2,
    PhasorMap,
    PortMap,
    SignalMap,
    StartMap,
)

_FORMS = {
    "rectangular": Form.RECTANGULAR,
    "dq": Form.RECTANGULAR,
    "qd": Form.RECTANGULAR,
    "polar": Form.POLAR,
    "abc": Form.ABC,
    "power": Form.POWER,
}
_FREQUENCY = ("omega", "frequency")
_POWER = ("delta_p_pod", "delta_q_pod", "pod_p.limit", "pod_q.limit")  # [pu, S_n]
_OF_POWER = ("W", "var", "VA")  # ends of units of power
_SWITCH = ".enabled"  # end of our names of Boolean variables, such as ``pod_p.enabled``


def bound_fmu(fmu: Path | str, binding: Path | str | None = None) -> FmuDescription:
    """Describe an FMU, through a binding where one is given.

    The description can be added to a `System` or given to `open_component`; behind a binding it has the variables of
    our port."""
    description = read_description(fmu)
    return description if binding is None else bind(description, binding)


def bind(fmu: FmuDescription, binding: Path | str) -> BoundDescription:
    path = Path(binding)
    table = read_table(path)
    described = BoundDescription.of(fmu, _Reader(fmu, table, str(path)).port_map())
    return replace(described, kind=table.fmu.kind or described.kind)


def read_table(path: Path) -> BindingTable:
    _, raw = read_toml(path, "the binding", "`gfor fmu bind FILE.fmu` drafts one")
    try:
        return BindingTable.model_validate(raw)
    except ValidationError as error:
        raise BindingError(str(path), [_problem(detail) for detail in error.errors()]) from error


def _problem(detail: Any) -> Problem:
    place = ".".join(
        str(part) for part in detail["loc"] if part not in ("StartTable", "list[StartTable]")
    )
    return Problem(place, fault_of(detail))


class _Reader:
    def __init__(self, fmu: FmuDescription, table: BindingTable, source: str) -> None:
        self._fmu, self._table, self._source = fmu, table, source
        self._problems: list[Problem] = []

    def port_map(self) -> PortMap:
        table = self._table
        with self._at("fmu.guid"):
            if table.fmu.guid is not None and table.fmu.guid != self._fmu.guid:
                raise ValueError(
                    f"the binding is for the FMU {table.fmu.guid}, this one is {self._fmu.guid}; draft it anew"
                )
        bases = self._bases()
        port = None
        if bases is not None:
            own_rating = "S_n" in table.start
            voltage, current = self._voltage(bases), self._current(bases, own_rating)
            start, signals, settings = (
                self._start(bases, own_rating),
                self._signals(bases),
                self._settings(),
            )
            if voltage is not None and current is not None:
                port = PortMap(
                    bases.rating,
                    bases.frequency,
                    voltage=voltage,
                    current=current,
                    start=start,
                    signals=signals,
                    settings=settings,
                    current_limit=self._current_limit(),
                    V_n=bases.voltage,
                    frequency_range=self._frequency_range(bases),
                )
                self._check_once(port)
        if self._problems or port is None:
            raise BindingError(self._source, self._problems)
        return port

    @contextmanager
    def _at(self, place: str) -> Iterator[None]:
        try:
            yield
        except ValueError as error:
            kind = ErrorKind.UNITS if isinstance(error, UnitsDifferError) else ErrorKind.VALUES
            self._problems.append(Problem(place, str(error), kind))

    def _variable(self, name: str, *causalities: str, kind: str = "Real") -> VariableInfo:
        info = self._fmu.variables.get(name)
        if info is None:
            raise ValueError(
                f"the FMU has no variable {name!r}; `gfor fmu info {self._fmu.path.name}` lists them"
            )
        if causalities and info.causality not in causalities:
            raise ValueError(
                f"{name} is of causality {info.causality}; {' or '.join(causalities)} is needed here"
            )
        if info.type != kind:
            raise ValueError(f"{name} is of type {info.type}; {kind} is needed here")
        return info

    def _bases(self) -> Bases | None:
        rating = self._table.rating
        bases = None
        with self._at("rating"):
            V_n = None if rating.V_n is None else amount(rating.V_n, "kV", "V_n")
            bases = Bases(amount(rating.S_n, "MVA", "S_n"), V_n, amount(rating.f_n, "Hz", "f_n"))
        return bases

    def _current_limit(self) -> float | None:
        declared = self._table.rating.I_max
        with self._at("rating"):
            limit = (
                None if declared is None else to_unit(str(declared).removesuffix("pu").strip(), "1")
            )
            if limit is not None and not 0 < limit < 100:
                raise ValueError(
                    f"I_max = {declared}; it must be above 0 and below 100, in pu of the rated current"
                )
            return limit
        return None

    def _frequency_range(self, bases: Bases) -> float | None:
        declared = self._table.rating.frequency_range
        if declared is None:
            return None
        with self._at("rating"):
            found = amount(declared, "Hz", "frequency_range") / bases.frequency
            if not 0 < found < 1:
                raise ValueError(
                    f'frequency_range = {declared}; it must be above 0 and below f_n, such as "0.2 Hz"'
                )
            return found
        return None

    def _phasor(
        self,
        place: str,
        table: PhasorTable,
        causality: str,
        scale: Callable[[str, VariableInfo], float],
    ) -> tuple[Form, Matrix2, float]:
        """Form, matrix from our frame [pu, rating] to the FMU's axes, and angle factor."""
        form = _FORMS[table.form]
        needed = 3 if form is Form.ABC else 2
        if len(table.variables) != needed or len(set(table.variables)) != needed:
            raise ValueError(
                f"form {table.form!r} needs {needed} different variables; there are {', '.join(table.variables)}"
            )
        infos = [self._variable(name, causality) for name in table.variables]
        scaled = infos[:1] if form is Form.POLAR else infos
        scales = [scale(unit_of(info, table.unit), info) for info in scaled]
        if max(scales) - min(scales) > 1e-12 * max(scales):
            raise ValueError(f"{' and '.join(table.variables)} are not in one unit")
        signs = list(table.signs or [1] * needed)
        if len(signs) != needed:
            raise ValueError(f"'signs' needs {needed} values, one for each variable")
        if form in (Form.POLAR, Form.ABC) and any(s != 1 for s in signs):
            raise ValueError(
                "'signs' are for rectangular axes and powers; turn a frame with 'frame_angle'"
            )
        if table.form == "qd":
            signs[1] = -signs[1]  # f = f_q − j·f_d
        angle = radians(to_unit(table.frame_angle, "deg"))
        if form is Form.POWER and angle:
            raise ValueError("powers have no frame; remove 'frame_angle'")
        k, (s0, s1) = scales[0], signs[:2]
        matrix = (
            s0 * k * cos(angle),
            s0 * -k * sin(angle),
            s1 * k * sin(angle),
            s1 * k * cos(angle),
        )
        return form, matrix, self._angle_factor(form, table, infos)

    @staticmethod
    def _angle_factor(form: Form, table: PhasorTable, infos: list[VariableInfo]) -> float:
        if form is not Form.POLAR:
            if table.angle_unit is not None:
                raise ValueError(f"'angle_unit' has no meaning for form {table.form!r}; remove it")
            return 1.0
        unit = angle_unit_of(infos[1], table.angle_unit)
        return to_unit("1 rad", unit) if unit != PER_UNIT else 1.0

    def _voltage(self, bases: Bases) -> PhasorMap | None:
        table, found = self._table.voltage, None
        with self._at("voltage"):
            if table.form == "power":
                raise ValueError(
                    "form 'power' is for [current]; a voltage is rectangular, dq, qd, polar or abc"
                )
            if table.direction != "into the grid":
                raise ValueError("'direction' is for [current]; remove it")

            def scale(unit: str, info: VariableInfo) -> float:
                return bases.voltage_unit(unit, table.base, _phase(table), info.name)

            form, matrix, angle_factor = self._phasor("voltage", table, "input", scale)
            if table.moment is not None and form is not Form.ABC:
                raise ValueError("'moment' is for form 'abc', whose values turn; remove it")
            moment = 0.0 if table.moment == "begin" else 0.5
            names = tuple(table.variables)
            found = PhasorMap(form, names, matrix, angle_factor, per_rating=False, moment=moment)
        return found

    def _current(self, bases: Bases, own_rating: bool) -> PhasorMap | None:
        table, found = self._table.current, None
        with self._at("current"):
            if table.moment is not None:
                raise ValueError("'moment' is for [voltage]; remove it")

            def scale(unit: str, info: VariableInfo) -> float:
                if table.form == "power":
                    return bases.power_unit(unit, table.base, info.name)
                return bases.current_unit(unit, table.base, _phase(table), info.name)

            form, to_fmu, angle_factor = self._phasor("current", table, "output", scale)
            direction = 1.0 if table.direction == "into the grid" else -1.0
            # On the 100 MVA base of the network, for one unit of the rating as delivered.
            factor = direction * bases.rating / SYSTEM_BASE_MVA
            # Signs of powers act on P and Q, before the current is taken from them.
            matrix = (
                self._power_matrix(to_fmu, factor)
                if form is Form.POWER
                else _inverse(to_fmu, factor)
            )
            per_unit = unit_of(self._variable(table.variables[0]), table.unit) == PER_UNIT
            per_rating = not own_rating or (per_unit and table.base in (None, "S_n"))
            found = PhasorMap(form, tuple(table.variables), matrix, angle_factor, per_rating)
        return found

    @staticmethod
    def _power_matrix(to_fmu: Matrix2, factor: float) -> Matrix2:
        """For i = conj(s/v), which is linear in P and Q only as long as both have one sign."""
        if to_fmu[0] * to_fmu[3] < 0:
            raise ValueError("P and Q need one sign; turn both with 'direction'")
        return (factor / to_fmu[0], 0.0, 0.0, factor / to_fmu[3])

    def _start(self, bases: Bases, own_rating: bool) -> dict[str, tuple[StartMap, ...]]:
        found = {}
        for name, tables in self._table.start.items():
            maps = []
            for table in tables if isinstance(tables, list) else [tables]:
                with self._at(f"start.{name}"):
                    if name not in START:
                        raise ValueError(
                            f"there is no start value of that name; choose from {', '.join(START)}"
                        )
                    maps.append(self._start_map(name, table, bases, own_rating))
            found[name] = tuple(maps)
        return found

    def _start_map(self, name: str, table: StartTable, bases: Bases, own_rating: bool) -> StartMap:
        info = self._variable(table.variable, "parameter", "input")
        if name == "theta_0":
            unit = angle_unit_of(info, table.unit)
            offset = radians(to_unit(self._table.voltage.frame_angle, "deg"))
            factor = 1.0 if unit == PER_UNIT else to_unit("1 rad", unit)
            return StartMap(info.name, table.sign * factor, table.sign * factor * offset)
        unit = unit_of(info, table.unit)
        if name == "S_n":
            return StartMap(
                info.name, bases.power_unit(unit, table.base or "1 MVA", info.name) / bases.rating
            )
        if name == "v_0":
            return StartMap(info.name, bases.voltage_unit(unit, table.base, table.value, info.name))
        absolute = unit != PER_UNIT or table.base not in (None, "S_n")
        power = table.sign * bases.power_unit(unit, table.base, info.name)
        return StartMap(info.name, power, 0.0, absolute and own_rating)

    def _signals(self, bases: Bases) -> dict[str, SignalMap]:
        found = {}
        for name, table in self._table.signals.items():
            with self._at(f"signals.{name}"):
                found[name] = self._signal(name, table, bases)
        return found

    def _signal(self, name: str, table: SignalTable, bases: Bases) -> SignalMap:
        if name.endswith(_SWITCH):
            return self._switch(table)
        info = self._variable(table.variable)
        if name in _FREQUENCY:
            return SignalMap(
                info.name,
                1 / bases.frequency_unit(unit_of(info, table.unit), info.name),
                0.0,
                PER_UNIT,
            )
        plain = table.unit is None and info.unit == "1"
        if name in _POWER and not plain:
            unit = unit_of(info, table.unit)
            if unit == PER_UNIT or unit.endswith(_OF_POWER):
                whole = bases.power_unit(unit, table.base, info.name)
                absolute = unit != PER_UNIT or table.base not in (None, "S_n")
                per_rating = absolute and "S_n" in self._table.start
                return SignalMap(info.name, 1 / whole, 0.0, PER_UNIT, per_rating)
        return SignalMap(info.name, 1.0, 0.0, "1" if plain else unit_of(info, table.unit))

    def _switch(self, table: SignalTable) -> SignalMap:
        info = self._variable(table.variable, "parameter", "input", kind="Boolean")
        if table.unit is not None or table.base is not None:
            raise ValueError(
                f"{info.name} is a Boolean, which has no unit and no base; remove them"
            )
        return SignalMap(info.name, 1.0, 0.0, "")

    def _settings(self) -> dict[str, float | bool]:
        found: dict[str, float | bool] = {}
        for group, causality in (("parameters", "parameter"), ("inputs", "input")):
            for name, value in getattr(self._table, group).items():
                with self._at(f"{group}.{name}"):
                    info = self._fmu.variables.get(name)
                    if info is None or info.causality != causality or info.type == "String":
                        raise ValueError(
                            f"the FMU has no {causality} of that name that takes a number"
                        )
                    found[name] = value if isinstance(value, bool) else to_unit(value, info.unit)
        return found

    def _check_once(self, port: PortMap) -> None:
        """Each variable may be bound once, and the start values must give finite numbers."""
        used = [*port.voltage.variables, *port.current.variables, *port.settings]
        used += [m.variable for maps in port.start.values() for m in maps]
        twice = sorted({name for name in used if used.count(name) > 1})
        if twice:
            self._problems.append(
                Problem("", f"{', '.join(twice)}: bound more than once; a variable has one meaning")
            )
        if not all(math.isfinite(x) for x in (*port.voltage.matrix, *port.current.matrix)):
            self._problems.append(
                Problem("rating", "rating and bases give no finite factors; check their units")
            )


def _phase(table: PhasorTable) -> str | None:
    """Kind of the phasor's amplitude. For three phases it is the phase peak, because their variables are instantaneous
    values."""
    return "phase peak" if table.form == "abc" else table.value


def _inverse(m: Matrix2, factor: float) -> Matrix2:
    determinant = (m[0] * m[3] - m[1] * m[2]) / factor
    return m[3] / determinant, -m[1] / determinant, -m[2] / determinant, m[0] / determinant
