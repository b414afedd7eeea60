"""The scalar operations of a function, in the codes of a tape."""

from collections.abc import Iterator

from fmus.toolchain.symbols import Function, Op
from fmus.toolchain.symbols.operations import UNARY

CODES = {
    # operation -> code of a tape, as `c/tape.c` and `tape_kernel.py` know it
    **{Op.ADD: 0, Op.SUB: 1, Op.MUL: 2, Op.DIV: 3, Op.POW: 4, Op.CONSTPOW: 4, Op.ATAN2: 5, Op.COPYSIGN: 6},
    **{Op.FMIN: 7, Op.FMAX: 8, Op.LT: 9, Op.LE: 10, Op.EQ: 11, Op.NE: 12, Op.AND: 13, Op.OR: 14, Op.IF_ELSE_ZERO: 15},
    **{Op.NEG: 16, Op.INV: 17, Op.SQ: 18, Op.TWICE: 19, Op.SQRT: 20, Op.SIN: 21, Op.COS: 22, Op.TAN: 23, Op.EXP: 24},
    **{Op.LOG: 25, Op.FABS: 26, Op.FLOOR: 27, Op.NOT: 28},
}
ADD, SUB, MUL = (CODES[operation] for operation in (Op.ADD, Op.SUB, Op.MUL))
INPUT, CONSTANT, OUTPUT = -1, -2, -3
"""Codes of what is no operation: an element of an argument, a number, an element of a result."""


def instructions(function: Function, name: str) -> Iterator[tuple[int, tuple[int, ...], tuple[int, ...], float]]:
    """Code, sources, targets and value of each operation in order.

    Sources and targets are numbers of registers, which are used again and again; of `INPUT` the source, and of
    `OUTPUT` the target, is an argument's or result's number and the element in it. The value is that of `CONSTANT`."""
    for operation, place, a, b, value in function.instructions:
        match operation:
            case Op.INPUT:
                yield INPUT, (a, b), (place,), 0.0
            case Op.CONST:
                yield CONSTANT, (), (place,), value
            case Op.OUTPUT:
                yield OUTPUT, (b,), (place, a), 0.0
            case _ if operation in CODES:
                yield CODES[operation], (a,) if operation in UNARY else (a, b), (place,), 0.0
            case _:
                raise ValueError(f"{name}: operation {operation} has no code of a tape yet; add it to instructions.py")
