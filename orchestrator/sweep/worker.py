"""Imports of everything that a worker of a sweep needs. Imported once for all workers, this module saves each worker
seconds before its first point.

`Processes` imports it in the process that its workers are copied from.
"""

from orchestrator.sweep import point
from orchestrator.units import to_unit

__all__ = ["point"]

to_unit("1 ms", "s")
