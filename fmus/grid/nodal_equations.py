"""The network's equation Y·v = i: its matrix, element by element, and the voltages for which the kernel solves it.

The matrix is data, which the kernel (``fmus/toolchain/c/nodal.c``) factorises anew where a parameter or an admittance
changes; it solves whenever an output is read."""

from fmus.grid.elements import Bus
from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.model_builder import ModelBuilder

Admittances = dict[str, dict[str, Phasor]]  # rows and columns by bus; the pattern is symmetric


def add_admittance(Y: Admittances, row: str, column: str, value: Phasor) -> None:
    """Add a value to one element of the matrix."""
    Y[row][column] = Y[row].get(column, ZERO) + value


def solve_for_voltages(m: ModelBuilder, buses: dict[str, Bus], Y: Admittances) -> None:
    """Give every bus the voltage that follows from Y and from the currents injected there."""
    place = {name: k for k, name in enumerate(Y)}
    matrix = {
        (place[name], place[other]): (y.re, y.im)
        for name, row in Y.items()
        for other, y in row.items()
    }
    voltages = m.nodes(matrix, [(bus.injected.re, bus.injected.im) for bus in buses.values()])
    for bus, (re, im) in zip(buses.values(), voltages, strict=True):
        bus.v = Phasor(re, im)
