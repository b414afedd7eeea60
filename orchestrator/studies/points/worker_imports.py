"""Imported once for all worker processes of any study, beside the module of its points: it saves each worker time.

`processes` starts the workers and ends them."""

from orchestrator.core.units import to_unit
from orchestrator.studies.points import task

__all__ = ["task"]

to_unit("1 ms", "s")
