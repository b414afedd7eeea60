"""Whose converter stands where, and what each other component of a system is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.form.schema import ComponentTable
from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.system import ComponentPlan

# groups of components that are nobody's converter
GENERATORS = "generators"
GRID = "grid"
OTHERS = "others"  # components without a port, such as a controller

NOT_VENDORS = (GENERATORS, GRID, OTHERS)

_CURRENT = {"i_re", "i_im"}  # what a network takes at each port


@dataclass(frozen=True)
class Place:
    name: str
    vendor: str
    table: ComponentTable
    plan: ComponentPlan


def places_of(
    components: Mapping[str, tuple[ComponentTable, ComponentPlan]], grid: str | None
) -> dict[str, Place]:
    """The converters of a scenario, by their component.

    A converter's vendor is the ``vendor`` of its table, else the name of its file, else its model."""
    found = {}
    for name, (table, plan) in components.items():
        if name == grid or not plan.has_port or (table.vendor is None and plan.kind != "converter"):
            continue
        vendor = table.vendor or (
            Path(table.file).stem if table.file is not None else table.model or ""
        )
        if vendor in NOT_VENDORS:
            raise InputError(
                f"components.{name}: its vendor is {vendor!r}, which is what a group of other components is called; "
                "give another name by its key 'vendor'"
            )
        found[name] = Place(name, vendor, table, plan)
    return found


def groups_of(
    components: Mapping[str, tuple[ComponentTable, ComponentPlan]],
    places: Mapping[str, Place],
    grid: str | None,
) -> dict[str, str]:
    def group(name: str, table: ComponentTable, plan: ComponentPlan) -> str:
        if name in places:
            return places[name].vendor
        if plan.kind == "machine":
            return GENERATORS
        gives_voltage = {*plan.description.inputs} >= _CURRENT
        return GRID if name == grid or plan.kind in ("network", "load") or gives_voltage else OTHERS

    return {name: group(name, table, plan) for name, (table, plan) in components.items()}


def by_group(shares: Mapping[str, float], groups: Mapping[str, str]) -> dict[str, float]:
    """The participation of every group in a mode, largest first; it sums to 1 as the components' does.

    ``groups``: of every component; one that is not there counts to `OTHERS`."""
    found: dict[str, float] = {}
    for name, share in shares.items():
        group = groups.get(name, OTHERS)
        found[group] = found.get(group, 0.0) + share
    return dict(sorted(found.items(), key=lambda entry: -entry[1]))


def vendors_of(places: Mapping[str, Place]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(place.vendor for place in places.values()))


def first_of(places: Mapping[str, Place]) -> dict[str, Place]:
    found: dict[str, Place] = {}
    for place in places.values():
        found.setdefault(place.vendor, place)
    return found
