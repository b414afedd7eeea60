"""Elements of complex nodal equations Y·v = i."""

from fmus.toolchain.frames import ZERO, Phasor

Admittances = dict[str, dict[str, Phasor]]  # rows and columns by bus; the pattern is symmetric


def add_admittance(Y: Admittances, row: str, column: str, value: Phasor) -> None:
    """Add a value to one element of the matrix."""
    Y[row][column] = Y[row].get(column, ZERO) + value
