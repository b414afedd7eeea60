"""Which columns of a table are the voltage, its angle, P and Q of a device, and in which units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.units import to_unit

if TYPE_CHECKING:
    import xarray as xr

ROLES = {
    "time": "time of the samples",
    "v": "magnitude of the voltage",
    "angle": "angle of the voltage",
    "f": "frequency of the voltage",
    "va": "voltage of phase a",
    "vb": "voltage of phase b",
    "vc": "voltage of phase c",
    "p": "active power into the grid",
    "q": "reactive power into the grid",
    "ia": "current of phase a into the grid",
    "ib": "current of phase b into the grid",
    "ic": "current of phase c into the grid",
    "i": "magnitude of the current into the grid",
    "i_angle": "angle of the current into the grid",
}
"""What a recording may hold, by the name of its channel."""

_NAMES = {
    "time": (),
    "v": ("v", "vm", "u", "um", "vmag", "voltage", "v_mag", "v1", "u1", "vpos", "v_pos"),
    "angle": ("angle", "va", "ua", "theta", "phi", "ang", "v_angle", "v_ang", "vang", "delta"),
    "f": ("f", "freq", "frequency", "hz"),
    "va": ("va", "ua", "v_a", "u_a", "ul1", "vl1", "v_l1", "u_l1"),
    "vb": ("vb", "ub", "v_b", "u_b", "ul2", "vl2", "v_l2", "u_l2"),
    "vc": ("vc", "uc", "v_c", "u_c", "ul3", "vl3", "v_l3", "u_l3"),
    "p": ("p", "pg", "power", "active_power", "p_active", "activepower"),
    "q": ("q", "qg", "reactive_power", "q_reactive", "reactivepower"),
    "ia": ("ia", "i_a", "il1", "i_l1"),
    "ib": ("ib", "i_b", "il2", "i_l2"),
    "ic": ("ic", "i_c", "il3", "i_l3"),
    "i": ("i", "im", "imag", "current", "i_mag", "i1", "ipos", "i_pos"),
    "i_angle": ("i_angle", "ia", "iang", "i_ang"),
}

_BASES = {
    "time": ("s",),
    "v": ("kV", "pu"),
    "angle": ("rad",),
    "f": ("Hz", "pu"),
    "p": ("MW", "pu"),
    "q": ("Mvar", "pu"),
    "i": ("kA", "pu"),
    "i_angle": ("rad",),
}
_BASES |= {f"v{x}": ("kV", "pu") for x in "abc"} | {f"i{x}": ("kA", "pu") for x in "abc"}
"""Units into which values of a channel are brought, the first that fits."""

_UNITS = {
    "pu": "pu",
    "kv": "kV",
    "deg": "deg",
    "rad": "rad",
    "hz": "Hz",
    "mw": "MW",
    "kw": "kW",
    "mvar": "Mvar",
    "kvar": "kvar",
    "ka": "kA",
    "degrees": "deg",
}
"""Ends of names that say a unit, in small letters, and the unit."""

_UNITS_OF_OTHER_POWER = {"MW": "Mvar", "kW": "kvar", "Mvar": "MW", "kvar": "kW"}
"""Units of active power and of reactive power that are of one size."""

_GIVEN = re.compile(r"(?P<factor>[-+]|[-+]?[\d.]+(?:[eE][-+]?\d+)?\*)?(?P<column>.+)")
_IN_UNIT = re.compile(r"(?P<column>.+) in (?P<unit>\S+)")


@dataclass(frozen=True)
class RecordedChannel:
    """A column of a recording, by what its values are multiplied, and their unit; "" where nothing says one."""

    role: str
    column: str
    factor: float = 1.0
    unit: str = ""

    def as_text(self) -> str:
        """Return the text that ``--channel`` takes."""
        signs = {1.0: "", -1.0: "-"}
        factor = signs.get(self.factor, f"{self.factor:.10g}*")
        unit = f" in {self.unit}" if self.unit else ""
        return f"{self.role}={factor}{self.column}{unit}"

    def changed(self, factor: float = 1.0, unit: str = "") -> str:
        """The same with another factor or unit, as ``--channel`` takes it."""
        return RecordedChannel(
            self.role, self.column, self.factor * factor, unit or self.unit
        ).as_text()

    def taken_for(self, role: str) -> str:
        """Return the column for another role, in that role's unit of the same size, as ``--channel`` takes it."""
        _, _, end = self.column.casefold().rpartition("_")
        unit = self.unit or _UNITS.get(end, "")
        return RecordedChannel(
            role, self.column, self.factor, _UNITS_OF_OTHER_POWER.get(unit, unit)
        ).as_text()


def read_channel(
    text: str, columns: Iterable[str], headings: Mapping[str, str] | None = None
) -> RecordedChannel:
    """``p=-P_total in kW``: a role, a sign or factor, a column of these, and a unit.

    ``headings``: the columns by their headings as the file has them, such as ``P_total [kW]``."""
    role, sign, rest = (part.strip() for part in text.partition("="))
    if not sign or role not in ROLES:
        raise InputError(
            Option.CHANNEL
            + f" {text}: write NAME=COLUMN with a name of {', '.join(ROLES)}, such as "
            "p=-P_total or 'angle=theta in rad'"
        )
    known, of_heading = list(columns), headings or {}
    rest = of_heading.get(rest, rest)
    whole, unit = rest, ""
    inner = _IN_UNIT.fullmatch(rest)
    if rest not in known and inner:
        whole, unit = inner["column"].strip(), inner["unit"]
        whole = of_heading.get(whole, whole)
    if whole in known:
        return RecordedChannel(role, whole, 1.0, unit)
    found = _GIVEN.fullmatch(whole)
    column = found["column"].strip() if found else ""
    column = of_heading.get(column, column)
    if not found or column not in known:
        raise InputError(
            Option.CHANNEL
            + f" {text}: the recording has no column {whole!r}; it has {', '.join(known)}"
        )
    factor = found["factor"] or ""
    return RecordedChannel(
        role, column, float(factor.rstrip("*") + ("1" if factor in "+-" else "")), unit
    )


def channels_in(
    dataset: xr.Dataset, place: str | None, given: Iterable[str], label: str
) -> dict[str, RecordedChannel]:
    """Find the channels of a recording: those that are given, and the others by their names.

    Raises an `InputError` if the voltage or the power is missing, or several columns may be one of them; it names what
    could be meant."""
    columns = [str(name) for name in dataset.data_vars]
    headings = {
        str(variable.attrs["long_name"]): str(name)
        for name, variable in dataset.variables.items()
        if "long_name" in variable.attrs
    }
    given_by = [read_channel(text, [*columns, "time"], headings) for text in given]
    found = {channel.role: channel for channel in given_by}
    several = {}
    # a frequency that is given stands for an angle that is not
    stands_for = {"angle"} if "f" in found and "angle" not in found else set()
    for role in ROLES:
        if role in found or role in stands_for:
            continue
        likely = [c for c in columns if _fits(role, c, dataset, place)]
        if len(likely) == 1:
            found[role] = RecordedChannel(role, likely[0])
        elif likely:
            several[role] = likely
    _require_whole(found, several, columns, label)
    return found


def _fits(role: str, column: str, dataset: xr.Dataset, place: str | None) -> bool:
    name, unit = _split_name(column, dataset)
    owner, dot, last = name.rpartition(".")
    if place and (not dot or owner != place.casefold()):
        return False
    if last not in _NAMES[role]:
        return False
    is_angle = unit in ("deg", "rad") or column.lower().endswith(("angle", "ang"))
    if last in ("va", "ua", "ia"):
        return is_angle == (role in ("angle", "i_angle"))
    return True


def _split_name(column: str, dataset: xr.Dataset) -> tuple[str, str]:
    """A column's name in small letters without its unit, and the unit; "" where nothing says one."""
    unit = str(dataset[column].attrs.get("units", "")).strip()
    name = column.strip().casefold().replace(" ", "_")
    head, _, last = name.rpartition("_")
    if head and last in _UNITS:
        return head, unit or _UNITS[last]
    return name, unit


def unit_of(channel: RecordedChannel, dataset: xr.Dataset) -> str:
    return channel.unit or _split_name(channel.column, dataset)[1]


def _require_whole(
    found: Mapping[str, RecordedChannel],
    several: Mapping[str, list[str]],
    columns: list[str],
    label: str,
) -> None:
    phases = {"va", "vb", "vc"} <= found.keys()
    lacking = []
    if not phases:
        lacking += [] if "v" in found else ["v"]
        lacking += [] if found.keys() & {"angle", "f"} else ["angle"]
    currents = {"ia", "ib", "ic"} <= found.keys() or {"i", "i_angle"} <= found.keys()
    if not currents:
        lacking += [role for role in ("p", "q") if role not in found]
    if not lacking:
        return
    said = []
    for role in lacking:
        if role in several:
            likely = " or ".join((Option.CHANNEL + f" '{role}={name}'") for name in several[role])
            said.append(f"{role}, the {ROLES[role]}, may be one of several: give {likely}")
        else:
            said.append(
                f"{role}, the {ROLES[role]}, is missing: give "
                + Option.CHANNEL
                + f" '{role}=COLUMN'"
            )
    raise InputError(
        f"{label}: {'; '.join(said)}. Its columns are {', '.join(columns) or 'none'}; a table of its own names them "
        "time, v_pu, angle_deg, p_mw, q_mvar"
    )


def in_base(
    values: Numbers, unit: str, channel: RecordedChannel, label: str
) -> tuple[Numbers, str]:
    """Values in the base unit of their channel, and which it is; "" where no unit is known."""
    scaled = channel.factor * values
    if not unit:
        return np.asarray(scaled), ""
    for base in sorted(_BASES[channel.role], key=lambda base: base != unit):
        try:
            return np.asarray(scaled * to_unit(f"1 {unit}", base)), base
        except ValueError:
            continue
    raise InputError(
        f"{label}: {channel.column!r} is in {unit}, and {channel.role} is the "
        f"{ROLES[channel.role]}, in {' or '.join(_BASES[channel.role])}; give its "
        "unit, as in "
        + Option.CHANNEL
        + f" '{channel.role}={channel.column} in {_BASES[channel.role][0]}'"
    )
