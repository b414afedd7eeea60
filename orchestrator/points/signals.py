"""Recorded signals among the arrays of a stored point."""

from collections.abc import Mapping

from orchestrator.arrays import Numbers
from orchestrator.points.store import Arrays

_TIMES = "times"
_SIGNAL = "signal "  # beginning of the names of signals


def signal_arrays(times: Numbers, signals: Mapping[str, Numbers]) -> Arrays:
    """Arrays for a `PointStore`.

    ``times``: [s], shape (n,).
    ``signals``: by name, each of shape (n,), in units of their own.
    """
    return {_TIMES: times, **{_SIGNAL + name: values for name, values in signals.items()}}


def take_signals(arrays: Arrays) -> tuple[Numbers, dict[str, Numbers]]:
    """Times [s] and signals by name, which are taken out of the stored arrays."""
    times = arrays.pop(_TIMES)
    names = [name for name in arrays if name.startswith(_SIGNAL)]
    signals = {name.removeprefix(_SIGNAL): arrays.pop(name) for name in names}
    if cut := [name for name, values in signals.items() if values.shape != times.shape]:
        raise ValueError(f"signal {cut[0]} has another length than the times; store the point anew")
    return times, signals
