"""Remarks on the columns of a record that no place uses, each with its likeliest meaning."""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches

from orchestrator.core.errors import few

QUANTITIES = ("vm", "va", "im", "ia", "p", "q")
"""What a column may hold: magnitude and angle of a voltage and of a current, P and Q."""

COLUMN = re.compile(rf"(?P<place>.+?)[ ._:](?P<what>{'|'.join(QUANTITIES)})", re.IGNORECASE)

_SPLIT = re.compile(r"(?P<place>.+)[ ._:](?P<what>[^ ._:]+)")
_OTHER_WORDS = {
    "v": "vm",
    "u": "vm",
    "um": "vm",
    "voltage": "vm",
    "vmag": "vm",
    "vang": "va",
    "ua": "va",
    "angle": "va",
    "theta": "va",
    "phase": "va",
    "i": "im",
    "current": "im",
    "imag": "im",
    "iang": "ia",
    "power": "p",
    "mw": "p",
    "mvar": "q",
}
"""How others call the same quantities."""

_SHOWN = 8  # names in one remark
_NEAR = 0.6  # how alike two names are at least, from 0 to 1


def remarks_on_unused(
    names: Sequence[str], columns: Mapping[str, Mapping[str, object]], used: set[str]
) -> list[str]:
    """Tell which columns no place uses.

    ``columns``: by place what was read of it; ``used``: places whose columns are all in use."""
    return [*_misread(names, columns), *_incomplete(columns, used)]


def _misread(names: Sequence[str], columns: Mapping[str, Mapping[str, object]]) -> Iterator[str]:
    """A remark on each column whose name is nearly one of a quantity, and one on all others."""
    unknown = []
    for name in names:
        if COLUMN.fullmatch(name):
            continue
        meant = _likeliest(name, columns)
        if meant:
            yield f"the column {name!r} is not used: is {meant!r} meant?"
        else:
            unknown.append(repr(name))
    if unknown:
        yield (
            f"{len(unknown)} columns are not used, as their names do not end in .vm, .va, .im, .ia, .p or .q: "
            f"{few(unknown, _SHOWN)}"
        )


def _likeliest(name: str, columns: Mapping[str, Mapping[str, object]]) -> str:
    """The name that was probably meant; "" if none is near."""
    parts = _SPLIT.fullmatch(name)
    if parts is None:
        return ""
    place, what = parts["place"], parts["what"].lower()
    known = {one.casefold(): one for one in columns}
    place = known.get(place.casefold(), place)
    there = set(columns.get(place, {}))
    missing = [quantity for quantity in QUANTITIES if quantity not in there]
    other = _OTHER_WORDS.get(what, "")
    near = [other] if other in missing else get_close_matches(what, missing, 1, _NEAR)
    return f"{place}.{near[0]}" if near else ""


def _incomplete(columns: Mapping[str, Mapping[str, object]], used: set[str]) -> Iterator[str]:
    """A remark for each set of quantities that places lack, with the places."""
    lacking: dict[str, list[str]] = {}
    for place, own in columns.items():
        if place in used:
            continue
        bus = place.partition("->")[0].strip()
        lack = _lacked({*own, *columns.get(bus, {})})
        # a misspelt name makes a place of its own, which has what the meant one lacks
        rest = [one for one, its in columns.items() if one != place and not {*own} & {*its}]
        near = [one for one in rest if one.casefold() == place.casefold()]
        near = near or get_close_matches(place, rest, 1, _NEAR)
        if near:
            lack += f"; is {near[0]!r} meant?"
        lacking.setdefault(lack, []).append(place)
    for lack, places in lacking.items():
        yield f"{few(places, _SHOWN)}: left out, without {lack}"


def _lacked(there: set[str]) -> str:
    voltage = [f".{what}" for what in ("vm", "va") if what not in there]
    power = [f".{what}" for what in ("p", "q") if what not in there]
    current = not {"im", "ia"} - there
    lack = voltage + ([] if current else power)
    return " and ".join(lack) or "power of its own"
