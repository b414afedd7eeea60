"""Request of a study of interactions."""

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Any, cast

from orchestrator.cases.form.devices import Device, devices_of
from orchestrator.cases.form.given import binding_path
from orchestrator.core.asked import (
    FLAG,
    FREQUENCIES,
    NAME,
    NAMES,
    SHARE,
    FieldKind,
    Names,
    request_field,
)
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.device_or_controller import as_device
from orchestrator.studies.points.request import OverPoints, of_scenario, of_values

RANGE_HZ = (0.1, 100.0)
"""Frequencies of the modes that are compared [Hz]: swings, and what converters' controls do up to twice the rated
frequency, as their network's frame turns with it."""


def _files(read: Callable[[Any, str], Any]) -> FieldKind:
    def check(given: Any, argument: str) -> dict[str, Any]:
        if given and not isinstance(given, Mapping):
            raise InputError(
                f"{argument} = {given!r}; give files by name, such as {{'vendor': 'vendor.fmu'}}"
            )
        return {name: read(file, argument) for name, file in dict(given or {}).items()}

    return FieldKind("[NAME=]FILE", str, check, several=True)


_DEVICES, _BINDINGS = _files(path_of), _files(lambda given, _: binding_path(given))


@dataclass(frozen=True)
class InteractionsRequest(OverPoints):
    """Who takes part in which mode, and which vendors' converters do not agree.

    Raises
    ------
    InputError
        If a scenario, value or device cannot be used, or there are too many systems.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> found = gfor.load("infinite_bus").interactions("dip")
    >>> found.modes()[["frequency_hz", "share.gfor", "share.grid"]].round(2).iloc[0].tolist()
    [45.53, 0.4, 0.6]
    """

    scenario: str | None = of_scenario("its name; may be left out where the case has one only")
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    threshold: float = request_field(
        SHARE,
        0.05,
        "share of a mode from which on a vendor takes part in it (default: 5)",
        python="share of a mode, from 0 to 0.5, from which on a vendor takes part in it",
    )
    frequencies: tuple[float, float] = request_field(
        FREQUENCIES, RANGE_HZ, "frequencies [Hz] (default: 0.1:100)", option="--range"
    )
    stand_in: str | None = request_field(
        NAME,
        None,
        "model at the places of the vendors that a system does without (default: static_generation, a "
        "current without dynamics; gfor is the reference converter)",
        "MODEL",
    )
    swap: bool = request_field(FLAG, False, "each vendor's device at each place, in all ways")
    devices: Mapping[str, str | Path] | tuple[str, ...] | tuple[Device, ...] = request_field(
        _DEVICES,
        (),
        "try this FMU or DLL at the places as well; it implies --swap (repeatable)",
        option="--device",
        python="files, by name, of devices that are tried at the places as well; that implies ``swap``",
    )
    bindings: Mapping[str, str | Path] | tuple[str, ...] = request_field(
        _BINDINGS,
        (),
        "binding of a --device (repeatable)",
        option="--binding",
        python="files, by name of a device",
    )
    places: Names = request_field(
        NAMES, (), "swap only at this place (repeatable)", "COMPONENT", option="--place"
    )
    black_box: bool = request_field(
        FLAG, False, "identify the components that hide their states from their inputs and outputs"
    )

    def given_devices(self) -> tuple[Device, ...]:
        if self.places and not (self.swap or self.devices):
            raise InputError(
                Option.PLACE
                + " says where devices are swapped; give "
                + Option.SWAP
                + " or a "
                + Option.DEVICE
                + " as well"
            )
        if isinstance(self.bindings, Mapping):
            lonely = [
                name
                for name in self.bindings
                if name not in cast("Mapping[str, Path]", self.devices)
            ]
            if lonely:
                there = ", ".join(map(str, self.devices)) or "none"
                raise InputError(
                    f"bindings: there is no device {lonely[0]!r}; the devices are: {there}"
                )
        elif self.bindings and not self.devices:
            raise InputError(
                Option.BINDING
                + " is of a "
                + Option.DEVICE
                + "; a converter of the case has its binding in the case file"
            )
        if isinstance(self.devices, Mapping):
            bindings = cast("Mapping[str, Path]", self.bindings or {})
            found = [
                Device(name, Path(file), bindings.get(name)) for name, file in self.devices.items()
            ]
        elif self.devices and isinstance(self.devices[0], Device):
            return self.devices
        else:
            texts = cast("tuple[str, ...]", self.devices)
            found = devices_of(texts, cast("tuple[str, ...]", self.bindings)) if texts else []
        return tuple(replace(one, file=as_device(one.file, one.binding)) for one in found)
