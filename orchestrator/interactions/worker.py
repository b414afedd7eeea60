"""Imports of everything that a worker needs; see `orchestrator.sweep.worker`."""

from orchestrator.interactions import point
from orchestrator.units import to_unit

__all__ = ["point"]

to_unit("1 ms", "s")
