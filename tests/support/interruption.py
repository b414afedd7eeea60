"""Ctrl-C in the middle of a study of many points."""

from collections.abc import Callable
from typing import TypeVar

Task = TypeVar("Task")
Point = TypeVar("Point")


def interrupted_after(count: int, compute: Callable[[Task], Point]) -> Callable[[Task], Point]:
    """Compute that many points, and then be interrupted."""
    computed: list[Task] = []

    def compute_or_stop(task: Task) -> Point:
        if len(computed) == count:
            raise KeyboardInterrupt
        computed.append(task)
        return compute(task)

    return compute_or_stop
