"""Units and bases: the factors from our units to those of an FMU."""

from math import sqrt

from orchestrator.core.units import to_unit
from orchestrator.devices.fmi.description import VariableInfo

PER_UNIT = "pu"
_NO_UNIT = {"", "1", "-", "pu", "p.u.", "p.u", "PU", "per unit", "per_unit"}
_VALUES = {
    "line-to-line rms": 1.0,
    "line-to-line peak": sqrt(2),
    "phase rms": 1 / sqrt(3),
    "phase peak": sqrt(2 / 3),
}


class UnitsDifferError(ValueError):
    """A binding gives another unit than the FMU declares."""


def angle_unit_of(info: VariableInfo, given: str | None) -> str:
    """The same of an angle, whose unit 1 may be radians or degrees."""
    if given is None and info.unit == "1":
        raise ValueError(
            f'the FMU declares {info.name} in the unit 1, which says nothing of an angle; add "rad" or "deg"'
        )
    return unit_of(info, given)


def unit_of(info: VariableInfo, given: str | None) -> str:
    """The unit of an FMU's variable from the binding or the declaration; both must agree if both give one.

    The unit 1 is per unit here, unless the binding says more."""
    declared = info.unit
    if given is None:
        if declared in ("", "-"):
            raise ValueError(
                f'the FMU declares no unit for {info.name}; add the key \'unit\', such as "pu" or "kV"'
            )
        return PER_UNIT if declared in _NO_UNIT else declared
    given = PER_UNIT if given in _NO_UNIT else given
    if declared in ("", "1", "-"):
        return given
    if (given == PER_UNIT) != (declared in _NO_UNIT) or (
        given != PER_UNIT and factor(declared, given, info.name) != 1
    ):
        raise UnitsDifferError(
            f"unit = {given!r}, but the FMU declares {info.name} in {declared!r}; give the declared one, "
            "or have the FMU's modelDescription.xml corrected"
        )
    return given


def factor(unit: str, target: str, name: str) -> float:
    try:
        return to_unit(f"1 {unit}", target)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def amount(text: str | float, unit: str, what: str) -> float:
    """A number from text with a unit, which is required."""
    try:
        value = to_unit(text, unit)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    if not 0 < value < float("inf"):
        raise ValueError(f"{what} = {text}; it must exceed 0")
    return value


class Bases:
    """Rating and rated voltage of an FMU, and the factors from its units to per unit."""

    def __init__(self, rating: float, voltage: float | None, frequency: float) -> None:
        self.rating, self.voltage, self.frequency = rating, voltage, frequency

    def _v_n(self, why: str) -> float:
        if self.voltage is None:
            raise ValueError(
                f'{why} needs the rated voltage; add V_n under [rating], such as "230 kV"'
            )
        return self.voltage

    def voltage_unit(self, unit: str, base: str | None, value: str | None, name: str) -> float:
        """Number of the FMU's units in 1 pu of voltage.

        ``base``: voltage of 1 pu, such as ``"220 kV"``; V_n where None. Only the unit pu has a base.
        ``value``: kind of value, such as ``"phase peak"``; required for every unit except pu."""
        if unit == PER_UNIT:
            if base in (None, "V_n"):
                return 1.0
            return self._v_n("a base of its own") / amount(base or "", "kV", f"{name}: base")
        if value not in _VALUES:
            raise ValueError(
                f"{name}: a voltage in {unit} needs the key 'value', one of: {', '.join(_VALUES)}"
            )
        return self._v_n(f"a voltage in {unit}") * _VALUES[value] * factor("kV", unit, name)

    def current_unit(self, unit: str, base: str | None, value: str | None, name: str) -> float:
        """Number of the FMU's units in 1 pu of current on the rating.

        ``base``: power of the base, such as ``"100 MVA"``; S_n where None. Only the unit pu has a base.
        ``value``: ``"rms"`` or ``"peak"``; required for every unit except pu."""
        if unit == PER_UNIT:
            return self.rating / self._power_base(base, name)
        peak = {"rms": 1.0, "phase rms": 1.0, "peak": sqrt(2), "phase peak": sqrt(2)}
        if value not in peak:
            raise ValueError(
                f"{name}: a current in {unit} needs the key 'value', one of: rms, peak"
            )
        kiloampere = self.rating / (sqrt(3) * self._v_n(f"a current in {unit}"))
        return kiloampere * peak[value] * factor("kA", unit, name)

    def power_unit(self, unit: str, base: str | None, name: str) -> float:
        if unit == PER_UNIT:
            return self.rating / self._power_base(base, name)
        for mega in ("MW", "Mvar", "MVA"):
            if unit.endswith(mega.lstrip("M")):
                return self.rating * factor(mega, unit, name)
        raise ValueError(
            f"{name}: {unit!r} is not a unit of power; use pu, W, var or VA with their prefixes"
        )

    def frequency_unit(self, unit: str, name: str) -> float:
        if unit == PER_UNIT:
            return 1.0
        if "Hz" in unit:
            return self.frequency * factor("Hz", unit, name)
        return 2 * 3.141592653589793 * self.frequency * factor("rad/s", unit, name)

    def _power_base(self, base: str | None, name: str) -> float:
        return self.rating if base in (None, "S_n") else amount(base or "", "MVA", f"{name}: base")
