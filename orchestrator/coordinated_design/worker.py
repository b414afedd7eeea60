"""Imports of everything that a worker of a design over operating points needs."""

from orchestrator.coordinated_design import point
from orchestrator.units import to_unit

__all__ = ["point"]

to_unit("1 ms", "s")
