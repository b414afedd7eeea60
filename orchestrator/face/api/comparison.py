"""Two runs side by side."""

import json
import warnings

import xarray as xr

from orchestrator.cases.form.given import Time, moment
from orchestrator.core.asked import Names, names
from orchestrator.core.errors import InputError, few
from orchestrator.core.threads import side_by_side
from orchestrator.face.api.given_recording import Recorded, open_given
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.output.results.recording_reader import in_memory
from orchestrator.studies.signals.common_times import common_times
from orchestrator.studies.signals.comparison import compare as compare_signal
from orchestrator.studies.signals.comparison import most_different
from orchestrator.studies.signals.signal_modes import RunComparison, doubts_by_run

RINGS_FROM = 2.0
"""Oscillations are looked for from this time on [s], if nothing else is asked for."""


def compare(
    a: Recorded,
    b: Recorded,
    signals: Names = (),
    start: Time | None = None,
) -> RunComparison:
    """Compare two runs: how far signals differ, and what each rings with.

    Parameters
    ----------
    a, b
        Runs, their datasets, folders of a scenario's results, recordings' files, or DataFrames and DataArrays over the
        time [s].
    signals
        ``"a.b"`` or ``"a.b - c.d"``; by default those that differ most.
    start
        Oscillations are looked for from this time on [s]; from 2 s where None.

    Raises
    ------
    InputError
        If a run does not have a signal, they have no time in common, or one ends before ``start``.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> dip, load_step = (scenario.run(stop=1.2) for scenario in gfor.load("infinite_bus").choose())
    >>> difference = gfor.compare(dip, load_step, ["grid.v"]).table()["largest_difference"]
    >>> print(f"{difference['grid.v']:.3f} pu")
    0.096 pu
    """
    (first, label_a), (second, label_b) = open_given(a, "a"), open_given(b, "b")
    labels = (label_a, label_b) if label_a != label_b else (f"a ({label_a})", f"b ({label_b})")
    _warn_of_different_ends(first, second, labels)
    _warn_of_other_files(first, second, labels)
    begin = RINGS_FROM if start is None else moment(start, "start")
    ends = [
        (label, float(run["time"][-1])) for run, label in zip((first, second), labels, strict=True)
    ]
    short = [(label, end) for label, end in ends if end <= begin]
    if short and start is not None:
        raise InputError(
            f"start = {start!r}: {short[0][0]} ends at t = {short[0][1]:g} s; give an earlier start"
        )
    remarks = [
        f"{label} ends at t = {end:g} s: its oscillations, which are read from t = {begin:g} s on, are not shown; give "
        "an earlier start."
        for label, end in short
    ]
    chosen = names(signals, "signals") or most_different(first, second, labels=labels)
    if not chosen:
        raise InputError(f"{labels[0]} and {labels[1]} have no signal in common")
    times = common_times(first["time"].values, second["time"].values, labels)
    with side_by_side() as pool:
        # a file is read by one thread at a time
        each = pool.map if in_memory(first) and in_memory(second) else map
        signals_compared = list(
            each(lambda one: compare_signal(first, second, one, begin, labels), chosen)
        )
    remarks += doubts_by_run(labels, signals_compared)
    return RunComparison(
        labels, signals_compared, [*([times.remark] if times.remark else []), *remarks]
    )


def _warn_of_other_files(first: xr.Dataset, second: xr.Dataset, labels: tuple[str, str]) -> None:
    cases = [run.attrs.get("case_file") for run in (first, second)]
    if cases[0] != cases[1] and None not in cases:
        told = [
            f"{label} of {run.attrs['case']}"
            for label, run in zip(labels, (first, second), strict=True)
        ]
        text = (
            f"the runs are of two case files ({', '.join(told)}): what differs may be the networks"
        )
        warnings.warn(text, ResultsWarning, stacklevel=3)
    one, two = (json.loads(run.attrs.get("inputs", "{}")) for run in (first, second))
    other = [
        name for name in one if one[name] != two.get(name, one[name]) and not name.endswith(".fmu")
    ]
    if other:
        text = f"{labels[0]} and {labels[1]} are of files that differ: {few(other, 3)}"
        warnings.warn(text, ResultsWarning, stacklevel=3)


def _warn_of_different_ends(first: xr.Dataset, second: xr.Dataset, labels: tuple[str, str]) -> None:
    """Warn where one run ends before the other: the rest of the longer one is not compared."""
    times = [run["time"].values for run in (first, second)]
    if min(map(len, times)) < 2:
        return
    (end_a, end_b), interval = (
        (float(t[-1]) for t in times),
        max(float(t[-1] - t[-2]) for t in times),
    )
    if abs(end_a - end_b) > interval * (1 + 1e-6):
        text = (
            f"{labels[0]} ends at t = {end_a:.6g} s, and {labels[1]} at t = {end_b:.6g} s: differences are those until "
            f"t = {min(end_a, end_b):.6g} s, and each oscillation is read until its own run's end"
        )
        warnings.warn(text, ResultsWarning, stacklevel=3)
