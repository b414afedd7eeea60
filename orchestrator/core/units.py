"""Numbers with units, as people write them in a case file: ``"1350 MW"``, ``"100 us"``."""

import math
import re
from functools import cache
from threading import Lock
from typing import Any

_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)\s*(?P<unit>[^\d\s,.][^\s,]*)?\s*"
)
_POWERS = {"W", "VA", "var"}
_ANGLES = ("radian", "degree", "arcminute", "arcsecond", "grade", "mil", "turn", "revolution")
_TURNS = ("turn", "revolution")

USUAL: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "Hz": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6},
    "MW": {"MW": 1.0, "W": 1e-6, "kW": 1e-3, "GW": 1e3},
    "MVA": {"MVA": 1.0, "VA": 1e-6, "kVA": 1e-3, "GVA": 1e3},
    "Mvar": {"Mvar": 1.0, "var": 1e-6, "kvar": 1e-3, "Gvar": 1e3},
    "kV": {"kV": 1.0, "V": 1e-3},
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "deg": {"deg": 1.0},
    "pu": {"pu": 1.0},
}
"""Declared unit → factor of the units that it is usually given in. They are pint's own factors, to the last bit: a case
that is written in them is read without pint, which takes half a second to import.
"""

_PER_SECOND = "1 Hz is 2π rad/s, or 60 rpm"


_building = Lock()


def _registry() -> Any:
    """One registry for all threads: pint does not convert from one registry to another."""
    with _building:
        return _built_registry()


@cache
def _built_registry() -> Any:
    import pint  # noqa: PLC0415 - half a second to import; see `USUAL`

    registry: Any = pint.UnitRegistry()
    registry.define("per_unit = [per_unit] = pu")
    registry.define("volt_ampere = volt * ampere = VA")
    registry.define("volt_ampere_reactive = volt * ampere = var")
    return registry


LARGEST = 1e100  # of a number in a file, below which products of some are numbers still


def read_value(text: str) -> bool | float | str:
    """A truth value, a number, or text such as ``500 ms``, as options and ranges give it."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text


def whole_percent(part: float, whole: float = 1.0) -> str:
    """A part of a whole in percent, without decimals: ``28 %``."""
    return f"{100 * part / whole:.0f} %"


def to_unit(value: float | int | str, unit: str) -> float:
    """Convert a value to the unit that is declared for it.

    ``value``: A number, which is taken to be in ``unit`` already, or a text such as ``"1350 MW"``.
    ``unit``: the declared unit; ``"1"`` or ``""`` for a plain number."""
    if isinstance(value, int | float):
        return float(value)
    parts = _QUANTITY.fullmatch(value)
    if parts is None:
        raise ValueError(
            f"{value!r} is not a number with a unit; write it like '0.9 GW', with a decimal point"
        )
    number, given = float(parts["number"]), parts["unit"]
    if not given:
        return number
    needed = "a plain number" if unit in ("", "1") else unit
    declared = "dimensionless" if unit in ("", "1") else unit
    if {_kind(given), _kind(unit)} & _POWERS and _kind(given) != _kind(unit):
        # one dimension, three quantities
        raise ValueError(f"{value!r} is in {given}, but {needed} is needed")
    factor = USUAL.get(declared, {}).get(given)
    if factor is None:
        try:
            alike = _counts_alike(given, declared)
            if pint_value(0.0, given, declared):  # such as °C and K, which differ in their zero
                return float(f"{pint_value(number, given, declared):.15g}")
            factor = pint_factor(given, declared)
        except Exception as error:  # pint lets its parser's errors through
            if type(error).__name__ == "DimensionalityError":
                raise ValueError(f"{value!r} is in {given}, but {needed} is needed") from error
            raise ValueError(f"{value!r}: the unit {given!r} is unknown") from error
        if not alike:
            raise ValueError(f"{value!r} is in {given}, but {needed} is needed; {_PER_SECOND}")
    return float(f"{number * factor:.15g}")  # "100 us" is 1e-4 s and not 9.999999999999999e-05


def pint_factor(given: str, declared: str) -> float:
    """Return what one of the given units is in the declared one, as pint has it; raises pint's errors."""
    return pint_value(1, given, declared)


def pint_value(value: float, given: str, declared: str) -> float:
    """A value in another unit, as pint has it; raises pint's errors."""
    return float(_registry().Quantity(value, given).to(declared).magnitude)


def _kind(unit: str) -> str:
    """``MW`` → ``W``: a unit of power without its prefix."""
    return next(
        (power for power in sorted(_POWERS, key=len, reverse=True) if unit.endswith(power)), unit
    )


def _counts_alike(given: str, needed: str) -> bool:
    """Tell if two units of one dimension both count cycles, both count angles, or neither; pint takes a cycle and a
    radian for 1 both, and would lose the 2π between them."""
    one, other = (_registry().Quantity(1, unit) for unit in (given, needed))
    (cycles, angles, turns), (cycles_needed, angles_needed, turns_needed) = map(
        _count_cycles, (one, other)
    )
    turned = (turns and not angles_needed) or (turns_needed and not angles)
    return cycles == cycles_needed and not turned


def _count_cycles(quantity: Any) -> tuple[float, bool, bool]:
    """Power of the hertz in a unit, and whether it has angles, and whole turns."""
    powers = {str(name): float(power) for name, power in quantity.unit_items()}
    cycles = sum(power for name, power in powers.items() if name.endswith("hertz"))
    angles, turns = (
        any(part in name for name in powers for part in parts) for parts in (_ANGLES, _TURNS)
    )
    return cycles, angles, turns


def base_exponents(unit: str) -> tuple[float, dict[str, int]] | None:
    """Factor to SI and exponents of the SI base units, by FMI's names; None for a unit that is not known.

    Examples
    --------
    ``kV`` is (1000.0, {"kg": 1, "m": 2, "s": -3, "A": -1}).
    """
    names = {
        "kilogram": "kg",
        "meter": "m",
        "second": "s",
        "ampere": "A",
        "kelvin": "K",
        "mole": "mol",
        "candela": "cd",
        "radian": "rad",
    }
    try:
        quantity = _registry().Quantity(1, unit).to_base_units()
        factor = float(quantity.magnitude) - base_offset(unit)
    except Exception:  # pint lets its parser's errors through; an unknown unit is nothing to check
        return None
    powers = {names.get(str(name)): power for name, power in quantity.unit_items()}
    if None in powers or any(power != int(power) for power in powers.values()):
        return None
    return factor, {str(name): int(power) for name, power in powers.items()}


def base_offset(unit: str) -> float:
    """Return what 0 of a known unit is in SI base units: 273.15 for ``degC``, 0 for most."""
    return float(_registry().Quantity(0, unit).to_base_units().magnitude)
