"""Units as the files of an SSP define them; a definition counts, whatever its name usually means."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose
from xml.etree.ElementTree import Element

from orchestrator.core.errors import InputError
from orchestrator.core.units import base_exponents, base_offset, to_unit
from orchestrator.systems.ssp.names import children

_EQUAL = 1e-5  # relative, of two factors; people round those of degrees and of inches


@dataclass(frozen=True)
class UnitDefinition:
    """A unit in SI base units: ``factor``·x + ``offset``, with the exponents of the base units that are not 0."""

    factor: float
    offset: float
    exponents: Mapping[str, int]

    def equals(self, other: "UnitDefinition", *, angles: bool = True) -> bool:
        """``angles``: whether the radian counts, which many definitions leave out."""
        return (
            isclose(self.factor, other.factor, rel_tol=_EQUAL)
            and isclose(self.offset, other.offset, rel_tol=_EQUAL)
            and self._powers(angles) == other._powers(angles)
        )

    def _powers(self, angles: bool) -> dict[str, int]:
        return {base: power for base, power in self.exponents.items() if angles or base != "rad"}

    def __str__(self) -> str:
        powers = (
            base if power == 1 else f"{base}^{power}" for base, power in self.exponents.items()
        )
        shift = f" + {self.offset:g}" if self.offset else ""
        return f"{self.factor:g} {'·'.join(powers) or '1'}{shift}"


def units_in(root: Element, group: str) -> dict[str, dict[str, str]]:
    """Attributes of ``BaseUnit`` by unit; ``group`` is the name of the group of units, such as ``ssv:Units``."""
    found = {}
    for unit in children(root, f"{group}/ssc:Unit"):
        base = next(iter(children(unit, "ssc:BaseUnit")), None)
        found[unit.get("name", "")] = {} if base is None else dict(base.attrib)
    return found


def defined(name: str, base: Mapping[str, str] | None) -> UnitDefinition | None:
    """The unit that attributes of ``BaseUnit`` define; None if there are none, as where a tool knows the name alone."""
    if not base:
        return None
    try:
        powers = {key: int(text) for key, text in base.items() if key not in ("factor", "offset")}
        factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
    except ValueError as error:
        raise InputError(
            f"the definition of the unit {name!r} holds what is no number: {error}; export it again"
        ) from error
    return UnitDefinition(factor, offset, {key: power for key, power in powers.items() if power})


def usual(name: str) -> UnitDefinition | None:
    """Return what a unit of this name usually is; None for one that is not known."""
    found = base_exponents(name)
    return None if found is None else UnitDefinition(found[0], base_offset(name), found[1])


def between(
    value: float,
    given: tuple[str, UnitDefinition | None],
    needed: tuple[str, UnitDefinition | None],
) -> float | str:
    """A value in the unit that is needed, or as text with the unit that is given where the names say it all.

    ``given``, ``needed``: name and definition of the two units.

    Raises
    ------
    InputError
        If a definition has to decide, and the two are no units of one quantity."""
    (name, own), (target_name, target) = given, needed
    if own is None or (name == target_name and (target is None or own.equals(target))):
        return value if name == target_name else f"{value!r} {name}"
    target = target or usual(target_name)
    written = not name[:1].isdigit()  # as 1/ms, before which no number can stand
    if written and _by_name(name, own) and _by_name(target_name, target) and name != target_name:
        return f"{value!r} {name}"
    if target is None or own.exponents != target.exponents:
        what = "is not known" if target is None else f"is {target}"
        raise InputError(
            f"{value:g} {name}: the unit {name!r} is defined as {own}, and {target_name or 'no unit'!r}, in which the "
            f"FMU has it, {what}; give the value in that unit"
        )
    return float(f"{(value * own.factor + own.offset - target.offset) / target.factor:.15g}")


def conversion(
    given: tuple[str, Mapping[str, str] | None], needed: tuple[str, Mapping[str, str] | None]
) -> tuple[float, float]:
    """Factor and offset from one unit to another, for a value on a connection.

    ``given``, ``needed``: name of a unit, and the attributes of ``BaseUnit`` that define it where its file does.

    Raises
    ------
    InputError
        If the two are no units of one quantity, or one is not known."""
    (name, base), (target_name, target_base) = given, needed
    own, target = defined(name, base), defined(target_name, target_base)
    if name == target_name and (own is None or target is None or own.equals(target, angles=False)):
        return 1.0, 0.0
    if _by_name(name, own) and _by_name(target_name, target) and not name[:1].isdigit():
        try:
            offset = to_unit(f"0 {name}", target_name)
            return float(f"{to_unit(f'1 {name}', target_name) - offset:.15g}"), offset
        except ValueError as error:
            raise InputError(f"{name} and {target_name} are no units of one quantity") from error
    own, target = own or usual(name), target or usual(target_name)
    for unit, meaning in ((name, own), (target_name, target)):
        if meaning is None:
            raise InputError(f"the unit {unit!r} is not known, and no file defines it")
    if own is None or target is None or own.exponents != target.exponents:
        raise InputError(
            f"{name} ({own}) and {target_name} ({target}) are no units of one quantity"
        )
    return (
        float(f"{own.factor / target.factor:.15g}"),
        float(f"{(own.offset - target.offset) / target.factor:.15g}"),
    )


def contradiction(name: str, base: Mapping[str, str] | None) -> str:
    """That a definition says something else than the name usually means; "" if it does not."""
    own, known = defined(name, base), usual(name)
    if own is None or known is None or own.equals(known, angles=False):
        return ""
    return (
        f"the unit {name!r} is defined as {own}, where its name usually means {known}; the definition counts, "
        "as SSP has it: is it meant?"
    )


def _by_name(name: str, unit: UnitDefinition | None) -> bool:
    """Return whether the name of a unit says what its definition does."""
    known = usual(name)
    return known is not None and (unit is None or unit.equals(known, angles=False))
