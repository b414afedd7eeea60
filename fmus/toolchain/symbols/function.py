"""Functions of symbols as a list of instructions on a work array, which is evaluated, rewritten or written as code."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from fmus.toolchain.symbols.expression import Expr, Scalar, operation
from fmus.toolchain.symbols.operations import PYTHON, UNARY, VALUE, Op
from fmus.toolchain.tape_kernel import NAMES

Vector = Sequence[Expr]
Values = list[list[float]]

OFTEN = 20
"""Calls of a function after which it is compiled to Python: that takes as long as a dozen evaluations of it."""

_CONST, _SYMBOL = Op.CONST, Op.SYMBOL  # looked up for every node
_LONGEST = 20_000  # instructions of a function that is compiled; Python takes long for more

_KNOWN: dict[str, Any] = {**NAMES, "atan": math.atan, "inf": math.inf, "nan": math.nan}

Instruction = tuple[int, int, int, int, float]
"""An operation on a work array: its number, the place of its result, the places of its arguments, and its value, where
it is a constant.

Arguments of an input are its number, and that of its element; those of an output its element and the place of its
value, and the output's number stands in place of the result."""


class Function:
    """Vectors of expressions as a function of vectors of symbols.

    ``room``: length of the work array that its instructions need."""

    def __init__(self, name: str, inputs: Sequence[Vector], outputs: Sequence[Vector]) -> None:
        self.name, self.inputs, self.outputs = (
            name,
            [list(v) for v in inputs],
            [list(v) for v in outputs],
        )
        self.nodes, self._ends = sorted_nodes(
            [value for vector in self.outputs for value in vector]
        )
        for node in {node for node in self.nodes if node.op == _SYMBOL}.difference(*self.inputs):
            raise ValueError(f"{self.name}: {node.label!r} is none of its arguments")
        self._calls = 0

    @property
    def instructions(self) -> list[Instruction]:
        return self._written[0]

    @property
    def room(self) -> int:
        return self._written[1]

    @cached_property
    def _written(self) -> tuple[list[Instruction], int]:
        """The instructions and their room; a place is free again once nobody needs what is there."""
        instructions, room = list[Instruction](), 0
        given = {
            symbol: (i, k)
            for i, vector in enumerate(self.inputs)
            for k, symbol in enumerate(vector)
        }
        roots = [
            (value, i, k) for i, vector in enumerate(self.outputs) for k, value in enumerate(vector)
        ]
        uses = dict.fromkeys(self.nodes, 0)
        for root, _, _ in roots:
            uses[root] += 1
        for node in self.nodes:
            if node.op < _CONST:
                uses[node.a] += 1
                uses[node.b] += node.op not in UNARY
        place: dict[Expr, int] = {}
        free: list[int] = []

        def used(operand: Expr) -> int:
            uses[operand] -= 1
            if not uses[operand]:
                free.append(place[operand])
            return place[operand]

        first, write = 0, instructions.append
        for (root, i, k), end in zip(roots, self._ends, strict=True):
            for node in self.nodes[first:end]:
                op, a, b, value = node.op, 0, 0, 0.0
                if op in UNARY:
                    a = b = used(node.a)
                elif op < _CONST:
                    b = used(node.b)
                    a = used(node.a)
                elif op == _CONST:
                    value = node.value
                else:
                    op, (a, b) = Op.INPUT, given[node]
                if free:
                    result = free.pop()
                else:
                    result, room = room, room + 1
                place[node] = result
                write((op, result, a, b, value))
            write((Op.OUTPUT, i, k, used(root), 0.0))
            first = end
        return instructions, room

    def __call__(self, *arguments: Sequence[float] | np.ndarray) -> tuple[np.ndarray, ...]:
        """Values of all outputs at a point."""
        values = [np.asarray(argument, dtype=float).ravel().tolist() for argument in arguments]
        if [*map(len, values)] != [*map(len, self.inputs)]:
            raise ValueError(
                f"{self.name}: arguments of {[*map(len, values)]} elements, not {[*map(len, self.inputs)]}"
            )
        return tuple(np.array(vector, dtype=float) for vector in self.values(values))

    def values(self, arguments: Values) -> Values:
        """Values of all outputs at a point as lists, of arguments that are lists of the right lengths."""
        self._calls += 1
        often = self._calls > OFTEN and len(self.instructions) <= _LONGEST
        return self._compiled(arguments) if often else self._interpreted(arguments)

    def _interpreted(self, values: Values) -> Values:
        found = [[0.0] * len(vector) for vector in self.outputs]
        work = [0.0] * self.room
        for op, place, a, b, value in self.instructions:
            if op < Op.CONST:
                work[place] = VALUE[op](work[a], work[b])
            elif op == Op.CONST:
                work[place] = value
            elif op == Op.INPUT:
                work[place] = values[a][b]
            else:
                found[place][a] = work[b]
        return found

    @cached_property
    def _compiled(self) -> Callable[[Values], Values]:
        """The same instructions in the same order as a function of Python, which gives the same values sooner."""
        lines = ["def compiled(values):"]
        lines += [f" v{i} = values[{i}]" for i in range(len(self.inputs))]
        lines += [f" f{i} = [0.0] * {len(vector)}" for i, vector in enumerate(self.outputs)]
        for op, place, a, b, value in self.instructions:
            if op < Op.CONST:
                lines.append(f" w{place} = {PYTHON[op].format(f'w{a}', f'w{b}')}")
            elif op == Op.CONST:
                lines.append(f" w{place} = {float(value)!r}")
            elif op == Op.INPUT:
                lines.append(f" w{place} = v{a}[{b}]")
            else:
                lines.append(f" f{place}[{a}] = w{b}")
        lines.append(f" return [{', '.join(f'f{i}' for i in range(len(self.outputs)))}]")
        scope = dict(_KNOWN)
        exec("\n".join(lines), scope)
        compiled: Callable[[Values], Values] = scope["compiled"]
        return compiled

    def of(self, *arguments: Sequence[Scalar]) -> list[list[Expr]]:
        """The outputs as expressions of other arguments."""
        new: dict[Expr, Expr] = {}
        for vector, values in zip(self.inputs, arguments, strict=True):
            new |= zip(vector, map(Expr, values), strict=True)
        _rewrite(self.nodes, new)
        return [[new[value] for value in vector] for vector in self.outputs]

    def dependence(self, *marks: Callable[[int], int]) -> list[list[int]]:
        """Bits of all that each element of each output depends on; ``marks``: for each input, its elements' bits."""
        found = [[0] * len(vector) for vector in self.outputs]
        work = [0] * self.room
        for op, place, a, b, _ in self.instructions:
            if op < Op.CONST:
                work[place] = work[a] | work[b]
            elif op == Op.OUTPUT:
                found[place][a] = work[b]
            else:
                work[place] = marks[a](b) if op == Op.INPUT else 0
        return found


def sorted_nodes(roots: Iterable[Expr]) -> tuple[list[Expr], list[int]]:
    """All that the roots consist of, each after its operands; and how many of them the first, the first two… need."""
    nodes: list[Expr] = []
    ends: list[int] = []
    known = set[Expr]()
    add, write = known.add, nodes.append
    for root in roots:
        stack = [root]
        pop = stack.pop
        while stack:
            top = pop()
            if top in known:
                continue
            if top.op < _CONST:
                a, b = top.a, top.b
                if a not in known:
                    stack += (top, a) if b in known else (top, b, a)
                    continue
                if b not in known:
                    stack += (top, b)
                    continue
            add(top)
            write(top)
        ends.append(len(nodes))
    return nodes, ends


def _rewrite(nodes: Iterable[Expr], new: dict[Expr, Expr]) -> None:
    """Add what follows for each node to what is given for some symbols; nodes of no such symbol stay."""
    for node in nodes:
        if node.op < _CONST:
            a, b = new[node.a], new[node.b]
            new[node] = node if a is node.a and b is node.b else operation(node.op, a, b)
        else:
            new.setdefault(node, node)


def substitute(values: Vector, old: Vector, new: Sequence[Scalar]) -> list[Expr]:
    """The same with other expressions in place of some symbols."""
    found = dict(zip(old, map(Expr, new), strict=True))
    _rewrite(sorted_nodes(values)[0], found)
    return [found[value] for value in values]


def symbols_in(values: Vector) -> list[Expr]:
    return [node for node in sorted_nodes(values)[0] if node.op == _SYMBOL]


def depends_on(values: Vector, on: Vector) -> bool:
    return not set(on).isdisjoint(symbols_in(values))
