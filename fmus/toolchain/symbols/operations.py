"""Operations of expressions: their numbers, which are CasADi's, what they are in Python and C, and their values."""

import math
from collections.abc import Callable
from typing import Any

from fmus.toolchain.tape_kernel import NAMES


class Op:
    """Numbers of operations."""

    ADD, SUB, MUL, DIV, NEG, EXP, LOG, POW, CONSTPOW, SQRT, SQ, TWICE, SIN, COS, TAN = range(1, 16)
    ATAN, LT, LE, EQ, NE, NOT, AND, OR, FLOOR = range(18, 27)
    FABS, SIGN, COPYSIGN, IF_ELSE_ZERO = range(29, 33)
    FMIN, FMAX, INV = range(34, 37)
    ATAN2, CONST, INPUT, OUTPUT, SYMBOL = range(43, 48)


_SAME = {
    Op.ADD: "{0} + {1}",
    Op.SUB: "{0} - {1}",
    Op.MUL: "{0} * {1}",
    Op.NEG: "-{0}",
    Op.TWICE: "2.0 * {0}",
    Op.SQRT: "sqrt({0})",
    Op.SIN: "sin({0})",
    Op.COS: "cos({0})",
    Op.TAN: "tan({0})",
    Op.ATAN: "atan({0})",
    Op.EXP: "exp({0})",
    Op.LOG: "log({0})",
    Op.FABS: "fabs({0})",
    Op.FLOOR: "floor({0})",
    Op.ATAN2: "atan2({0}, {1})",
    Op.COPYSIGN: "copysign({0}, {1})",
}

PYTHON = _SAME | {
    # calls take longer than divisions
    Op.DIV: "{0} / {1} if {1} else divide({0}, {1})",
    Op.INV: "1.0 / {0} if {0} else divide(1.0, {0})",
    Op.SQ: "{0} * {0}",
    Op.POW: "power({0}, {1})",
    Op.CONSTPOW: "power({0}, {1})",
    Op.FMIN: "min({0}, {1})",
    Op.FMAX: "max({0}, {1})",
    Op.LT: "1.0 if {0} < {1} else 0.0",
    Op.LE: "1.0 if {0} <= {1} else 0.0",
    Op.EQ: "1.0 if {0} == {1} else 0.0",
    Op.NE: "1.0 if {0} != {1} else 0.0",
    Op.AND: "1.0 if {0} and {1} else 0.0",
    Op.OR: "1.0 if {0} or {1} else 0.0",
    Op.NOT: "0.0 if {0} else 1.0",
    Op.IF_ELSE_ZERO: "{1} if {0} else 0.0",
    Op.SIGN: "(0.0 < {0}) - (0.0 > {0}) + 0.0 * {0}",
}
"""An operation in Python; what it calls is in the `NAMES` of a tape's kernel."""

C = _SAME | {
    Op.DIV: "{0} / {1}",
    Op.INV: "1. / {0}",
    Op.SQ: "{0} * {0}",
    Op.POW: "pow({0}, {1})",
    Op.CONSTPOW: "pow({0}, {1})",
    Op.FMIN: "fmin({0}, {1})",
    Op.FMAX: "fmax({0}, {1})",
    Op.LT: "{0} < {1}",
    Op.LE: "{0} <= {1}",
    Op.EQ: "{0} == {1}",
    Op.NE: "{0} != {1}",
    Op.AND: "{0} && {1}",
    Op.OR: "{0} || {1}",
    Op.NOT: "!{0}",
    Op.IF_ELSE_ZERO: "{0} ? {1} : 0",
    Op.SIGN: "({0} > 0) - ({0} < 0) + 0 * {0}",
}
"""The same in C."""

_BY_LANE = (Op.SIN, Op.COS, Op.TAN, Op.ATAN, Op.EXP, Op.LOG, Op.FABS, Op.FLOOR)
_BY_PAIR = {
    Op.ATAN2: "atan2",
    Op.COPYSIGN: "copysign",
    Op.POW: "pow",
    Op.CONSTPOW: "pow",
    Op.FMIN: "fmin",
    Op.FMAX: "fmax",
}
LANES = (
    C
    | {op: f"EACH({C[op].partition('(')[0]}, {{0}})" for op in _BY_LANE}
    | {op: f"EACH_PAIR({name}, {{0}}, {{1}})" for op, name in _BY_PAIR.items()}
    | {
        Op.SQRT: "__builtin_elementwise_sqrt({0})",
        Op.LT: "TRUTH({0} < {1})",
        Op.LE: "TRUTH({0} <= {1})",
        Op.EQ: "TRUTH({0} == {1})",
        Op.NE: "TRUTH({0} != {1})",
        Op.AND: "TRUTH(({0} != 0) & ({1} != 0))",
        Op.OR: "TRUTH(({0} != 0) | ({1} != 0))",
        Op.NOT: "TRUTH({0} == 0)",
        Op.IF_ELSE_ZERO: "WHERE({0} != 0, {1})",
        Op.SIGN: "TRUTH({0} > 0) - TRUTH({0} < 0) + 0 * {0}",
    }
)
"""The same in C on lanes, as ``c/lanes.h`` has them."""

UNARY = {op for op, form in PYTHON.items() if "{1}" not in form}  # operations of one operand

_scope: dict[str, Any] = {**NAMES, "atan": math.atan}
VALUE: dict[int, Callable[[float, float], float]] = {
    operation: eval(f"lambda a, b: {form.format('a', 'b')}", _scope)
    for operation, form in PYTHON.items()
}
"""Value of an operation; one of one argument does not read its second."""
