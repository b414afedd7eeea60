"""The scalar operations of a CasADi function, in the codes of a tape: the one place that reads them."""

from collections.abc import Iterator

import casadi as ca

from fmus.toolchain.kernel import scalar_function

CODES = {
    # CasADi's operation -> code of a tape, as `c/tape.c` and `tape_in_python.py` know it
    **{ca.OP_ADD: 0, ca.OP_SUB: 1, ca.OP_MUL: 2, ca.OP_DIV: 3, ca.OP_POW: 4, ca.OP_CONSTPOW: 4, ca.OP_ATAN2: 5},
    **{ca.OP_COPYSIGN: 6, ca.OP_FMIN: 7, ca.OP_FMAX: 8, ca.OP_LT: 9, ca.OP_LE: 10, ca.OP_EQ: 11, ca.OP_NE: 12},
    **{ca.OP_AND: 13, ca.OP_OR: 14, ca.OP_IF_ELSE_ZERO: 15},
    **{ca.OP_NEG: 16, ca.OP_INV: 17, ca.OP_SQ: 18, ca.OP_TWICE: 19, ca.OP_SQRT: 20, ca.OP_SIN: 21, ca.OP_COS: 22},
    **{ca.OP_TAN: 23, ca.OP_EXP: 24, ca.OP_LOG: 25, ca.OP_FABS: 26, ca.OP_FLOOR: 27, ca.OP_NOT: 28},
}
ADD, SUB, MUL = (CODES[operation] for operation in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL))
INPUT, CONSTANT, OUTPUT, SAME = -1, -2, -3, -4
"""Codes of what is no operation: an element of an argument, a number, an element of a result, a copy."""

_OTHERS = {ca.OP_INPUT: INPUT, ca.OP_CONST: CONSTANT, ca.OP_OUTPUT: OUTPUT, ca.OP_ASSIGN: SAME}


def instructions(function: ca.Function, name: str) -> Iterator[tuple[int, list[int], list[int], float]]:
    """Code, sources, targets and value of each operation in order, results dense.

    Sources and targets are numbers of registers, which are used again and again; of `INPUT` the source, and of
    `OUTPUT` the target, is an argument's or result's number and the element in it. The value is that of `CONSTANT`."""
    dense = scalar_function(function, name)
    codes = CODES | _OTHERS
    for k in range(dense.n_instructions()):
        code = codes.get(operation := dense.instruction_id(k))
        if code is None:
            raise ValueError(f"{name}: operation {operation} of CasADi has no code yet; add it to instructions.py")
        value = dense.instruction_constant(k) if code == CONSTANT else 0.0
        yield code, dense.instruction_input(k), dense.instruction_output(k), value
