"""Exact derivatives: Jacobians with their pattern, and products with a direction or, transposed, with a seed.

Partial derivatives are written, and summed, in the way of CasADi, and so to the same bit. A Jacobian is made column by
column; CasADi goes by rows where these are far fewer, and sums otherwise there."""

from collections.abc import Callable, Mapping, Sequence

from fmus.toolchain.symbols.expression import MINUS_ONE, ONE, TWO, ZERO, Expr, Scalar, operation
from fmus.toolchain.symbols.function import Vector, sorted_nodes
from fmus.toolchain.symbols.operations import UNARY, Op
from fmus.toolchain.symbols.rules import copysign, cos, log, sign, sin, sq

_Partials = tuple[Expr, Expr]


def jacobian(values: Vector, by: Vector) -> dict[tuple[int, int], Expr]:
    """Derivative of each value by each symbol that it depends on, by their numbers."""
    rows = _moves_of(values, {symbol: {j: ONE} for j, symbol in enumerate(by)})
    return {(i, j): moved for i, row in enumerate(rows) for j, moved in sorted(row.items())}


def jtimes(values: Vector, by: Vector, direction: Sequence[Scalar]) -> list[Expr]:
    """The Jacobian of values by symbols, times a direction."""
    along = {symbol: {0: Expr(size)} for symbol, size in zip(by, direction, strict=True)}
    return [moved.get(0, ZERO) for moved in _moves_of(values, along)]


def jtimes_transposed(values: Vector, by: Vector, seeds: Sequence[Scalar]) -> list[Expr]:
    """The transposed Jacobian of values by symbols, times a seed for each value."""
    nodes, ends = sorted_nodes(values)
    total = dict.fromkeys([*nodes, *by], ZERO)
    for value, seed, first, end in reversed(
        list(zip(values, map(Expr, seeds), [0, *ends], ends, strict=False))
    ):
        total[value] = total[value] + seed
        for node in reversed(nodes[first:end]):
            own = total[node]
            if node.op >= Op.CONST or own is ZERO:
                continue
            if node.op == Op.IF_ELSE_ZERO:
                total[node.b] = total[node.b] + operation(Op.IF_ELSE_ZERO, node.a, own)
                continue
            by_a, by_b = _partials(node)
            total[node.a] = total[node.a] + by_a * own
            total[node.b] = total[node.b] + by_b * own
    return [total[symbol] for symbol in by]


def _moves_of(values: Vector, symbols: Mapping[Expr, dict[int, Expr]]) -> list[dict[int, Expr]]:
    """How values move in each direction that they depend on, where symbols move so."""
    moves = dict(symbols)
    for node in sorted_nodes(values)[0]:
        if node.op >= Op.CONST:
            moves.setdefault(node, {})
            continue
        first, second = moves[node.a], moves[node.b]
        moves[node] = found = {}
        if first or second:
            by_a, by_b = _partials(node)
        for direction in {**first, **second}:
            a, b = first.get(direction, ZERO), second.get(direction, ZERO)
            if node.op == Op.IF_ELSE_ZERO:
                found[direction] = operation(Op.IF_ELSE_ZERO, node.a, b)
            else:
                found[direction] = by_a * a if node.op in UNARY else by_a * a + by_b * b
    return [moves[value] for value in values]


def _partials(f: Expr) -> _Partials:
    """Derivatives of an operation by its first and by its second operand; none of comparisons, logic, floor."""
    by_two = _BY_TWO.get(f.op)
    if by_two is not None:
        return by_two(f, f.a, f.b)
    return _BY_ONE[f.op](f, f.a) if f.op in _BY_ONE else ZERO, ZERO


def _of_power(f: Expr, x: Expr, y: Expr) -> _Partials:
    return y * x ** (y - 1), log(x) * f if f.op == Op.POW else ZERO


def _of_extreme(f: Expr, x: Expr, y: Expr) -> _Partials:
    first, second = (x <= y, y <= x) if f.op == Op.FMIN else (y <= x, x <= y)
    both = first + second
    return first / both, second / both


def _of_angle(_: Expr, x: Expr, y: Expr) -> _Partials:
    length = x * x + y * y
    return y / length, -x / length


_BY_ONE: dict[int, Callable[[Expr, Expr], Expr]] = {
    Op.NEG: lambda f, x: MINUS_ONE,
    Op.TWICE: lambda f, x: TWO,
    Op.SQ: lambda f, x: x + x,
    Op.INV: lambda f, x: -f * f,
    Op.SQRT: lambda f, x: 1 / (f + f),
    Op.EXP: lambda f, x: f,
    Op.LOG: lambda f, x: 1 / x,
    Op.SIN: lambda f, x: cos(x),
    Op.COS: lambda f, x: -sin(x),
    Op.TAN: lambda f, x: 1 / sq(cos(x)),
    Op.ATAN: lambda f, x: 1 / (1 + x * x),
    Op.FABS: lambda f, x: sign(x),
}
_BY_TWO: dict[int, Callable[[Expr, Expr, Expr], _Partials]] = {
    Op.ADD: lambda f, x, y: (ONE, ONE),
    Op.SUB: lambda f, x, y: (ONE, MINUS_ONE),
    Op.MUL: lambda f, x, y: (y, x),
    Op.DIV: lambda f, x, y: (1 / y, -f / y),
    Op.POW: _of_power,
    Op.CONSTPOW: _of_power,
    Op.FMIN: _of_extreme,
    Op.FMAX: _of_extreme,
    Op.ATAN2: _of_angle,
    Op.COPYSIGN: lambda f, x, y: (sign(x) * copysign(1, y), ZERO),
}
