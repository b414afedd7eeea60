"""Expressions of real numbers: symbols, constants, and operations on one or two expressions.

No two equal operations become one: the C compiler does that."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real

from fmus.toolchain.symbols.operations import VALUE, Op

_CONST, _new = Op.CONST, object.__new__  # looked up for every node

RULES: dict[int, Callable[[Expr, Expr], Expr]] = {}
"""What makes an operation where it is not just written down; `rules` fills it."""


def _operator(op: int, *, swapped: bool = False) -> Callable[[Expr, Scalar], Expr]:
    """A method of `Expr`; ``swapped``: for an expression on the right."""

    def method(x: Expr, y: Scalar) -> Expr:
        if y.__class__ is not Expr:
            if not isinstance(y, Real):
                return NotImplemented  # type: ignore[no-any-return]
            y = constant(y)
        return RULES[op](y, x) if swapped else RULES[op](x, y)

    return method


class Expr:
    """An expression. ``Expr(value)`` makes one of a number, and leaves an expression as it is."""

    __slots__ = ("a", "b", "label", "op", "value")
    __array_ufunc__ = None  # numbers of numpy leave operations to this class

    op: int
    a: Expr  # operands of an operation, the second one again the first where there is only one
    b: Expr
    value: float  # of a constant
    label: str  # of a symbol

    def __new__(cls, value: Scalar) -> Expr:
        return value if value.__class__ is Expr else constant(value)  # type: ignore[arg-type]

    def name(self) -> str:
        """The name of a symbol."""
        if self.op != Op.SYMBOL:
            raise TypeError("only a symbol has a name")
        return self.label

    __add__, __radd__ = _operator(Op.ADD), _operator(Op.ADD, swapped=True)
    __sub__, __rsub__ = _operator(Op.SUB), _operator(Op.SUB, swapped=True)
    __mul__, __rmul__ = _operator(Op.MUL), _operator(Op.MUL, swapped=True)
    __truediv__, __rtruediv__ = _operator(Op.DIV), _operator(Op.DIV, swapped=True)
    __pow__, __rpow__ = _operator(Op.POW), _operator(Op.POW, swapped=True)
    __lt__, __gt__ = _operator(Op.LT), _operator(Op.LT, swapped=True)
    __le__, __ge__ = _operator(Op.LE), _operator(Op.LE, swapped=True)
    __eq__, __ne__ = _operator(Op.EQ), _operator(Op.NE)  # type: ignore[assignment]
    __hash__ = object.__hash__

    def __neg__(self) -> Expr:
        return self.a if self.op == Op.NEG else node(Op.NEG, self, self)

    def __bool__(self) -> bool:
        return bool(float(self))

    def __float__(self) -> float:
        if self.op != Op.CONST:
            raise TypeError(
                "an expression with symbols is no number, neither true nor false; choose with if_else"
            )
        return self.value


Scalar = Expr | float  # an operand of equations


def node(op: int, a: Expr, b: Expr) -> Expr:
    """An operation as it stands; one on constants is a constant."""
    if a.op == _CONST == b.op:
        return constant(VALUE[op](a.value, b.value))
    made = _new(Expr)
    made.op, made.a, made.b = op, a, b
    return made


def operation(op: int, a: Expr, b: Expr) -> Expr:
    """An operation, simplified."""
    rule = RULES.get(op)
    return node(op, a, b) if rule is None else rule(a, b)


_constants: dict[float, Expr] = {}


def constant(value: float) -> Expr:
    found = _constants.get(value)
    if found is None:
        found = object.__new__(Expr)
        found.op, found.value = Op.CONST, float(value) + 0.0  # there is no −0
        _constants[found.value] = found
    return found


ZERO, ONE, TWO, MINUS_ONE = map(constant, (0.0, 1.0, 2.0, -1.0))


def symbol(name: str) -> Expr:
    """A new symbol, which is equal to no other of the same name."""
    made = object.__new__(Expr)
    made.op, made.label = Op.SYMBOL, name
    return made


def symbols(name: str, count: int) -> list[Expr]:
    return [symbol(f"{name}_{k}") for k in range(count)]
