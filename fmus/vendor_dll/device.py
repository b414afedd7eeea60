"""A device's file: which DLL it is, what circuit lies around it, and what the DLL's signals mean there."""

import math
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast, get_args

from fmus.toolchain.model import Model
from fmus.vendor_dll.circuit import (
    BASES,
    MEASURED,
    REFERENCES,
    BridgeKind,
    FilterKind,
    converter_circuit,
)
from fmus.vendor_dll.interface import DATA_TYPES, DllInterface, DllParameter, Place, layout

_KEYS = {
    "dll",
    "filter",
    "delay",
    "unit",
    "circuit",
    "inputs",
    "bridge",
    "start",
    "parameters",
    "texts",
}
_PARTS = {
    # unit -> how many of it are in one kV, kA or MVA
    "voltage": {"V": 1e3, "kV": 1.0, "MV": 1e-3},
    "current": {"A": 1e3, "kA": 1.0},
    "power": {
        p + unit: factor
        for p, factor in (("", 1e6), ("k", 1e3), ("M", 1.0))
        for unit in ("W", "VA", "var")
    },
}
_MEASURED_KIND = (
    dict.fromkeys(MEASURED[:6], "voltage")
    | dict.fromkeys(MEASURED[6:], "current")
    | dict.fromkeys(("P_ref", "Q_ref", "p_u", "q_u", "p", "q"), "power")
)
"""Signals that can be given in the DLL's own unit."""

# in per unit alone: whether a unit would mean a peak or an rms value, nothing says
_PER_UNIT = ("V_ref", "u", "i_s")

_WORDS_FOR_PER_UNIT = ("pu", "p.u.", "p.u", "PU")


class DeviceFileError(ValueError):
    """A device's file cannot be used."""


@dataclass(frozen=True)
class Route:
    """One value that goes from the circuit to the DLL, or back."""

    place: Place
    quantity: str
    base: str | None  # parameter of the circuit with which it is multiplied; None for none
    factor: float


@dataclass(frozen=True)
class Device:
    dll: Path
    filter_kind: FilterKind
    bridge: BridgeKind
    measured: tuple[Route, ...]
    driven: tuple[Route, ...]  # the three signals of the bridge
    # start values of inputs that the circuit does not give, by name.
    constants: Mapping[str, float] = field(default_factory=dict)
    # values of the DLL's parameters, instead of its defaults.
    parameters: Mapping[str, float] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    # default values of the circuit's parameters
    circuit: Mapping[str, float] = field(default_factory=dict)
    # whether a signal of the bridge is applied one sample after it was computed
    delay: bool = False
    trims: tuple[str, ...] = ("P", "Q")  # which references are trimmed at the start: of P, Q, V
    # longest_start, first_trim, trim_time: how long the start may take, when trimming begins, and its time constant
    # [s].
    longest_start: float = 20.0
    first_trim: float = 1.0
    trim_time: float = 0.1
    voltage_per_q: float = 0.2  # trim of V for a trim of Q

    def around(self, name: str) -> Model:
        made = converter_circuit(name, self.filter_kind, self.bridge)
        known = {p.name: p for p in made.parameters if p.type == "Real"}
        for key, value in self.circuit.items():
            if key not in known:
                raise DeviceFileError(
                    f"[circuit] {key}: the circuit has no such parameter; it has: {', '.join(known)}"
                )
            low, high = known[key].minimum, known[key].maximum
            if (low is not None and value < low) or (high is not None and value > high):
                raise DeviceFileError(f"[circuit] {key} = {value}; allowed is {low} to {high}")
        changed = [
            replace(p, start=self.circuit[p.name]) if p.name in self.circuit else p
            for p in made.parameters
        ]
        return replace(made, parameters=tuple(changed))


def read_device_file(path: Path) -> tuple[Path, dict[str, Any]]:
    """The DLL that a device's file names, and the whole table."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DeviceFileError(
            f"{path}: cannot be read: {error.strerror}; give a device's file, which lays a circuit around a DLL"
        ) from error
    except (ValueError, RecursionError) as error:
        raise DeviceFileError(f"{path}: it is not TOML: {error}") from error
    unknown = sorted(table.keys() - _KEYS)
    if unknown:
        raise DeviceFileError(
            f"{path}: {unknown[0]!r} is no key here; there are: {', '.join(sorted(_KEYS))}"
        )
    if not isinstance(table.get("dll"), str):
        raise DeviceFileError(
            f"{path}: 'dll' is missing: the path of the vendor's file, such as dll = \"vendor.so\""
        )
    return path.parent / table["dll"], table


def device_of(path: Path, table: Mapping[str, Any], interface: DllInterface) -> Device:
    try:
        return _Reader(table, interface).device(path.parent / table["dll"])
    except ValueError as error:
        raise DeviceFileError(f"{path}: {error}") from error


class _Reader:
    """Works out the tables; a mistake is a ValueError."""

    def __init__(self, table: Mapping[str, Any], interface: DllInterface) -> None:
        self._table, self._interface = table, interface
        self._own = self._unit()

    def _unit(self) -> dict[str, float]:
        """The DLL's bases [kV, kA, MVA], where it controls one of several units in parallel."""
        part = self._part("unit")
        if not part:
            return {}
        if part.keys() != {"S_n", "V_n"}:
            raise ValueError(
                "[unit] needs S_n [MVA] and V_n [kV] of the one unit that the DLL controls"
            )
        S_n, V_n = (_finite(part[name], f"[unit] {name}") for name in ("S_n", "V_n"))
        if S_n <= 0 or V_n <= 0:
            raise ValueError(f"[unit] S_n = {S_n}, V_n = {V_n}; both must be above 0")
        peak = math.sqrt(2 / 3)
        return {"voltage": V_n * peak, "current": S_n / V_n * peak, "power": S_n}

    def device(self, dll: Path) -> Device:
        kind = self._table.get("filter", "LC")
        if kind not in get_args(FilterKind):
            raise ValueError(
                f"filter = {kind!r}; it must be one of: {', '.join(get_args(FilterKind))}"
            )
        delay = self._table.get("delay", 0)
        if delay not in (0, 1) or isinstance(delay, bool):
            raise ValueError(
                f"delay = {delay!r}; it must be 0 or 1 samples between a computation and its effect"
            )
        measured, constants = self._inputs()
        bridge, driven = self._bridge()
        known = {p.name: p for p in self._interface.parameters}
        return Device(
            dll=dll,
            filter_kind=kind,
            bridge=bridge,
            measured=tuple(measured),
            driven=tuple(driven),
            constants=constants,
            parameters=self._parameters(known),
            texts=self._texts(known),
            circuit=self._circuit(),
            delay=bool(delay),
            **self._start(measured),
        )

    def _circuit(self) -> dict[str, float]:
        found = {}
        for name, value in _flat(self._part("circuit")):
            found[name] = _finite(value, f"[circuit] {name}")
        if self._own:  # the voltage of all units is that of one
            found.setdefault("V_n", float(self._part("unit")["V_n"]))
        return found

    def _part(self, name: str) -> Mapping[str, Any]:
        part = self._table.get(name, {})
        if not isinstance(part, dict):
            raise ValueError(f"[{name}] must be a table")
        return part

    def _inputs(self) -> tuple[list[Route], dict[str, float]]:
        places = {
            place.name: place
            for place in layout(self._interface.inputs).places
            if place.type.kind != "String"
        }
        measured, constants = [], {}
        for name, given in self._part("inputs").items():
            where = f"[inputs] {name}"
            if name not in places:
                raise ValueError(f"{where}: the DLL has no such input; it has: {', '.join(places)}")
            if isinstance(given, int | float) and not isinstance(given, bool):
                constants[name] = _finite(given, where)
                continue
            entry = {"from": given} if isinstance(given, str) else given
            if (
                not isinstance(entry, dict)
                or entry.keys() - {"from", "unit", "sign"}
                or "from" not in entry
            ):
                raise ValueError(
                    f'{where}: give a number, a quantity of the circuit, or {{ from = "u_a", unit = "kV" }}'
                )
            measured.append(self._route(where, places[name], entry))
        if not any(route.quantity in MEASURED for route in measured):
            raise ValueError(
                f"[inputs]: none of the DLL's inputs is measured; the circuit gives: {', '.join(MEASURED)}"
            )
        return measured, constants

    def _route(self, where: str, place: Place, entry: Mapping[str, Any]) -> Route:
        quantity, row = entry["from"], place.row
        if quantity == "V_dc":
            return Route(
                place,
                quantity,
                None,
                _factor(where, "voltage", entry.get("unit", row.unit)) * _sign(where, entry),
            )
        if quantity not in (*_MEASURED_KIND, *_PER_UNIT):
            known = ", ".join((*_MEASURED_KIND, *_PER_UNIT, "V_dc"))
            raise ValueError(f"{where}: the circuit has no quantity {quantity!r}; it has: {known}")
        unit = entry.get("unit", row.unit)
        if unit in _WORDS_FOR_PER_UNIT:
            return Route(place, quantity, None, _sign(where, entry))
        if quantity in _PER_UNIT:
            raise ValueError(
                f'{where}: {quantity} is given in pu alone, and the unit here is {unit!r}; add unit = "pu"'
            )
        kind = _MEASURED_KIND[quantity]
        factor = _factor(where, kind, unit) * _sign(where, entry)
        if self._own:
            return Route(place, quantity, None, factor * self._own[kind])
        return Route(place, quantity, BASES[kind], factor)

    def _bridge(self) -> tuple[BridgeKind, list[Route]]:
        part = self._part("bridge")
        kinds = [kind for kind in get_args(BridgeKind) if kind in part]
        if len(kinds) != 1 or part.keys() - {"unit", *get_args(BridgeKind)}:
            raise ValueError(
                '[bridge]: give one of modulation = ["m_a", "m_b", "m_c"] and voltage = [...], and a unit'
            )
        (kind,) = kinds
        names = part[kind]
        if (
            not isinstance(names, list)
            or [type(name) for name in names] != [str] * 3
            or len({*names}) != 3
        ):
            raise ValueError(
                f"[bridge] {kind}: three different outputs of the DLL are needed, for phases a, b and c"
            )
        places = {
            place.name: place
            for place in layout(self._interface.outputs).places
            if place.type.kind != "String"
        }
        routes = []
        for letter, name in zip("abc", names, strict=True):
            where = f"[bridge] {name}"
            if name not in places:
                raise ValueError(
                    f"{where}: the DLL has no such output; it has: {', '.join(places)}"
                )
            base, factor, unit = None, 1.0, part.get("unit", places[name].row.unit)
            if kind == "voltage" and unit in _WORDS_FOR_PER_UNIT:
                base = BASES["voltage"]
            elif kind == "voltage":
                factor = 1 / _factor(where, "voltage", unit)
            routes.append(Route(places[name], f"bridge.{letter}", base, factor))
        return cast(BridgeKind, kind), routes

    def _parameters(self, known: Mapping[str, DllParameter]) -> dict[str, float]:
        values = {}
        for name, value in self._part("parameters").items():
            where = f"[parameters] {name}"
            if name not in known or DATA_TYPES[known[name].data_type].kind == "String":
                raise ValueError(
                    f"{where}: the DLL has no such parameter that is a number; it has: {', '.join(known)}"
                )
            row = known[name]
            values[name] = _finite(value, where)
            low, high = row.minimum, row.maximum
            if (low is not None and values[name] < low) or (
                high is not None and values[name] > high
            ):
                raise ValueError(f"{where} = {value}; the DLL allows {low} to {high}")
        return values

    def _texts(self, known: Mapping[str, DllParameter]) -> dict[str, str]:
        texts = self._part("texts")
        for name, value in texts.items():
            if (
                name not in known
                or DATA_TYPES[known[name].data_type].kind != "String"
                or not isinstance(value, str)
            ):
                raise ValueError(
                    f"[texts] {name}: the DLL has no such parameter that is text, or the value is no text"
                )
        return dict(texts)

    def _start(self, measured: list[Route]) -> dict[str, Any]:
        part = dict(self._part("start"))
        times = {
            "longest": "longest_start",
            "trim_after": "first_trim",
            "trim_time": "trim_time",
            "voltage_per_q": "voltage_per_q",
        }
        unknown = sorted(part.keys() - {"trims", *times})
        if unknown:
            raise ValueError(f"[start] {unknown[0]}: there are: trims, {', '.join(times)}")
        given = {route.quantity for route in measured}
        usual = [letter for letter in ("P", "Q") if f"{letter}_ref" in given]
        trims = part.pop("trims", usual if "Q" in usual or "V_ref" not in given else [*usual, "V"])
        if (
            not isinstance(trims, list)
            or set(map(str, trims)) - {"P", "Q", "V"}
            or {"Q", "V"} <= set(trims)
        ):
            raise ValueError(
                f'[start] trims = {trims!r}; it must be a list of "P" and one of "Q" and "V"'
            )
        idle = [letter for letter in trims if f"{letter}_ref" not in given]
        if idle:
            raise ValueError(
                f"[start] trims: {idle[0]}_ref goes to no input of the DLL; the references are: "
                f"{', '.join(REFERENCES)}"
            )
        found: dict[str, Any] = {
            times[key]: _seconds(value, f"[start] {key}") for key, value in part.items()
        }
        return found | {"trims": tuple(trims)}


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _finite(value: object, where: str) -> float:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not abs(value) <= sys.float_info.max
    ):
        raise ValueError(f"{where} = {value!r}; it must be a finite number")
    return float(value)


def _seconds(value: object, where: str) -> float:
    if isinstance(value, str) and (found := re.fullmatch(r"\s*([0-9.eE+-]+)\s*s\s*", value)):
        value = float(found[1])
    number = _finite(value, where)
    if not 0 < number <= 1000:
        raise ValueError(f"{where} = {value!r}; it must be above 0, and 1000 at most")
    return number


def _sign(where: str, entry: Mapping[str, Any]) -> float:
    sign = entry.get("sign", 1)
    if sign not in (1, -1):
        raise ValueError(f"{where}: sign = {sign!r}; it must be 1 or -1")
    return float(sign)


def _factor(where: str, kind: str, unit: str) -> float:
    if not isinstance(unit, str) or unit not in _PARTS[kind]:
        known = ", ".join([*_PARTS[kind], "pu"])
        raise ValueError(
            f"{where}: the unit {unit!r} is none of a {kind}; say what it is with unit = ..., one of: {known}"
        )
    return _PARTS[kind][unit]
