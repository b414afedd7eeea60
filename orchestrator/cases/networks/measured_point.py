"""Where a plant's controller measures: a bus, and a branch at one end, as a file of dynamics data names them."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MeasuredPoint:
    """A bus whose voltage is measured, and a branch whose power is, from ``near`` to ``far``; numbers of the file.

    0 stands for the unit's own bus and its own power. ``place``: file and line that name it."""

    bus: int
    near: int
    far: int
    circuit: str
    place: str = ""

    @property
    def is_own(self) -> bool:
        """Return whether it is the unit's own terminal."""
        return not (self.bus or self.near)
