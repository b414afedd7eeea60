"""Two runs side by side."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
import xarray as xr

from orchestrator.api.results import Run
from orchestrator.api.show import page
from orchestrator.errors import InputError
from orchestrator.study.comparison import Comparison, most_different, open_trajectory
from orchestrator.study.comparison import compare as compare_signal


class RunComparison:
    """How far two runs differ, signal by signal. `compare` makes it.

    Attributes
    ----------
    labels
        Of the two runs.
    signals
        One comparison a signal, those first that differ most.
    """

    def __init__(self, labels: tuple[str, str], signals: Sequence[Comparison]) -> None:
        self.labels, self.signals = labels, list(signals)

    def __iter__(self) -> Iterator[Comparison]:
        return iter(self.signals)

    def table(self) -> pd.DataFrame:
        """Largest deviation of each run, largest difference and its time [s], and the strongest oscillation of each."""
        rows = [
            {
                "signal": c.expression,
                "unit": c.unit,
                "deviation_a": c.deviations[0],
                "deviation_b": c.deviations[1],
                "largest_difference": c.largest,
                "at_s": c.at,
                "rms": c.rms,
                "frequency_hz_a": c.modes[0].frequency_hz if c.modes[0] else None,
                "damping_percent_a": c.modes[0].damping_percent if c.modes[0] else None,
                "frequency_hz_b": c.modes[1].frequency_hz if c.modes[1] else None,
                "damping_percent_b": c.modes[1].damping_percent if c.modes[1] else None,
            }
            for c in self.signals
        ]
        return pd.DataFrame(rows).set_index("signal")

    def __repr__(self) -> str:
        return f"<RunComparison of {self.labels[0]} and {self.labels[1]}: {len(self.signals)} signals>"

    def _repr_html_(self) -> str:
        return page(f"a: {self.labels[0]}; b: {self.labels[1]}", table=self.table())


def compare(
    a: Run | xr.Dataset | str | Path,
    b: Run | xr.Dataset | str | Path,
    signals: Sequence[str] = (),
    start: float = 2.0,
) -> RunComparison:
    """Compare two runs: how far signals differ, and what each rings with.

    Parameters
    ----------
    a, b
        Runs, their datasets, or folders of a scenario's results.
    signals
        ``"a.b"`` or ``"a.b - c.d"``; by default those that differ most.
    start
        Oscillations are looked for from this time on [s].

    Raises
    ------
    InputError
        If a run does not have a signal, or they have no time in common.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> dip, load_step = (scenario.run(stop=1.2) for scenario in gfor.load("infinite_bus").choose())
    >>> difference = gfor.compare(dip, load_step, ["grid.v"]).table()["largest_difference"]
    >>> print(f"{difference['grid.v']:.3f} pu")
    0.096 pu
    """
    (first, label_a), (second, label_b) = _opened(a, "a"), _opened(b, "b")
    chosen = signals or most_different(first, second)
    if not chosen:
        raise InputError(f"{label_a} and {label_b} have no signal in common")
    labels = (label_a, label_b)
    return RunComparison(labels, [compare_signal(first, second, one, start, labels) for one in chosen])


def _opened(run: Run | xr.Dataset | str | Path, letter: str) -> tuple[xr.Dataset, str]:
    """A run's dataset, and its name."""
    if isinstance(run, str | Path):
        return open_trajectory(Path(run)), str(run)
    dataset = run.dataset if isinstance(run, Run) else run
    return dataset, str(dataset.attrs.get("scenario", letter))
