"""The swing of machines against each other at the end of a run, beside its largest."""

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.runs.run import RunResult

SETTLED = 0.25
"""A swing has settled where its last period has at most this part of its largest one. A mode of 5 % gets there in four
to five periods; in runs of 0.9 s to 2 s after a fault 0.65 to 1 were left, after 7 s and more 0.01 to 0.1."""

_SMALLEST = 1e-6  # difference of speeds [pu] that is no swing
_PERIOD = 1.0  # of a swing whose mode is not known [s]
_SPEEDS = ("omega", "machine.omega")  # as an output, and as a state


def has_settled(result: RunResult, period: float = _PERIOD) -> bool | None:
    """Tell whether the machines' speeds have settled since the last event; None where none was recorded.

    ``period``: of the swing [s], over which its size is taken."""
    signals = _speeds(result)
    if signals is None:
        return None
    times, speeds = signals
    if len(times) < 2:
        return None
    against = speeds - speeds.mean(axis=0) if len(speeds) > 1 else speeds
    sizes = [
        float(np.ptp(against[:, (times >= begin) & (times <= begin + period)], axis=1).max())
        for begin in np.arange(times[0], times[-1] - period, period / 4)
    ]
    last = float(np.ptp(against[:, times >= times[-1] - period], axis=1).max())
    largest = max(sizes, default=last)
    return largest < _SMALLEST or last <= SETTLED * largest


def _speeds(result: RunResult) -> tuple[Numbers, Numbers] | None:
    """Times since the last event [s], and the recorded speeds of the machines at them, a row each."""
    if result.dataset is None or "time" not in result.dataset:
        return None
    machines = dict.fromkeys(state.partition(".")[0] for state in result.modes.swing)
    recorded = [
        name
        for machine in machines
        for name in [f"{machine}.{speed}" for speed in _SPEEDS]
        if name in result.dataset
    ]
    if not recorded:
        return None
    last = max((event.time for event in result.modes.prepared.events), default=0.0)
    rows = result.dataset[recorded].sel(time=slice(last, None))
    return rows["time"].values, np.array([rows[name].values for name in recorded])
