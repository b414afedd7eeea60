"""A part's parameters as data, one line each; `declared` gives their values by name where the equations are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from fmus.synchronous_generator import declarations
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


@dataclass(frozen=True)
class Line:
    """One parameter: name, default, text, bounds, unit, and the base of a per-unit value.

    ``left_out``: whether it is a time constant that may be 0 and then leaves its block out."""

    name: str
    value: float
    text: str
    minimum: float | None = None
    maximum: float | None = None
    unit: str = "pu"
    base: str = ""
    left_out: bool = False


def pu(
    name: str, value: float, text: str, minimum: float | None = None, base: str = "E_fd"
) -> Line:
    """A gain or limit per unit of a base."""
    return Line(name, value, text, minimum, base=base)


power = partial(pu, base="S_n")
"""A gain, power or valve's position per unit of S_n."""


def seconds(name: str, value: float, text: str, minimum: float = 0.0) -> Line:
    """A time constant; one that may be 0 leaves its block out there."""
    return Line(name, value, text, minimum, unit="s", left_out=minimum == 0)


def number(
    name: str, value: float, text: str, minimum: float | None = None, unit: str = "1"
) -> Line:
    """Any other number, such as an integral gain [1/s]."""
    return Line(name, value, text, minimum, unit=unit)


class Given:
    """Values of declared parameters, as attributes."""

    def __init__(self, values: dict[str, Expr]) -> None:
        self._values = values

    def __or__(self, others: "Given") -> "Given":
        return Given(self._values | others._values)

    def has(self, name: str) -> bool:
        """Return whether there is such a parameter."""
        return name in self._values

    def __getattr__(self, name: str) -> Expr:
        try:
            return self._values[name]
        except KeyError:
            raise AttributeError(name) from None


def declared(
    m: ModelBuilder, lines: Sequence[Line], source: str, values: Mapping[str, float] | None = None
) -> Given:
    """Declare parameters in the current scope.

    ``source``: of the defaults; ``values``: defaults in place of the lines', by name."""
    own = values or {}
    return Given(
        {
            line.name: _declare(m, replace(line, value=own.get(line.name, line.value)), source)
            for line in lines
        }
    )


def _declare(m: ModelBuilder, line: Line, source: str) -> Expr:
    if line.left_out:
        return declarations.time_constant(m, line.name, line.value, line.text, source=source)
    return m.parameter(
        line.name,
        line.value,
        line.unit,
        line.text,
        base=line.base,
        minimum=line.minimum,
        maximum=line.maximum,
        source=source,
    )
