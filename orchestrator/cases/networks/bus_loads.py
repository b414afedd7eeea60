"""The loads at one bus of a file: what draws and what feeds stay apart, each with its own law of the voltage."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class LoadSum:
    """The sum of loads, and what of it is a constant impedance and a constant current [MW, Mvar], as drawn."""

    power: complex = 0j
    parts: tuple[complex, complex] = (0j, 0j)

    def __add__(self, other: "LoadSum") -> "LoadSum":
        impedance, current = (a + b for a, b in zip(self.parts, other.parts, strict=True))
        return LoadSum(self.power + other.power, (impedance, current))


@dataclass
class BusLoads:
    """Loads by the sign of their active power; those without any draw reactive power beside either."""

    drawing: LoadSum = field(default_factory=LoadSum)
    feeding: LoadSum = field(default_factory=LoadSum)
    reactive: LoadSum = field(default_factory=LoadSum)

    def add(self, power: complex, parts: tuple[complex, complex] = (0j, 0j)) -> None:
        """Add a load that draws a power, of which parts are constant impedance and current [MW, Mvar]."""
        load = LoadSum(power, parts)
        if power.real > 0:
            self.drawing += load
        elif power.real < 0:
            self.feeding += load
        else:
            self.reactive += load

    def apart(self) -> "BusLoads":
        """Return the bus' one element as what draws, or its two if loads of both signs stand at the bus."""
        if self.drawing.power and self.feeding.power:
            return BusLoads(self.drawing + self.reactive, self.feeding)
        return BusLoads(self.drawing + self.feeding + self.reactive)
