"""The systems that a study of interactions compares, each by the devices that stand at its places."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, product

from orchestrator.cases.form.devices import Device
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.interactions.exchange import file_at, stand_in_at, vendors_device_at
from orchestrator.studies.interactions.places import Place, first_of, vendors_of

MOST_ASSIGNMENTS = 64
"""So many assignments of devices to places are computed at most: all of three devices at three places, with room."""

MOST_VENDORS = 12  # so many vendors are compared at most: 66 pairs


class Kind(StrEnum):
    WHOLE = "as in the case"
    NONE = "no vendor"
    ALONE = "alone"
    PAIR = "pair"
    ASSIGNMENT = "assignment"


@dataclass(frozen=True)
class SystemName:
    """A system: whose converters it has, or which device stands at each of the places that are swapped."""

    kind: Kind
    names: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        match self.kind:
            case Kind.ALONE:
                return f"{self.names[0]} alone"
            case Kind.PAIR | Kind.ASSIGNMENT:
                return " + ".join(self.names)
            case _:
                return str(self.kind)


WHOLE, NONE = SystemName(Kind.WHOLE), SystemName(Kind.NONE)

# what stands at a place in place of the case's own device, by component
Exchanged = dict[str, ComponentTable]


def systems_of_vendors(places: Mapping[str, Place], model: str) -> dict[SystemName, Exchanged]:
    vendors = vendors_of(places)
    if len(vendors) > MOST_VENDORS:
        count = len(vendors)
        raise InputError(
            f"the scenario has converters of {count} vendors, which make {count * (count - 1) // 2} pairs; at most "
            f"{MOST_VENDORS} are compared: give converters of one make one name by the key 'vendor'"
        )

    def only(kept: tuple[str, ...]) -> Exchanged:
        return {
            name: stand_in_at(place, model)
            for name, place in places.items()
            if place.vendor not in kept
        }

    found = {WHOLE: Exchanged(), NONE: only(())}
    found |= {SystemName(Kind.ALONE, (vendor,)): only((vendor,)) for vendor in vendors}
    return found | {SystemName(Kind.PAIR, pair): only(pair) for pair in combinations(vendors, 2)}


def assignments(
    places: Mapping[str, Place], at: Sequence[str], given: Sequence[Device]
) -> dict[SystemName, Exchanged]:
    templates = first_of({name: places[name] for name in at})
    # those at places that are not swapped as well
    vendors = {place.vendor for place in places.values()}
    twice = [device.name for device in given if device.name in vendors]
    if twice:
        raise InputError(
            Option.DEVICE
            + f" {twice[0]}: a vendor of the case has this name already; give another one, "
            "as in NAME=FILE"
        )
    devices = [*templates, *(device.name for device in given)]
    if len(devices) < 2:
        raise InputError(
            f"there is nothing to swap: the only device at {', '.join(at)} is of "
            f"{devices[0]}; give others by " + Option.DEVICE
        )
    count = len(devices) ** len(at)
    if count > MOST_ASSIGNMENTS:
        raise InputError(
            f"{len(devices)} devices at {len(at)} places make {count} assignments, more "
            f"than the {MOST_ASSIGNMENTS} that are computed; name fewer places by "
            + Option.PLACE
            + f" (there are: {', '.join(at)}), or give fewer devices"
        )
    files = {device.name: device for device in given}

    def at_place(place: Place, device: str) -> ComponentTable | None:
        if device in files:
            one = files[device]
            return file_at(place, one.file, one.binding, one.values)
        return None if device == place.vendor else vendors_device_at(place, templates[device])

    found = {}
    for chosen in product(devices, repeat=len(at)):
        tables = {
            name: at_place(places[name], device) for name, device in zip(at, chosen, strict=True)
        }
        kept = {name: table for name, table in tables.items() if table is not None}
        found[SystemName(Kind.ASSIGNMENT, chosen)] = kept
    return found
