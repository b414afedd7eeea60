"""Ambient modes of a record, window by window: in Python, as JSON, as rows, as a picture and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Literal

from orchestrator.core.late import pd
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.linear.signals.ambient import AmbientMode
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.elements import damping, document, table
from orchestrator.output.report.notebook import page
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.output.results.staging import new_run_id, staged

Alarm = Literal["below", "perhaps below", "forced", ""]


@dataclass(frozen=True)
class AmbientWindow:
    """A part of a record [s], its modes, and why there are none where they could not be estimated."""

    start: float
    stop: float
    modes: Sequence[AmbientMode]
    failure: str = ""


class AmbientModes:
    """Modes of a record that noise shakes. `ambient` makes it.

    Attributes
    ----------
    label, signals
        Of what.
    windows
        Modes of each part, the one that makes most of the variance first.
    level
        Damping below which it is an alarm [%].
    """

    def __init__(
        self, label: str, signals: Sequence[str], windows: Sequence[AmbientWindow], level: float
    ) -> None:
        self.label, self.signals, self.windows, self.level = (
            label,
            list(signals),
            list(windows),
            level,
        )

    def __iter__(self) -> Iterator[AmbientWindow]:
        return iter(self.windows)

    def alarm(self, mode: AmbientMode) -> Alarm:
        """Tell if the damping is below the level, for sure where all of its interval is; of a forced oscillation, that.

        Parameters
        ----------
        mode
            One of a window's.
        """
        if mode.forced or mode.damping_percent >= self.level:
            return "forced" if mode.forced else ""
        return (
            "below"
            if mode.damping_percent + mode.damping_error_percent < self.level
            else "perhaps below"
        )

    @property
    def sentence(self) -> str:
        """How many windows have a mode below the level, and which was the first."""
        marked = [(w, m) for w in self.windows for m in w.modes if self.alarm(m) == "below"]
        number = len({w.start for w, _ in marked})
        said = f"{number} of {len(self.windows)} windows have a mode that is surely below {self.level:g} %"
        if marked:
            (w, m), *_ = marked
            said += f", first {m.frequency_hz:.3f} Hz with {m.damping_percent:.1f} % from {w.start:g} to {w.stop:g} s"
        return said

    def _mode_json(self, row: Mapping[Any, Any], mode: AmbientMode) -> dict[str, Any]:
        """One mode of a window, whose figures stand in its row of the table."""
        named = zip(self.signals, mode.shape, strict=True)
        shape = {name: [z.real, z.imag] for name, z in named}
        return {key: row[key] for key in _FIGURES} | {"alarm": row["alarm"], "shape": shape}

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor signal identify --ambient --json`` prints, as JSON's types."""
        rows = self.table().to_dict("records")
        windows = []
        for window in self.windows:
            of_window = [row for row in rows if row["start"] == window.start]
            modes = zip(of_window, window.modes, strict=True)
            windows.append(
                {
                    "start": window.start,
                    "stop": window.stop,
                    "failure": window.failure,
                    "modes": [self._mode_json(row, mode) for row, mode in modes],
                }
            )
        return {
            "record": self.label,
            "signals": self.signals,
            "level_percent": self.level,
            "sentence": self.sentence,
            "windows": windows,
        }

    def table(self) -> pd.DataFrame:
        """One row for every mode of every window [s, Hz, %], with half-widths of 95 % intervals."""
        rows = [
            (
                w.start,
                w.stop,
                m.frequency_hz,
                m.frequency_error_hz,
                m.damping_percent,
                m.damping_error_percent,
                m.share,
                self.alarm(m),
            )
            for w in self.windows
            for m in w.modes
        ]
        return pd.DataFrame(rows, columns=["start", "stop", *_FIGURES, "alarm"])

    def save_picture(self, path: str | Path) -> None:
        """Write frequency and damping over the time, with their intervals, as PNG or SVG."""
        from matplotlib import rc_context  # noqa: PLC0415 - a second to import
        from matplotlib.figure import Figure  # noqa: PLC0415 - the same

        from orchestrator.output.report.plot_style import STYLE, save_figure  # noqa: PLC0415 - the same

        rows = self.table()
        with rc_context(STYLE):
            figure = Figure(figsize=(8, 5), layout="constrained")
            for axes, name in zip(
                figure.subplots(2, 1, sharex=True), ("frequency", "damping"), strict=True
            ):
                unit = _FIGURES[0 if name == "frequency" else 2]
                error = rows[_FIGURES[1 if name == "frequency" else 3]]
                sure = [colour(2 if alarm == "below" else 1) for alarm in rows["alarm"]]
                axes.errorbar(
                    rows["stop"], rows[unit], yerr=error, fmt="none", ecolor="#bbb", elinewidth=1
                )
                axes.scatter(rows["stop"], rows[unit], s=8 + 60 * rows["share"], c=sure, zorder=3)
                axes.set_ylabel("Frequency [Hz]" if name == "frequency" else "Damping [%]")
            axes.axhline(self.level, color=colour(2), linestyle="--")
            axes.set_xlabel("End of the window [s]")
            save_figure(figure, Path(path))

    def html(self) -> str:
        """A page with the chart and the last window's modes."""
        from base64 import b64encode  # noqa: PLC0415 - only here
        from tempfile import TemporaryDirectory  # noqa: PLC0415 - only here

        with TemporaryDirectory() as folder:
            picture = Path(folder) / "ambient.png"
            self.save_picture(picture)
            data = b64encode(picture.read_bytes()).decode()
        rows = [
            [
                f"{r.stop:g}",
                f"{r.frequency_hz:.3f} ± {r.frequency_error_hz:.3f}",
                f"{damping(r.damping_percent, self.level)} ± {r.damping_error_percent:.1f}",
                f"{r.share:.0%}",
                r.alarm,
            ]
            for r in self.table().itertuples()
        ]
        columns = ["Window's end [s]", "f [Hz]", "Damping [%]", "Part of the variance", "Alarm"]
        chart = f'<img alt="modes over the time" style="max-width:100%" src="data:image/png;base64,{data}">'
        said = f"<p>{escape(self.sentence)}.</p>"
        return document(
            f"Modes of {self.label} in noise",
            escape(", ".join(self.signals)),
            said,
            [("Over the time", chart), ("Modes", table("Modes", columns, rows))],
        )

    def save(self, folder: str | Path) -> None:
        """Write ``ambient.json``, ``.csv``, ``.png`` and ``.html``."""
        with staged(made_folder(folder, "folder"), new_run_id()) as staging:
            save_json(self.as_json(), staging / "ambient.json")
            save_table(self.table().to_dict("records"), staging / "ambient.csv", [*self.table()])
            self.save_picture(staging / "ambient.png")
            write_text(staging / "ambient.html", self.html())

    def __repr__(self) -> str:
        return f"<AmbientModes of {self.label}: {len(self.windows)} windows>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), [self.sentence], self.table())


_FIGURES = (
    "frequency_hz",
    "frequency_error_hz",
    "damping_percent",
    "damping_error_percent",
    "share",
)
