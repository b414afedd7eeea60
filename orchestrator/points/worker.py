"""What a worker of any study needs beside the module of its points: imported once, it saves each worker time."""

from orchestrator.points import task
from orchestrator.units import to_unit

__all__ = ["task"]

to_unit("1 ms", "s")
