"""Importing this module does once, for all workers of a sweep, what takes a worker seconds before its first point.

`Processes` imports it in the process that its workers are copied from.
"""

from orchestrator.cases.power_flow import empty_network
from orchestrator.sweep import point
from orchestrator.units import to_unit

__all__ = ["point"]

empty_network()
to_unit("1 ms", "s")
