"""Whether a device's current stays within the limit that its binding declares."""

from collections.abc import Iterator

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.binding.misfits import Misfit
from orchestrator.cases.plausible_values import value_of
from orchestrator.coupling.system import System
from orchestrator.fmi.port import BoundDescription
from orchestrator.watch.finding import MISFIT, Finding
from orchestrator.watch.seen import Seen

_BEYOND, _LASTS = 1.05, 0.06
"""Parts of the limit, and how long [s] they are exceeded without a break: the filters' own current is gone by then."""

ABOVE = "above its current limit"


def above_declared(seen: Seen, system: System) -> Iterator[Finding]:
    """What a power flow at rest does not show: in a dip it gives more than is declared."""
    looks = int(np.ceil(_LASTS / seen.interval)) + 1 if seen.interval else 0
    for name, plan in system.components.items():
        described, rating = plan.description, value_of(plan, "S_n")
        limit = described.port.current_limit if isinstance(described, BoundDescription) else None
        if limit is None or rating is None or f"{name}.i_im" not in seen.last or not 0 < looks <= len(seen.times):
            continue
        size = np.hypot(seen.last[f"{name}.i_re"], seen.last[f"{name}.i_im"]) * SYSTEM_BASE_MVA / rating
        least = np.lib.stride_tricks.sliding_window_view(size, looks).min(axis=1)
        at = int(np.argmax(least))
        if least[at] > _BEYOND * limit:
            says = f"{least[at]:.3g} pu of its rating for {_LASTS:g} s from {seen.times[at]:.4g} s on"
            found = Misfit(ABOVE, f"{says}; {limit:g} pu is declared", {"current": float(least[at])})
            yield Finding(MISFIT, float(seen.times[at]), name, "", found.sentence(name), None, found.figures)
