"""Names of the variables of a grid's lines and buses, for the models and for programs that set and read them."""

from collections.abc import Iterable

_DATA = ("X", "R", "B", "tap", "shift")


def line_variable(line: str, quantity: str) -> str:
    """Name of a line's variable: its data have names such as ``X_tie``, all other variables names such as
    ``tie.connected``."""
    return f"{quantity}_{line}" if quantity in _DATA else f"{line}.{quantity}"


def lines_among(variables: Iterable[str]) -> list[str]:
    """Names of the lines that a grid with these variables has: each has a reactance."""
    begin = line_variable("", "X")
    return [name.removeprefix(begin) for name in variables if name.startswith(begin)]


def injection_names(bus: str) -> tuple[str, str]:
    """Names of the parts of a current besides that is injected at a bus."""
    return f"{bus}.i_re", f"{bus}.i_im"
