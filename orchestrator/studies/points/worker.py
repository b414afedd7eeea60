"""Modules that a worker of any study needs beside that of its points: imported once, they save each worker time."""

from orchestrator.core.units import to_unit
from orchestrator.studies.points import task

__all__ = ["task"]

to_unit("1 ms", "s")
