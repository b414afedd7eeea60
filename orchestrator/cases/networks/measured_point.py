"""Where a plant's controller or a compensator measures: a bus, and a branch at one end, by a file of dynamics."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MeasuredPoint:
    """A bus whose voltage is measured, and a branch whose power is, from ``near`` to ``far``; numbers of the file.

    0 stands for the unit's own bus and its own power. ``place``: file and line that name it; ``record``: PSS/E's
    name of what measures; ``of_voltage``: whether it measures a voltage alone."""

    bus: int
    near: int
    far: int
    circuit: str
    place: str
    record: str
    of_voltage: bool = False

    @property
    def is_own(self) -> bool:
        """Return whether it is the unit's own terminal."""
        return not (self.bus or self.near)
