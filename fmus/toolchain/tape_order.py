"""The scalar operations of a function in the codes of a tape, and their order there: as few runs of one operation as a
simple rule finds."""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator

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
                raise ValueError(f"{name}: operation {operation} has no code of a tape yet; add it to tape_order.py")


Operation = tuple[int, ...]
"""Code, and the values that it takes."""

MUL_ADD, MUL_SUB, SUB_MUL, MUL_ADD_MUL, MUL_SUB_MUL = range(29, 34)
"""Codes of a·b + c, a·b − c, c − a·b, a·b + c·d, a·b − c·d."""


def with_pairs(operations: dict[int, Operation], results: Iterable[int]) -> dict[int, Operation]:
    """The same with products inside the sum or difference that alone needs them; roundings stay as they are."""
    uses = Counter(value for operation in operations.values() for value in operation[1:])
    uses.update(results)
    paired = operations.copy()

    def factors(value: int) -> Operation:
        """Of a product that nothing else needs, else nothing."""
        operation = operations.get(value, (-1,))
        return operation[1:] if operation[0] == MUL and uses[value] == 1 else ()

    for value, (code, *taken) in operations.items():
        if code not in (ADD, SUB):
            continue
        a, b = taken
        left, right = factors(a), factors(b)
        if left and right:
            paired[value] = (MUL_ADD_MUL if code == ADD else MUL_SUB_MUL, *left, *right)
        elif left:
            paired[value] = (MUL_ADD if code == ADD else MUL_SUB, *left, b)
        elif right:
            paired[value] = (MUL_ADD if code == ADD else SUB_MUL, *right, a)
        if left:
            paired.pop(a)
        if right:
            paired.pop(b)
    return paired


def runs_of(operations: dict[int, Operation]) -> list[tuple[int, list[int]]]:
    """Code and values of each run; a value follows those that it is made from, in its own run as well.

    ``operations``: By the value that each gives."""
    users: defaultdict[int, list[int]] = defaultdict(list)
    missing: dict[int, int] = {}
    ready: defaultdict[int, deque[int]] = defaultdict(deque)
    for value, (code, *taken) in operations.items():
        needed = operations.keys() & taken
        missing[value] = len(needed)
        for other in needed:
            users[other].append(value)
        if not needed:
            ready[code].append(value)
    runs = []
    while ready:
        code = max(ready, key=lambda c: (len(ready[c]), -c))
        queue, run = ready[code], list[int]()
        while queue:
            run.append(value := queue.popleft())
            for user in users[value]:
                missing[user] -= 1
                if not missing[user]:
                    ready[operations[user][0]].append(user)
        del ready[code]
        runs.append((code, run))
    return runs
