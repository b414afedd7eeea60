"""The electromechanical mode as the simulated response shows it, beside its eigenvalue."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.signals.identification import (
    IdentifiedMode,
    identify_modes,
    nearest,
    sampling,
)
from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.results.signals import signal
from orchestrator.simulation.watch.finding import Finding, Kind
from orchestrator.studies.modes.modes import ModesResult

if TYPE_CHECKING:
    import xarray as xr

_COARSEST = 0.25  # record interval [periods of the mode] up to which a ring-down is shown
LEAST_PERIODS = 1  # least number of the mode's periods in the window of a ring-down

_ENDS: frozenset[Kind] = frozenset({"run_away", "loss_of_synchronism", "not_finite", "failure"})
"""Findings after which the response is no swing around the operating point."""

# relative difference of frequency up to which an oscillation that is found is the mode itself
_SAME = 0.2


def ring_down_of(
    modes: ModesResult,
    dataset: xr.Dataset,
    findings: Sequence[Finding],
    after: ModesResult | str | None = None,
) -> tuple[IdentifiedMode | None, str]:
    """The case's first mode as the simulated response shows it; else None and why, where that is to be said.

    ``after``: the modes of what the events leave, as `modes_after` has them; the response rings in these."""
    table = modes.prepared.case.table.analysis.ring_down
    mode = (after if isinstance(after, ModesResult) else modes).electromechanical
    recorded = None if table is None else signal(dataset, table.signal)
    if table is None or mode is None or recorded is None:
        return None, ""
    window = recorded.sel(time=slice(table.start, None))
    times = window["time"].values
    used = sampling(times)
    interval = used.interval
    if interval * mode.frequency_hz > _COARSEST:
        return None, (
            f"no ring-down is shown: {table.signal} is known every {interval:g} s, more than a quarter of the period "
            f"of {1 / mode.frequency_hz:.3g} s of the mode at {mode.frequency_hz:.4g} Hz, which it would show at "
            f"another frequency; {used.remedy}"
        )
    why = after if isinstance(after, str) else _obstacle(modes, mode, times, findings)
    if why:
        return None, f"no ring-down of {table.signal} is shown: {why}"
    try:
        seen = nearest(identify_modes(times, window.values), mode.eigenvalue)
    except AnalysisError:
        return None, ""
    if seen is not None and not seen.frequency_hz:
        return None, f"no ring-down of {table.signal} is shown: it does not swing"
    if seen is not None and abs(seen.frequency_hz - mode.frequency_hz) > _SAME * mode.frequency_hz:
        return None, (
            f"no ring-down of {table.signal} is shown: it swings at {seen.frequency_hz:.4g} Hz, and the mode at "
            f"{mode.frequency_hz:.4g} Hz"
        )
    return seen, ""


def _obstacle(modes: ModesResult, mode: Mode, times: Numbers, findings: Sequence[Finding]) -> str:
    """Why a swing in a window is not the mode, if that is known; else empty."""
    if len(times) < 2:
        return ""
    lost = next((finding for finding in findings if finding.kind in _ENDS), None)
    if lost is not None:
        return f"the run went wrong at t = {lost.time:.4g} s ({lost.kind.replace('_', ' ')})"
    first, last = float(times[0]), float(times[-1])
    other = next((f for f in findings if _is_other(f, mode.frequency_hz)), None)
    if other is not None:
        return f"it swings at {other.figures['frequency_hz']:.4g} Hz as well, which does not decay"
    event = next((event for event in modes.prepared.events if first < event.time < last), None)
    if event is not None:
        return f"{event} falls into its window, from t = {first:.4g} s to t = {last:.4g} s"
    if (last - first) * mode.frequency_hz < LEAST_PERIODS:
        return (
            f"its window, from t = {first:.4g} s to t = {last:.4g} s, has fewer than {LEAST_PERIODS} periods of the "
            f"mode at {mode.frequency_hz:.4g} Hz"
        )
    return ""


def _is_other(finding: Finding, frequency_hz: float) -> bool:
    found = finding.figures.get("frequency_hz")
    lasting = finding.kind in ("growing_oscillation", "sustained_oscillation")
    return lasting and found is not None and abs(found - frequency_hz) > _SAME * frequency_hz
