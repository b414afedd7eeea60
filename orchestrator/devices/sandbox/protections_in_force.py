"""Protections that keep a foreign FMU from the rest of a machine, and whether this machine has it."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Protection:
    name: str
    in_force: bool
    how: str


END = "the FMU's processes end with gfor"
PROCESSES = "no signals to other processes"
NETWORK = "no network, no UNIX sockets"
WRITING = "no writing outside of its folder"
ATTRIBUTES = "no change of modes, owners and times of other files"
READING = "no reading of the user's files"
ENVIRONMENT = "no environment variables but a short list"
MEMORY = "memory"
DISK = "disk"
TASKS = "number of processes and threads"
CPU = "CPU time"

NAMES = (
    END,
    PROCESSES,
    NETWORK,
    WRITING,
    ATTRIBUTES,
    READING,
    ENVIRONMENT,
    MEMORY,
    DISK,
    TASKS,
    CPU,
)
"""In the order of the pages."""


def in_order(protections: Iterable[Protection]) -> tuple[Protection, ...]:
    """One for each name; what nobody spoke of is not in force."""
    found = {protection.name: protection for protection in protections}
    return tuple(
        found.get(name, Protection(name, False, "nothing on this system does it")) for name in NAMES
    )


def missing(protections: Iterable[Protection]) -> list[str]:
    return [f"{p.name} ({p.how})" for p in protections if not p.in_force]
