"""Devices of a PSS/E file that feed or draw at AC buses by their own controls: DC lines, FACTS devices and others."""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

Voltages = Mapping[int, complex]
"""Voltages [pu] by the buses' numbers."""


@dataclass(frozen=True, slots=True)
class Hold:
    """A voltage [pu] that a device holds at its bus, and the reactive power that it can feed for that [Mvar]."""

    v_pu: float
    least_mvar: float
    most_mvar: float


@dataclass(frozen=True, slots=True)
class DeviceEnd:
    """A place where a device meets the AC network.

    ``fed``: P + jQ that it feeds into the bus [MW, Mvar]; of one that holds a voltage, Q is what it feeds besides.
    ``is_unknown``: whether the file alone does not tell the powers, and only its solution does."""

    name: str
    bus: int
    fed: complex = 0j
    hold: Hold | None = None
    is_unknown: bool = False


@dataclass(frozen=True)
class HeldDevice(ABC):
    """A device: the section of its record, its line there, and its name."""

    section: str
    line: int
    name: str

    @property
    @abstractmethod
    def places(self) -> tuple[int, ...]:
        """Return the numbers of the device's buses."""

    @abstractmethod
    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        """Return what the device feeds at these voltages."""

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        """Return what is unusual in the device's state at these voltages."""
        return ()

    def ending_name(self, kind: str, bus: int) -> str:
        """Return the name of a load of our network, such as ``dc_WATL_P1_12``."""
        own = re.sub(r"[^0-9A-Za-z]+", "_", self.name).strip("_")
        return f"{kind}_{own}_{bus}" if own else f"{kind}_{bus}"
