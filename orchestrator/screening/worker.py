"""Imports of everything that a worker of a screening needs, as `orchestrator.sweep.worker` has them for sweeps."""

from orchestrator.screening import point
from orchestrator.units import to_unit

__all__ = ["point"]

to_unit("1 ms", "s")
