"""A model's functions as data: a tape, which one compiled library executes for every model.

A tape has sections, one for each function. Values lie in one row of slots: parameters p, calculated c, inputs u, states
x, voltages v of a network that is solved as data, γh of an implicit step; numbers; what follows from p and c alone and
is evaluated only where these change; then what a section computes. A section is runs of one operation each, the slots
of its results, and the slots that each operation takes. Operations are those of the equations, and so is every
rounding; only their order is another, where nothing depends on it. ``c/tape.c`` executes a tape, and where that cannot
be had, `tape_kernel.py` does."""

import struct
import zlib
from array import array
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path

from fmus.toolchain.elimination_plan import plan_elimination
from fmus.toolchain.model import Model
from fmus.toolchain.nodal_equations import LARGEST_REST
from fmus.toolchain.plan import Plan
from fmus.toolchain.symbols import Expr, Function, Op
from fmus.toolchain.symbols.operations import UNARY

CODES = {
    # operation -> code of a tape, as `c/tape.c` and `tape_kernel.py` know it
    **{
        Op.ADD: 0,
        Op.SUB: 1,
        Op.MUL: 2,
        Op.DIV: 3,
        Op.POW: 4,
        Op.CONSTPOW: 4,
        Op.ATAN2: 5,
        Op.COPYSIGN: 6,
    },
    **{
        Op.FMIN: 7,
        Op.FMAX: 8,
        Op.LT: 9,
        Op.LE: 10,
        Op.EQ: 11,
        Op.NE: 12,
        Op.AND: 13,
        Op.OR: 14,
        Op.IF_ELSE_ZERO: 15,
    },
    **{
        Op.NEG: 16,
        Op.INV: 17,
        Op.SQ: 18,
        Op.TWICE: 19,
        Op.SQRT: 20,
        Op.SIN: 21,
        Op.COS: 22,
        Op.TAN: 23,
        Op.EXP: 24,
    },
    **{Op.LOG: 25, Op.FABS: 26, Op.FLOOR: 27, Op.NOT: 28},
}
ADD, SUB, MUL = (CODES[operation] for operation in (Op.ADD, Op.SUB, Op.MUL))
Operation = tuple[int, ...]  # code, and the values that it takes

MUL_ADD, MUL_SUB, SUB_MUL, MUL_ADD_MUL, MUL_SUB_MUL = range(29, 34)
"""Codes of a·b + c, a·b − c, c − a·b, a·b + c·d, a·b − c·d."""


def with_pairs(operations: dict[int, Operation], results: Iterable[int]) -> dict[int, Operation]:
    """The same with products inside the sum or difference that alone needs them; roundings stay as they are."""
    uses = Counter(value for operation in operations.values() for value in operation[1:])
    uses.update(results)
    paired = operations.copy()

    def factors(value: int) -> Operation:
        """Return the factors of a product that nothing else needs, else nothing."""
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
            value = queue.popleft()
            run.append(value)
            for user in users[value]:
                missing[user] -= 1
                if not missing[user]:
                    ready[operations[user][0]].append(user)
        del ready[code]
        runs.append((code, run))
    return runs


MAGIC = b"gfortape"  # the first bytes of a tape
VERSION = 1  # of its format, which the functions in C compare

# executes tapes for a slave
LIBRARY = tuple(Path(__file__).with_name("c") / name for name in ("tape.c", "slave.c"))


def tape_of(model: Model) -> bytes:
    nodal, plan = model.nodal, Plan([], [0], [], [], [0], [])
    elimination = plan_elimination(model) if model.integrator == "sdirk" else None
    solved = nodal or elimination
    if solved:
        plan = solved.plan
    groups = {"p": model.parameters, "c": model.calculated, "u": model.inputs, "x": model.states}
    sizes = {group: len(variables) for group, variables in groups.items()}
    buses = len(plan.order) if nodal else 0
    values = _Values(sizes | {"v": 2 * buses, "g": 1})
    at = "xupcv" if nodal else "xupc"
    often = {
        "outputs": values.read(model.outputs_function, "outputs", at),
        "derivatives": values.read(model.derivatives, "derivatives", at),
        "currents": values.read(nodal.currents, "currents", "xupc") if nodal else [],
    }
    drawn = "upc" if nodal else "pcg"  # what the matrix depends on
    seldom = {
        "initialise": values.read(model.initialise, "initialise", "p"),
        "requirements": values.read(model.requirements, "requirements", "pc"),
        "matrix": values.read(solved.values, "matrix", drawn) if solved else [],
    }
    rows = {name: values.behind(results, values.fixed) for name, results in often.items()}
    taken = {
        value for row in rows.values() for operation in row.values() for value in operation[1:]
    }
    kept = taken.union(*often.values()) & values.fixed
    rows |= {name: values.behind(results) for name, results in seldom.items()}

    lists = _Lists(values)
    fixed = lists.add_fixed(values.behind(kept), kept)
    for name in ("initialise", "requirements", "outputs", "derivatives", "matrix", "currents"):
        lists.add(rows[name], (often | seldom)[name])
    held = [index for index, state in enumerate(model.states) if state.stepwise]
    given = list(nodal.given) if nodal else []
    head = [
        *sizes.values(),
        len(model.outputs),
        int(elimination is not None),
        len(held),
        len(given),
        buses,
    ]
    head += [
        len(plan.order),
        len(plan.matrix_column),
        len(plan.column),
        len(values.numbers),
        fixed,
        lists.slots,
    ]
    head += lists.lengths
    body = [struct.pack("<d", LARGEST_REST), array("i", head).tobytes(), *values.numbers]
    body += [array("i", numbers).tobytes() for numbers in (held, given, *plan.tables().values())]
    content = b"".join([*body, *(numbers.tobytes() for numbers in lists.lists)])
    return struct.pack("<8s4I", MAGIC, VERSION, 24 + len(content), zlib.crc32(content), 0) + content


class _Values:
    """Every value once: an argument's element, a number, or an operation on others."""

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self.first: dict[str, int] = {}  # of each argument
        self.operations: list[Operation | None] = []  # by value
        for group, size in sizes.items():
            self.first[group] = len(self.operations)
            self.operations += [None] * size
        self.arguments = len(self.operations)
        self.numbers: dict[bytes, int] = {}  # by their bits: −0.0 is not 0.0, and a NaN is itself
        self.fixed = set(range(sizes["p"] + sizes["c"]))
        self._known: dict[Operation, int] = {}

    def read(self, function: Function, name: str, groups: str) -> list[int]:
        """The values of a function's results, one after the other."""
        value: dict[Expr, int] = {}
        for group, symbols in zip(groups, function.inputs, strict=True):
            value |= zip(symbols, count(self.first[group]), strict=False)
        for node in function.nodes:
            if node.op == Op.CONST:
                value[node] = self._number(struct.pack("<d", node.value))
            elif node.op in CODES:
                taken = (value[node.a],) if node.op in UNARY else (value[node.a], value[node.b])
                value[node] = self._operation((CODES[node.op], *taken))
            elif node.op != Op.SYMBOL:
                raise ValueError(
                    f"{name}: operation {node.op} has no code of a tape yet; add it to `CODES`"
                )
        return [value[result] for vector in function.outputs for result in vector]

    def _number(self, bits: bytes) -> int:
        found = self.numbers.get(bits)
        if found is None:
            found = self.numbers[bits] = len(self.operations)
            self.operations.append(None)
            self.fixed.add(found)
        return found

    def _operation(self, operation: Operation) -> int:
        found = self._known.get(operation)
        if found is None:
            found = self._known[operation] = len(self.operations)
            self.operations.append(operation)
            if self.fixed.issuperset(operation[1:]):
                self.fixed.add(found)
        return found

    def behind(
        self, results: Iterable[int], known: set[int] | frozenset[int] = frozenset()
    ) -> dict[int, Operation]:
        """The operations that some values need, in order, by the value that each gives; without those already known."""
        needed, waiting = dict[int, Operation](), list(results)
        while waiting:
            value = waiting.pop()
            if value not in needed and value not in known and (operation := self.operations[value]):
                needed[value] = operation
                waiting += operation[1:]
        return dict(sorted(needed.items()))


class _Lists:
    """Runs, results and operands of sections, as numbers of slots."""

    def __init__(self, values: _Values) -> None:
        self._slot = {
            value: slot
            for slot, value in enumerate([*range(values.arguments), *values.numbers.values()])
        }
        self._first = self.slots = len(self._slot)
        self.lengths: list[int] = []
        self.lists: list[array[int]] = []

    def add_fixed(self, operations: dict[int, Operation], kept: set[int]) -> int:
        """Add the first section, whose values stay where others use them; returns their number."""
        before = self.slots
        self._slot = self._add(with_pairs(operations, kept), [])
        self._first = self.slots
        return self._first - before

    def add(self, operations: dict[int, Operation], results: list[int]) -> None:
        self._add(with_pairs(operations, results), results)

    def _add(self, operations: dict[int, Operation], results: list[int]) -> dict[int, int]:
        """Slots of all values then."""
        runs, operands, slot, place = array("i"), array("i"), self._slot.copy(), self._first
        for code, values in runs_of(operations):
            runs.extend((code, len(values)))
            for value in values:
                operands.extend(slot[taken] for taken in operations[value][1:])
                slot[value], place = place, place + 1
        self.lists += [runs, array("i", [slot[value] for value in results]), operands]
        self.lengths += [len(runs) // 2, len(results), len(operands)]
        self.slots = max(self.slots, place)
        return slot
