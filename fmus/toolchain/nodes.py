"""Nodal equations Y·v = i of a large network, as they are written: elements of Y and currents as expressions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from fmus.toolchain.elimination_plan import plan_pattern
from fmus.toolchain.model import Model, NodalEquations

Complex = tuple[ca.SX | float, ca.SX | float]  # real and imaginary part

LARGEST_REST = 1e-6  # part of its terms that a row of Y·v = i may leave over; with more, no voltage is finite


@dataclass(frozen=True)
class Nodes:
    """Equations that a kernel solves as data."""

    # of Y by row and column, those of the diagonal included; functions of parameters and inputs.
    elements: Mapping[tuple[int, int], Complex]
    currents: Sequence[Complex]  # one for each row; functions of states, inputs and parameters
    # makes the same model without such equations, for those who need it as one function.
    written_out: Callable[[], Model]

    @cached_property
    def symbol(self) -> ca.SX:
        """All voltages: real parts, then imaginary parts."""
        return ca.SX.sym("v", 2 * len(self.currents))

    @property
    def voltages(self) -> list[tuple[ca.SX, ca.SX]]:
        """Symbols for real and imaginary part of each v."""
        parts, n = ca.vertsplit(self.symbol), len(self.currents)
        return list(zip(parts[:n], parts[n:], strict=True))

    def equations(self, x: ca.SX, u: ca.SX, p: ca.SX, c: ca.SX) -> NodalEquations:
        """The equations as functions, with the plan of their solution."""
        rows, columns = zip(*self.elements, strict=True)
        plan = plan_pattern(len(self.currents), rows, columns)
        ordered = [self.elements[place] for place in plan.entries]
        values = ca.Function("nodal_values", [u, p, c], [_parts(ordered)])
        _, given = values.jac_sparsity(0, 0).get_triplet()
        currents = ca.Function("nodal_currents", [x, u, p, c], [_parts(self.currents)])
        return NodalEquations(plan, values, currents, tuple(sorted(set(given))), self.written_out)


def _parts(entries: Sequence[Complex]) -> ca.SX:
    parts = [ca.SX(re) for re, _ in entries] + [ca.SX(im) for _, im in entries]
    return ca.SX(ca.vertcat(*parts))
