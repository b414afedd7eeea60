"""The modes in a recorded signal, and two recorded runs side by side, as Python has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from orchestrator.core.errors import few
from orchestrator.core.late import pd
from orchestrator.linear.signals.identification import IdentifiedMode, Sampling
from orchestrator.linear.signals.mode_doubts import (
    is_trend,
    nothing_swings,
    over_a_trend,
    short_window,
    told_apart,
)
from orchestrator.output.report.notebook import page
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.studies.signals.comparison import Comparison

RARE = 1.0  # samples [s] that are further apart show no swing of machines
_NAMED = 10  # signals with a doubtful oscillation that a sentence names; the others are counted


@dataclass(eq=False, repr=False)
class SignalModes:
    """A recorded signal as a sum of modes, the strongest first. `identify` makes it.

    Attributes
    ----------
    signal
        The signal, as it was asked for.
    start, stop
        Beginning and end of the part of the record that was used [s].
    modes
        Eigenvalue [rad/s], damping and amplitude [unit of the signal] of each mode.
    used
        Which samples of the record were used.
    line
        By how much the straight line through the samples changes from start to stop [unit of the signal].
    about
        Questions on the recording itself, such as a unit that its values contradict.
    """

    signal: str
    start: float
    stop: float
    modes: Sequence[IdentifiedMode]
    used: Sampling
    line: float = 0.0
    about: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[IdentifiedMode]:
        return iter(self.modes)

    def __len__(self) -> int:
        return len(self.modes)

    @property
    def interval(self) -> float:
        """Time between the samples used [s]."""
        return self.used.interval

    def is_trend(self, mode: IdentifiedMode) -> bool:
        """Return whether a component is an offset or a slow trend, whose damping says nothing about growth.

        Parameters
        ----------
        mode
            One of `modes`. In the window, a trend changes by less than a factor e and turns by less than one radian.
        """
        return is_trend(mode, self.stop - self.start)

    @property
    def remarks(self) -> list[str]:
        """Sentences on the highest frequency that the samples can show, on the modes near it, on a window that is too
        short (for two close modes as well), on a trend that may hide modes, on a window without oscillations, and on
        each mode in doubt."""
        highest = 0.5 / self.interval
        texts = [
            f"The samples used, every {self.interval:g} s, show nothing above {highest:.4g} Hz: "
            f"a faster oscillation appears as a slower one.{' Is the time in ms?' * (self.interval > RARE)}"
        ]
        near = [f"{m.frequency_hz:.4g} Hz" for m in self.modes if m.frequency_hz > highest / 2]
        if near:
            texts.append(
                f"Above a quarter of the sampling frequency of {1 / self.interval:.4g} Hz, and perhaps no frequency "
                f"of the system: {', '.join(near)}. To be sure, {self.used.remedy}."
            )
        length = self.stop - self.start
        about = [
            nothing_swings(self.modes, length),
            short_window(self.modes, self.start, self.stop),
            told_apart(self.modes, length) if len(self.modes) > 1 else "",
            over_a_trend(self.modes, length, self.line),
        ]
        doubtful = [m for m in self.modes if m.doubts and not self.is_trend(m)]
        asked = [f"{text}." for text in self.about]
        return [*asked, *texts, *filter(None, about), *(f"? {doubt_text(m)}." for m in doubtful)]

    def table(self) -> pd.DataFrame:
        """One row for every mode: eigenvalue [1/s, rad/s], frequency, damping ratio, amplitude [unit of the signal]."""
        figures = ["real", "imag", "frequency_hz", "damping_percent", "amplitude"]
        return pd.DataFrame(self.as_json(), columns=figures)

    def as_json(self) -> list[dict[str, Any]]:
        """The same as ``gfor signal identify --json`` prints, as JSON's types."""
        return [identified_mode_json(mode) for mode in self.modes]

    def __repr__(self) -> str:
        return f"<SignalModes of {self.signal} from {self.start:g} to {self.stop:g} s: {len(self)} modes>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), self.remarks, self.table())


def identified_mode_json(mode: IdentifiedMode) -> dict[str, Any]:
    figures = eigenvalue_json(mode.eigenvalue, mode.damping_percent)
    return figures | {"amplitude": mode.amplitude, "doubts": list(mode.doubts)}


def doubt_text(mode: IdentifiedMode) -> str:
    return f"{mode.frequency_hz:.4g} Hz is doubtful: {'; '.join(mode.doubts)}"


def doubts_by_run(labels: tuple[str, str], signals: Sequence[Comparison]) -> list[str]:
    """Return a sentence for each run of which an oscillation is doubtful: which signals', and why the first is."""
    told = []
    for label, place in zip(labels, (0, 1), strict=True):
        strongest = [(one.expression, one.modes[place]) for one in signals]
        doubtful = [(name, mode) for name, mode in strongest if mode is not None and mode.doubts]
        if doubtful:
            (name, mode), *others = doubtful
            more = (
                f" So are those of {few([other for other, _ in others], _NAMED)}; 'doubts' of each mode says why."
                if others
                else ""
            )
            told.append(f"? {label}: {name} at {doubt_text(mode)}.{more}")
    return told


class RunComparison:
    """How far two runs differ, signal by signal. `compare` makes it.

    Attributes
    ----------
    labels
        Of the two runs.
    signals
        One comparison a signal, those first that differ most.
    remarks
        Sentences on different record intervals, on runs too short for their oscillations to be read, and on those in
        doubt.
    """

    def __init__(
        self, labels: tuple[str, str], signals: Sequence[Comparison], remarks: Sequence[str] = ()
    ) -> None:
        self.labels, self.signals, self.remarks = labels, list(signals), list(remarks)

    def __iter__(self) -> Iterator[Comparison]:
        return iter(self.signals)

    def table(self) -> pd.DataFrame:
        """Largest deviation of each run, largest difference and its time [s], and the strongest oscillation of each."""
        return pd.DataFrame(list(map(_row_of, self.signals))).set_index("signal")

    def as_json(self) -> list[dict[str, Any]]:
        """The same as ``gfor signal compare --json`` prints, as JSON's types."""
        return [
            asdict(c) | {"modes": [m and identified_mode_json(m) for m in c.modes]}
            for c in self.signals
        ]

    def __repr__(self) -> str:
        return (
            f"<RunComparison of {self.labels[0]} and {self.labels[1]}: {len(self.signals)} signals>"
        )

    def _repr_html_(self) -> str:
        return page(f"a: {self.labels[0]}; b: {self.labels[1]}", self.remarks, self.table())


def _row_of(comparison: Comparison) -> dict[str, Any]:
    """A signal's row in the table of two runs."""
    row: dict[str, Any] = {
        "signal": comparison.expression,
        "unit": comparison.unit,
        "deviation_a": comparison.deviations[0],
        "deviation_b": comparison.deviations[1],
        "largest_difference": comparison.largest,
        "at_s": comparison.at,
        "rms": comparison.rms,
    }
    for run, mode in zip("ab", comparison.modes, strict=True):
        row[f"frequency_hz_{run}"] = mode and mode.frequency_hz
        row[f"damping_percent_{run}"] = mode and mode.damping_percent
    return row
