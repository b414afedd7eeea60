"""Devices that give more current in a disturbance than their binding declares."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.binding.misfits import of_dip
from orchestrator.coupling.system import System
from orchestrator.fmi.port import BoundDescription
from orchestrator.watch.finding import MISFIT, Finding
from orchestrator.watch.seen import Seen

_CYCLE, LASTS = 0.02, 0.08
"""Time [s] over which a current is averaged, and for which it is above its limit; what is shorter, a limit may need."""

ABOVE = 1.05  # part of the declared current from which one is above it, as in `gfor fmu check`


def above_declared(seen: Seen, system: System) -> Iterator[Finding]:
    cycle = round(_CYCLE / seen.interval) if seen.interval else 0
    for name, plan in system.components.items():
        described = plan.description
        if not cycle or not isinstance(described, BoundDescription) or described.port.current_limit is None:
            continue
        size = np.hypot(seen.last[f"{name}.i_re"], seen.last[f"{name}.i_im"]) * SYSTEM_BASE_MVA / plan.number("S_n")
        limit, means = described.port.current_limit, np.convolve(size, np.full(cycle, 1 / cycle), "valid")
        edges = np.flatnonzero(np.diff(np.concatenate([[False], means > ABOVE * limit, [False]]).astype(np.int8)))
        long = [(a, b) for a, b in edges.reshape(-1, 2) if (b - a + cycle - 1) * seen.interval > LASTS]
        if long and long[0][0]:  # at rest it is told by itself
            begin = float(seen.times[long[0][0] + cycle - 1])
            misfit = of_dip(float(max(means[a:b].max() for a, b in long)), limit, begin)
            yield Finding(MISFIT, begin, name, "i_re", misfit.sentence(name), None, misfit.figures)


def told_of(findings: Sequence[Mapping[str, Any]], component: str) -> Mapping[str, Any] | None:
    """Which of the findings, as JSON, tells that of a component; None where none does."""
    return next(
        (f for f in findings if f["kind"] == MISFIT and f.get("component") == component and "declared" in f), None
    )
