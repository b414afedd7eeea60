"""The case that `gfor new` is asked for: its files, its converters and the choices about them."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.units import to_unit


@dataclass(frozen=True)
class WantedConverter:
    """``bus 9, 300 MVA, 200 MW, less sg3``; ``less`` is the machine that feeds so much less, or, with ``instead of``,
    that it replaces."""

    bus: str
    rating_mva: float
    p_mw: float
    less: str | None = None
    replaces: bool = False


@dataclass(frozen=True)
class WantedCase:
    """The case that `gfor new` is asked for: a vendor's ``device`` stands in place of our converter, ``models`` (emt,
    phasor) is chosen where None, ``command`` is as it was typed."""

    files: tuple[Path, ...]
    out: Path
    converters: tuple[WantedConverter, ...] = ()
    device: Path | None = None
    binding: Path | None = None
    is_dll: bool = False
    models: str | None = None
    frequency: str | None = None
    slack: str | None = None
    leave_out: tuple[str, ...] = ()
    dyr_leave_out: tuple[str, ...] = ()
    reactive_limits: bool = False
    dyr_approximate: bool = False
    replace: tuple[str, ...] = ()
    load_parts: bool = True
    move_controls: bool = False
    widen_limits: bool = True
    command: str = "gfor new"

    @property
    def kind(self) -> str:
        """A vendor's file has no phasor form."""
        return self.models or ("phasor" if self.device is None else "emt")

    @property
    def options(self) -> dict[str, tuple[str, ...]]:
        """Return the values that were given by option."""
        return {
            Option.SLACK: (self.slack,) if self.slack else (),
            Option.FREQUENCY: (self.frequency,) if self.frequency else (),
            Option.LEAVE_OUT: self.leave_out,
            Option.DYR_LEAVE_OUT: self.dyr_leave_out,
            Option.REPLACE: self.replace,
        }


def read_converter(text: str) -> WantedConverter:
    """Read ``bus 9, 300 MVA, 200 MW, less sg3``, in any order.

    Raises `InputError` with what is missing, given twice or not understood."""
    how = "write it like 'bus 9, 300 MVA, 200 MW, less sg3' (or 'instead of sg3'; the last part may be left out)"
    found: dict[str, str] = {}
    replaces = False
    for part in (part.strip() for part in text.split(",")):
        quantity = re.fullmatch(r"[-+\d.eE]+\s*(MVA|GVA|kVA|MW|GW|kW)", part)
        word, _, rest = part.partition(" ")
        if quantity is not None:
            key = "MVA" if quantity[1].endswith("VA") else "MW"
        elif word in ("bus", "less") and rest.strip():
            key = word
        elif part.startswith("instead of "):
            key, rest, replaces = "less", part.removeprefix("instead of "), True
        elif re.fullmatch(r"bus_\w+", part):
            key, rest = "bus", part
        else:
            raise InputError(Option.CONVERTER + f" {text!r}: {part!r} is not understood; {how}")
        if key in found:
            raise InputError(Option.CONVERTER + f" {text!r}: {key} is given twice; {how}")
        found[key] = part if quantity is not None else rest.strip()
    missing = {"bus": "bus", "MVA": "rating in MVA", "MW": "power in MW"}
    lacks = [words for key, words in missing.items() if key not in found]
    if lacks:
        raise InputError(
            Option.CONVERTER + f" {text!r}: the {' and the '.join(lacks)} is missing; {how}"
        )
    rating, power = to_unit(found["MVA"], "MVA"), to_unit(found["MW"], "MW")
    if not 0 < rating < math.inf or not abs(power) <= rating:
        raise InputError(
            Option.CONVERTER + f" {text!r}: {power:g} MW with a rating of {rating:g} MVA; {how}"
        )
    if 0 < abs(power) < 0.01 * rating:
        raise InputError(
            Option.CONVERTER
            + f" {text!r}: {power:g} MW is {100 * power / rating:.2g} % of its rating; is "
            f"{1000 * power:g} MW meant? A converter that only holds the voltage has 0 MW"
        )
    return WantedConverter(found["bus"], rating, power, found.get("less"), replaces)
