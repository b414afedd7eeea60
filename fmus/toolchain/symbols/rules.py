"""How operations are simplified where they are written: by the rules of CasADi's SX, and in their order.

Where a rule changes the last bit of a value, it changes the same bit. Of CasADi's rules these are the ones that the
models of this package come upon; a test holds each model against CasADi."""

from collections.abc import Callable

from fmus.toolchain.symbols.expression import (
    MINUS_ONE,
    ONE,
    RULES,
    TWO,
    ZERO,
    Expr,
    Scalar,
    node,
    operation,
)
from fmus.toolchain.symbols.operations import Op

_COMMUTATIVE = {Op.ADD, Op.MUL, Op.EQ, Op.NE, Op.AND, Op.OR}
_NONNEGATIVE = {Op.SQRT, Op.SQ, Op.EXP, Op.NOT, Op.FABS}
_LARGEST_POWER = 100  # that is written as products


def _same(x: Expr, y: Expr) -> bool:
    """Return whether both are one expression, or the same operation on the very same operands."""
    if x is y:
        return True
    op = x.op
    if op != y.op or op >= Op.CONST:
        return False
    return (x.a is y.a and x.b is y.b) or (op in _COMMUTATIVE and x.a is y.b and x.b is y.a)


def _add(x: Expr, y: Expr) -> Expr:
    if x.op == Op.IF_ELSE_ZERO == y.op and x.a is y.a:
        return _if_else_zero(y.a, x.b + y.b)
    if x is ZERO:
        return y
    if y is ZERO:
        return x
    if y.op == Op.NEG:
        return _sub(x, y.a)
    if x.op == Op.NEG:
        return _sub(y, x.a)
    if _same(x, y):
        return _mul(TWO, x)
    if x.op == Op.SUB and _same(x.b, y):
        return x.a
    if y.op == Op.SUB and _same(x, y.b):
        return y.a
    return node(Op.ADD, x, y)


def _sub(x: Expr, y: Expr) -> Expr:
    if y is ZERO:
        return x
    if x is ZERO:
        return -y
    if _same(x, y):
        return ZERO
    if y.op == Op.NEG:
        return _add(x, y.a)
    if x.op == Op.ADD and _same(x.b, y):
        return x.a
    if x.op == Op.ADD and _same(x.a, y):
        return x.b
    if x.op == Op.NEG:
        return -_add(x.a, y)
    return node(Op.SUB, x, y)


def _mul(x: Expr, y: Expr) -> Expr:
    p, q = x.op, y.op
    if q == Op.IF_ELSE_ZERO:
        return _if_else_zero(y.a, _mul(x, y.b))
    if p == Op.IF_ELSE_ZERO:
        return _if_else_zero(x.a, _mul(x.b, y))
    if _same(x, y):
        return sq(x)
    if p == Op.CONST:
        return _scaled(x, y)
    if q == Op.CONST:
        return _scaled(y, x)
    if q == Op.INV:
        return _div(x, y.a)
    if p == Op.INV:
        return _div(y, x.a)
    if p == Op.DIV and _same(x.b, y):
        return x.a
    if q == Op.DIV and _same(y.b, x):
        return y.a
    if p == Op.NEG:
        return -_mul(x.a, y)
    if q == Op.NEG:
        return -_mul(x, y.a)
    return node(Op.MUL, x, y)


def _scaled(x: Expr, y: Expr) -> Expr:
    """A constant times an expression."""
    if x is ZERO or y is ZERO:
        return ZERO
    if x is ONE:
        return y
    if x is MINUS_ONE:
        return -y
    if y.op == Op.INV:
        return _div(x, y.a)
    if x is TWO:
        return _twice(y, y)
    if y.op == Op.NEG:
        return -_scaled(x, y.a)
    if y.op == Op.MUL and y.a.op == Op.CONST:
        return _mul(_mul(x, y.a), y.b)
    return node(Op.MUL, x, y)


def _div(x: Expr, y: Expr) -> Expr:
    p, q = x.op, y.op
    if x is ZERO or y is ONE:
        return x
    if p == Op.MUL and _same(y, x.a):
        return x.b
    if p == Op.MUL and _same(y, x.b):
        return x.a
    if x is ONE:
        return operation(Op.INV, y, y)
    if q == Op.INV:
        return _mul(x, y.a)
    if p == Op.TWICE == q:
        return _div(x.a, y.a)
    if q == Op.MUL and _same(y.b, x):
        return _div(ONE, y.a)
    if p == Op.NEG:
        return -_div(x.a, y)
    if q == Op.NEG:
        return -_div(x, y.a)
    return node(Op.DIV, x, y)


def _pow(x: Expr, y: Expr) -> Expr:
    if y.op != Op.CONST:
        return node(Op.POW, x, y)
    n = y.value
    if n == 0.5:
        return sqrt(x)
    if not n.is_integer() or abs(n) > _LARGEST_POWER:
        return node(Op.CONSTPOW, x, y)
    if n == 0:
        return ONE
    if n < 0:
        return _div(ONE, x**-n)
    if n % 2:
        return _mul(x, x ** (n - 1))
    return sq(x ** (n / 2))


def _if_else_zero(condition: Expr, y: Expr) -> Expr:
    if y is ZERO or condition is ZERO:
        return ZERO
    if condition.op == Op.CONST:
        return y
    return node(Op.IF_ELSE_ZERO, condition, y)


def _twice(x: Expr, _: Expr) -> Expr:
    if x.op == Op.MUL and x.a.op == Op.CONST:
        return _mul(_mul(TWO, x.a), x.b)
    return 4 * x.a if x.op == Op.TWICE else node(Op.TWICE, x, x)


def _squared(x: Expr, _: Expr) -> Expr:
    if x.op == Op.SQRT:
        return x.a
    if x.op in (Op.NEG, Op.FABS):
        return sq(x.a)
    return node(Op.SQ, x, x)


def _nonnegative(x: Expr) -> bool:
    return x.value >= 0 if x.op == Op.CONST else x.op in _NONNEGATIVE


def _neg(x: Expr, _: Expr) -> Expr:
    return -x


def _lt(x: Expr, y: Expr) -> Expr:
    return ZERO if _nonnegative(_sub(x, y)) else node(Op.LT, x, y)


def _le(x: Expr, y: Expr) -> Expr:
    return ONE if _nonnegative(_sub(y, x)) else node(Op.LE, x, y)


def _eq(x: Expr, y: Expr) -> Expr:
    return ONE if _same(x, y) else node(Op.EQ, x, y)


def _ne(x: Expr, y: Expr) -> Expr:
    return ZERO if _same(x, y) else node(Op.NE, x, y)


def _absolute(x: Expr, _: Expr) -> Expr:
    return fabs(x.a) if x.op == Op.NEG else node(Op.FABS, x, x)


def _root(x: Expr, _: Expr) -> Expr:
    return fabs(x.a) if x.op == Op.SQ else node(Op.SQRT, x, x)


def _cosine(x: Expr, _: Expr) -> Expr:
    return cos(x.a) if x.op in (Op.NEG, Op.FABS) else node(Op.COS, x, x)


def _undone(op: int, by: int) -> Callable[[Expr, Expr], Expr]:
    """An operation that undoes another one."""
    return lambda x, _: x.a if x.op == by else node(op, x, x)


def _of_one(op: int) -> Callable[[Scalar], Expr]:
    return lambda x: operation(op, Expr(x), Expr(x))


def _of_two(op: int) -> Callable[[Scalar, Scalar], Expr]:
    return lambda x, y: operation(op, Expr(x), Expr(y))


sq, sqrt, fabs, sign, floor = map(_of_one, (Op.SQ, Op.SQRT, Op.FABS, Op.SIGN, Op.FLOOR))
sin, cos, tan, atan, exp, log = map(_of_one, (Op.SIN, Op.COS, Op.TAN, Op.ATAN, Op.EXP, Op.LOG))
fmin, fmax, atan2, copysign = map(_of_two, (Op.FMIN, Op.FMAX, Op.ATAN2, Op.COPYSIGN))
logic_not, logic_and, logic_or = _of_one(Op.NOT), _of_two(Op.AND), _of_two(Op.OR)


RULES |= {
    Op.ADD: _add,
    Op.SUB: _sub,
    Op.MUL: _mul,
    Op.DIV: _div,
    Op.POW: _pow,
    Op.TWICE: _twice,
    Op.SQ: _squared,
    Op.IF_ELSE_ZERO: _if_else_zero,
    Op.NEG: _neg,
    Op.INV: _undone(Op.INV, Op.INV),
    Op.LOG: _undone(Op.LOG, Op.EXP),
    Op.NOT: _undone(Op.NOT, Op.NOT),
    Op.LT: _lt,
    Op.LE: _le,
    Op.EQ: _eq,
    Op.NE: _ne,
    Op.FABS: _absolute,
    Op.SQRT: _root,
    Op.COS: _cosine,
}


def if_else(condition: Scalar, if_true: Scalar, if_false: Scalar) -> Expr:
    """One of two values; the other one may be undefined."""
    return _if_else_zero(Expr(condition), Expr(if_true)) + _if_else_zero(
        logic_not(condition), Expr(if_false)
    )
