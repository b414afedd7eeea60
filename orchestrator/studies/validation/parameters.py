"""The parameters of a device that may be fitted, with where they begin and how far they may go."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.device import PlayedDevice

NEVER = (
    *("S_n", "S_base", "f_n", "V_n", "P_0", "Q_0", "v_0", "theta_0"),
    *("internal_step", "communication_step", "steps_late"),
)
"""Values that say where a device stands and how a master steps it, and not what it is."""

_WIDE = 1000.0  # times the start value, where no bound is declared


@dataclass(frozen=True)
class Adjustable:
    """A number that is fitted, in its own unit."""

    name: str
    unit: str
    start: float
    low: float
    high: float

    @property
    def reach(self) -> float:
        """A change that is large for it: its own size, as far as its bounds allow."""
        size = abs(self.start) or min(1.0, self.high - self.low)
        return min(size, self.high - self.low)

    @property
    def step(self) -> float:
        """For differences: a hundredth of its reach, and within the bounds to both sides."""
        room = min(self.start - self.low, self.high - self.start)
        return min(0.01 * self.reach, room) if room > 0 else 0.01 * self.reach

    def inside(self) -> float:
        """Where it begins: its value, or a little within the bound on which that lies."""
        least = 0.02 * self.reach
        return min(max(self.start, self.low + least), self.high - least)


@dataclass(frozen=True)
class Wanted:
    """Parameters to be fitted: numbers, and switches that are tried on and off."""

    numbers: Sequence[Adjustable]
    switches: Sequence[str]


def wanted_parameters(
    device: PlayedDevice, names: Sequence[str], bounds: Mapping[str, tuple[float, float]]
) -> Wanted:
    """Find the parameters that are asked for; ``*`` in a name stands for anything.

    Raises an `InputError` if the device has none of a name, or one cannot be fitted."""
    known = {
        info.name: info
        for info in device.description.variables.values()
        if info.causality == "parameter" and info.name not in NEVER
    }
    chosen: dict[str, VariableInfo] = {}
    for given in names:
        pattern = _own_name(device, given.strip(), known)
        fitting = {name: known[name] for name in fnmatch.filter(known, pattern)}
        if not fitting:
            hint = close_names(pattern, list(known))
            raise InputError(
                Option.FIT
                + f" {given}: {device.name} has no parameter of that name that can be fitted; "
                f"{hint or '`gfor fmu info` lists them'}"
            )
        chosen |= fitting
    own = {_own_name(device, name, known): of for name, of in bounds.items()}
    strange = [name for name in bounds if _own_name(device, name, known) not in chosen]
    if strange:
        raise InputError(
            Option.BOUNDS
            + f" {strange[0]}: it is not fitted; name it with "
            + Option.FIT
            + " as well"
        )
    numbers = [
        adjustable(device, info, own.get(name))
        for name, info in chosen.items()
        if info.type == "Real"
    ]
    return Wanted(numbers, [name for name, info in chosen.items() if info.type == "Boolean"])


def _own_name(device: PlayedDevice, given: str, known: Collection[str]) -> str:
    """A name without the component's, unless the device has it as it stands: a component may be named as its part."""
    return given if fnmatch.filter(known, given) else given.removeprefix(f"{device.name}.")


def adjustable(
    device: PlayedDevice, info: VariableInfo, bounds: tuple[float, float] | None
) -> Adjustable:
    """A parameter with its value and bounds, the declared ones where none are given."""
    value = float(device.value(info.name))
    size = _WIDE * (abs(value) or 1.0)
    low = -size if info.minimum is None else info.minimum
    high = size if info.maximum is None else info.maximum
    if bounds is not None:
        if not low <= bounds[0] < bounds[1] <= high:
            raise InputError(
                Option.BOUNDS
                + f" {info.name}={bounds[0]:g}:{bounds[1]:g}: the device declares {low:g} to "
                f"{high:g}; give bounds within these, the lower one first"
            )
        low, high = bounds
        value = min(max(value, low), high)
    return Adjustable(info.name, info.unit or "1", value, low, high)
