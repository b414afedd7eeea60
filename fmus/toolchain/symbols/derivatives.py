"""Exact derivatives: Jacobians with their pattern, and products with a direction or, transposed, with a seed.

Partial derivatives are written, and summed, in the way of CasADi, and so to the same bit. A Jacobian is made column by
column; CasADi goes by rows where these are far fewer, and sums otherwise there."""

from collections.abc import Mapping, Sequence

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
    if f.op in UNARY:
        return _partial_by_one(f, f.a), ZERO
    return _partials_by_two(f, f.a, f.b)


def _partial_by_one(f: Expr, x: Expr) -> Expr:
    """Derivative of a function of one operand."""
    match f.op:
        case Op.NEG:
            return MINUS_ONE
        case Op.TWICE:
            return TWO
        case Op.SQ:
            return x + x
        case Op.INV:
            return -f * f
        case Op.SQRT:
            return 1 / (f + f)
        case Op.EXP:
            return f
        case Op.LOG:
            return 1 / x
        case Op.SIN:
            return cos(x)
        case Op.COS:
            return -sin(x)
        case Op.TAN:
            return 1 / sq(cos(x))
        case Op.ATAN:
            return 1 / (1 + x * x)
        case Op.FABS:
            return sign(x)
    return ZERO


def _partials_by_two(f: Expr, x: Expr, y: Expr) -> _Partials:
    """Derivatives of a function of two operands."""
    match f.op:
        case Op.ADD:
            return ONE, ONE
        case Op.SUB:
            return ONE, MINUS_ONE
        case Op.MUL:
            return y, x
        case Op.DIV:
            return 1 / y, -f / y
        case Op.POW:
            return y * x ** (y - 1), log(x) * f
        case Op.CONSTPOW:
            return y * x ** (y - 1), ZERO
        case Op.FMIN:
            return _partials_of_extreme(x <= y, y <= x)
        case Op.FMAX:
            return _partials_of_extreme(y <= x, x <= y)
        case Op.ATAN2:
            length = x * x + y * y
            return y / length, -x / length
        case Op.COPYSIGN:
            return sign(x) * copysign(1, y), ZERO
    return ZERO, ZERO


def _partials_of_extreme(first: Expr, second: Expr) -> _Partials:
    """Derivatives of the operand that is the extreme one; of two equal ones, half each."""
    both = first + second
    return first / both, second / both
