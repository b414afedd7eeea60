"""What a worker of any study needs beside the module of its points: imported once, it saves each worker time."""

from orchestrator.core.units import to_unit
from orchestrator.studies.points import task

__all__ = ["task"]

to_unit("1 ms", "s")
