"""Values that parameters alone fix, set apart in a model's equations.

A kernel computes them where a parameter changes, not at each of the twenty stages of a step. Operations and roundings
stay as they are."""

from dataclasses import dataclass
from itertools import chain

from fmus.toolchain.model import Model
from fmus.toolchain.symbols import Expr, Function, symbols
from fmus.toolchain.symbols.expression import node
from fmus.toolchain.symbols.function import sorted_nodes
from fmus.toolchain.symbols.operations import Op


@dataclass(frozen=True)
class ApartEquations:
    """Equations whose fixed values h are computed apart.

    ``fixed``: (p, c) → h; ``derivatives``: (x, u, p, c, h) → ẋ; ``outputs``: (x, u, p, c, h) → y."""

    fixed: Function
    derivatives: Function
    outputs: Function

    @property
    def count(self) -> int:
        """How many values are fixed."""
        return len(self.fixed.outputs[0])


def with_fixed_apart(model: Model) -> ApartEquations:
    groups = (model.states, model.inputs, model.parameters, model.calculated)
    x, u, p, c = (symbols(name, len(group)) for name, group in zip("xupc", groups, strict=True))
    rates, outputs = (
        function.of(x, u, p, c)[0] for function in (model.derivatives, model.outputs_function)
    )
    values = _equal_as_one([*rates, *outputs])
    fixed = _fixed_among(values, {*x, *u})
    h = symbols("h", len(fixed))
    apart = _with_symbols(values, dict(zip(fixed, h, strict=True)))
    arguments = [x, u, p, c, h]
    return ApartEquations(
        fixed=Function("fixed", [p, c], [fixed]),
        derivatives=Function("derivatives", arguments, [apart[: len(rates)]]),
        outputs=Function("outputs", arguments, [apart[len(rates) :]]),
    )


def _equal_as_one(values: list[Expr]) -> list[Expr]:
    """The same values, where two equal operations are one."""
    new: dict[Expr, Expr] = {}
    known: dict[tuple[int, int, int], Expr] = {}
    for one in sorted_nodes(values)[0]:
        new[one] = one
        if one.op < Op.CONST:
            a, b = new[one.a], new[one.b]
            new[one] = known.setdefault((one.op, id(a), id(b)), node(one.op, a, b))
    return [new[value] for value in values]


def _fixed_among(values: list[Expr], moved: set[Expr]) -> list[Expr]:
    """The operations that nothing in ``moved`` changes and that a value is, or an operation that changes takes."""
    operations = [one for one in sorted_nodes(values)[0] if one.op < Op.CONST]
    moving = set(moved)
    for one in operations:
        if one.a in moving or one.b in moving:
            moving.add(one)
    taken = chain(values, *((one.a, one.b) for one in operations if one in moving))
    needed = set(taken)
    return [one for one in operations if one in needed and one not in moving]


def _with_symbols(values: list[Expr], place: dict[Expr, Expr]) -> list[Expr]:
    """The same values with symbols in place of some of their operations."""
    new = dict(place)
    for one in sorted_nodes(values)[0]:
        if one in new:
            continue
        new[one] = one if one.op >= Op.CONST else node(one.op, new[one.a], new[one.b])
    return [new[value] for value in values]
