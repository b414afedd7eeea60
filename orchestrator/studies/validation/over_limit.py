"""A current above a limit that a model of phasors says it has, and does not represent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.fmi.description import FmuDescription

_OUTPUT = "current_limit"  # the current in parts of its limit, of a model that does not limit it
_SHORTEST = 0.02  # [s]: from a period on, the course after it is another


@dataclass(frozen=True)
class OverLimit:
    """When a current is above its limit: from the first sample on [s], how long in all [s], and its largest part."""

    begin: float
    length: float
    largest: float


def limit_outputs(description: FmuDescription) -> tuple[str, ...]:
    """The output that tells of a limit which a device lacks; empty where it has none."""
    info = description.variables.get(_OUTPUT)
    return () if info is None or info.causality != "output" else (_OUTPUT,)


def over_limit(parts: Numbers, step_size: float) -> OverLimit | None:
    """When a current is above its limit, for a period or longer.

    ``parts``: of the limit, after each step. One that never moves is a limit by itself, and no current."""
    above = np.flatnonzero(parts > 1)
    length = step_size * len(above)
    if length < _SHORTEST or np.ptp(parts) == 0:
        return None
    return OverLimit(step_size * float(above[0] + 1), length, float(parts.max()))
