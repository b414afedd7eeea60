"""Recorded runs side by side: how far two differ in a signal, and the modes that each rings with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import AnalysisError, InputError, few
from orchestrator.linear.signals.identification import (
    TOLERANCE,
    IdentifiedMode,
    identify_modes,
    sampling,
)
from orchestrator.linear.signals.mode_doubts import (
    COARSER,
    SHORTER,
    WindowPart,
    part_of,
    with_doubts,
    worth_showing,
)
from orchestrator.output.results.signals import signal
from orchestrator.studies.signals.common_times import common_times
from orchestrator.studies.signals.measured import is_measured, measured_modes

if TYPE_CHECKING:
    import xarray as xr

_SHOWN = 40  # largest number of signals that an error names; the others are counted
_WEAKEST = 1e-3


@dataclass(frozen=True)
class Comparison:
    expression: str
    unit: str
    # largest deviation of each run from its own start [unit of the signal]
    deviations: tuple[float, float]
    # largest, rms: difference between the runs at the times of the run with the longer interval [unit of the signal];
    # see `common_times`
    largest: float
    rms: float
    at: float  # time of the largest difference [s]
    # strongest oscillation in each run from ``start`` on; None where none is found
    modes: tuple[IdentifiedMode | None, IdentifiedMode | None]


def require_numbers(curve: xr.DataArray, expression: str, label: str) -> None:
    bad = np.flatnonzero(~np.isfinite(curve.values))
    if len(bad):
        times = curve["time"].values
        raise InputError(
            f"{label}: {expression} is no finite number ({curve.values[bad[0]]}) at t = {times[bad[0]]:.6g} s, and at "
            f"{len(bad)} of {len(times)} times in all; take another signal, or a part of the run without them"
        )


def recorded(dataset: xr.Dataset, expression: str, label: str) -> xr.DataArray:
    if not isinstance(expression, str):
        raise InputError(
            f"signal = {expression!r}; give one signal, 'a.b' or the difference 'a.b - c.d' of two"
        )
    found = signal(dataset, expression)
    if found is None:
        known = list(map(str, dataset.data_vars))
        hint = _spaced(expression, known) or close_names(expression, known)
        raise InputError(
            f"{label}: signal {expression!r} was not recorded; there are: {few(known, _SHOWN)}; "
            f"{hint + ' ' if hint else ''}a signal is 'a.b', or the difference 'a.b - c.d' of two"
        )
    return found


def _spaced(expression: str, known: Sequence[str]) -> str:
    """A hint at the blanks around the minus of a difference of two signals."""
    for place in (k for k, letter in enumerate(expression) if letter == "-"):
        one, other = expression[:place].strip(), expression[place + 1 :].strip()
        if one in known and other in known:
            return f"write {f'{one} - {other}'!r}, with blanks around the minus;"
    return ""


def strongest_modes(
    curve: xr.DataArray,
    start: float | None = None,
    stop: float | None = None,
    *,
    order: int | None = None,
) -> list[IdentifiedMode]:
    """Return what a signal rings with between two times [s], strongest first; see `identify_modes`.

    ``order``: of a measured signal's model, where it is not to be found from its noise; see `order_of`.

    What has less than a thousandth of the strongest's amplitude is left out, whatever the trend that an oscillation is
    on. Each mode has its doubts."""
    window = curve.sel(time=slice(start, stop))
    found = _modes_of(window, order=order)
    begin, end = _ends(window)
    try:
        later = window.sel(time=slice(begin + SHORTER * (end - begin), None))
        others = _modes_of(later, COARSER)
    except AnalysisError:
        others = None
    middle = (begin + end) / 2
    halves = [_part(window.sel(time=side)) for side in (slice(None, middle), slice(middle, None))]
    whole = part_of(window["time"].values, window.values, found)
    kept = worth_showing(found, end - begin, _WEAKEST)
    return with_doubts(kept, end - begin, others, halves, whole.noise_like)


def modes_without_doubts(curve: xr.DataArray, *, order: int | None = None) -> list[IdentifiedMode]:
    """The same modes as `strongest_modes` returns of a whole signal, of which nobody asks for doubts."""
    begin, end = _ends(curve)
    return worth_showing(_modes_of(curve, order=order), end - begin, _WEAKEST)


def _ends(window: xr.DataArray) -> tuple[float, float]:
    return float(window["time"][0]), float(window["time"][-1])


def _part(window: xr.DataArray) -> WindowPart:
    try:
        modes = _modes_of(window)
    except AnalysisError:
        modes = []
    return part_of(window["time"].values, window.values, modes)


def _modes_of(
    window: xr.DataArray, coarser: float = 1.0, order: int | None = None
) -> list[IdentifiedMode]:
    """Modes of a part of a signal; ``coarser`` is a factor of what is taken for noise."""
    if is_measured(window):
        return measured_modes(window, coarser, order)
    # Oscillations are small beside the value that they are around, and would count as noise beside it.
    deviation = window.values - float(window.mean())
    return identify_modes(window["time"].values, deviation, tolerance=coarser * TOLERANCE)


def compare(
    a: xr.Dataset, b: xr.Dataset, expression: str, start: float, labels: tuple[str, str]
) -> Comparison:
    """Compare one signal of two runs; oscillations are looked for from ``start`` [s] on."""
    first, second = (
        recorded(run, expression, label) for run, label in zip((a, b), labels, strict=True)
    )
    for curve, label in zip((first, second), labels, strict=True):
        require_numbers(curve, expression, label)
    common = common_times(first["time"].values, second["time"].values, labels)
    y_1, y_2 = (common.values(run, curve.values) for run, curve in enumerate((first, second)))
    for label, values in zip(labels, (y_1, y_2), strict=True):
        if not np.isfinite(values).all():
            raise InputError(
                f"{label}: {expression!r} has samples that are missing, the first at t = "
                f"{common.times[int((~np.isfinite(values)).argmax())]:g} s; compare a part without them"
            )
    difference = y_2 - y_1
    worst = int(np.argmax(np.abs(difference)))
    return Comparison(
        expression,
        str(
            first.attrs.get("units")
            or a[expression.partition(" - ")[0].strip()].attrs.get("units", "")
        ),
        deviations=(float(np.abs(y_1 - y_1[0]).max()), float(np.abs(y_2 - y_2[0]).max())),
        largest=float(abs(difference[worst])),
        rms=float(np.sqrt(np.mean(difference**2))),
        at=float(common.times[worst]),
        modes=(_strongest(first, start), _strongest(second, start)),
    )


def most_different(
    a: xr.Dataset,
    b: xr.Dataset,
    count: int = 10,
    labels: tuple[str, str] = ("the first run", "the second run"),
) -> list[str]:
    """Signals that both runs have, those first whose difference is largest beside their own deviation."""
    times = common_times(a["time"].values, b["time"].values, labels)

    def share(name: str) -> float:
        one, other = (times.values(number, run[name].values) for number, run in enumerate((a, b)))
        deviation = max(np.abs(one - one[0]).max(), np.abs(other - other[0]).max(), 1e-12)
        found = float(np.abs(one - other).max() / deviation)
        return found if np.isfinite(found) else -1.0  # what is no number cannot be compared

    common = [str(name) for name in a.data_vars if name in b.data_vars]
    return sorted(common, key=share, reverse=True)[:count]


def _strongest(curve: xr.DataArray, start: float) -> IdentifiedMode | None:
    """Return the strongest oscillation from ``start`` [s] on.

    Above a quarter of the sampling frequency there is perhaps no oscillation of the system."""
    times = curve["time"].values
    highest = 0.25 / sampling(times).interval if len(times) > 1 else 0.0
    try:
        found = [m for m in strongest_modes(curve, start) if 0.05 < m.frequency_hz <= highest]
    except AnalysisError:
        return None
    return found[0] if found else None
