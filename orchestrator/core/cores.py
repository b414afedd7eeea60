"""How many processor cores there are for a command, and how many threads it can have step."""

import os

MOST_THREADS = 64  # as ``MOST_MEMBERS`` of ``systems/coupling/team.c``


def number_of_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
