"""Equations as symbols: expressions, functions of them, exact derivatives, and their text in C."""

from fmus.toolchain.symbols.derivatives import jacobian, jtimes, jtimes_transposed
from fmus.toolchain.symbols.expression import Expr, Scalar, symbol, symbols
from fmus.toolchain.symbols.function import Function, Vector, depends_on, substitute, symbols_in
from fmus.toolchain.symbols.operations import Op
from fmus.toolchain.symbols.rules import (
    atan,
    atan2,
    copysign,
    cos,
    exp,
    fabs,
    floor,
    fmax,
    fmin,
    if_else,
    log,
    logic_and,
    logic_not,
    logic_or,
    sin,
    sqrt,
    tan,
)

__all__ = [
    "Expr",
    "Function",
    "Op",
    "Scalar",
    "Vector",
    "atan",
    "atan2",
    "copysign",
    "cos",
    "depends_on",
    "exp",
    "fabs",
    "floor",
    "fmax",
    "fmin",
    "if_else",
    "jacobian",
    "jtimes",
    "jtimes_transposed",
    "log",
    "logic_and",
    "logic_not",
    "logic_or",
    "sin",
    "sqrt",
    "substitute",
    "symbol",
    "symbols",
    "symbols_in",
    "tan",
]
