"""The order of a tape's operations: as few runs of one operation as a simple rule finds."""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable

from fmus.toolchain.instructions import ADD, MUL, SUB

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
