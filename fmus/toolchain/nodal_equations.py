"""Nodal equations Y·v = i of a large network, as they are written: elements of Y and currents as expressions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from fmus.toolchain.elimination_plan import plan_pattern
from fmus.toolchain.model import NodalEquations
from fmus.toolchain.symbols import Expr, Function, Scalar, Vector, symbols, symbols_in

Complex = tuple[Scalar, Scalar]  # real and imaginary part
# part of its terms that a row of Y·v = i may leave over; with more, no voltage is finite
LARGEST_REST = 1e-6


@dataclass(frozen=True)
class Nodes:
    """Equations that a kernel solves as data."""

    # of Y by row and column, those of the diagonal included; functions of parameters and inputs.
    elements: Mapping[tuple[int, int], Complex]
    currents: Sequence[Complex]  # one for each row; functions of states, inputs and parameters

    @cached_property
    def symbols(self) -> list[Expr]:
        """All voltages: real parts, then imaginary parts."""
        return symbols("v", 2 * len(self.currents))

    @property
    def voltages(self) -> list[tuple[Expr, Expr]]:
        """Symbols for real and imaginary part of each v."""
        n = len(self.currents)
        return list(zip(self.symbols[:n], self.symbols[n:], strict=True))

    def equations(self, x: Vector, u: Vector, p: Vector, c: Vector) -> NodalEquations:
        """The equations as functions, with the plan of their solution."""
        rows, columns = zip(*self.elements, strict=True)
        plan = plan_pattern(len(self.currents), rows, columns)
        ordered = [self.elements[place] for place in plan.entries]
        values = Function("nodal_values", [u, p, c], [_parts(ordered)])
        number = {symbol: k for k, symbol in enumerate(u)}
        given = sorted(
            number[symbol] for symbol in symbols_in(values.outputs[0]) if symbol in number
        )
        currents = Function("nodal_currents", [x, u, p, c], [_parts(self.currents)])
        return NodalEquations(plan, values, currents, tuple(given))


def _parts(entries: Sequence[Complex]) -> list[Expr]:
    return [Expr(re) for re, _ in entries] + [Expr(im) for _, im in entries]
