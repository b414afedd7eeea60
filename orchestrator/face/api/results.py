"""Modes and runs of a scenario: as tables, as pictures, in a notebook."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from orchestrator.cases.form.given import Time
from orchestrator.core.arrays import Complex
from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.late import Late, pd, xr
from orchestrator.core.safe_files import made_folder
from orchestrator.core.spelling import joined, spelled
from orchestrator.core.truth import NoTruth
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.linear.spectra.modes import ZERO, Mode, eigenvalues
from orchestrator.output.report.notebook import Axes, axes_or_new, curves_on, headline, page
from orchestrator.output.results.staging import ScenarioFolder, new_run_id, staged

if TYPE_CHECKING:
    from orchestrator.linear.spectra.stability import Stability
    from orchestrator.simulation.watch.finding import Finding
    from orchestrator.studies.modes.modes import ModesResult
    from orchestrator.studies.oscillations import view as oscillations
    from orchestrator.studies.oscillations.view import Sources
    from orchestrator.studies.runs import answer_of_run
    from orchestrator.studies.runs.run import RunResult
    from orchestrator.studies.signals import comparison
else:  # what computes, which a recording is read without, and of a run what modes need not
    answer_of_run = Late("orchestrator.studies.runs.answer_of_run")
    comparison = Late("orchestrator.studies.signals.comparison")
    oscillations = Late("orchestrator.studies.oscillations.view")

_OF_EACH = (
    "eigenvalue",
    "frequency_hz",
    "damping_percent",
    "damping_ratio",
    "shape",
    "by_component",
)
"""What each mode has, and all of them together do not."""


class Modes(NoTruth, ask=".stability.stable, or len() for the number of modes in range"):
    """Steady state and modes of one scenario. `Scenario.modes` makes it.

    Attributes
    ----------
    result
        All that was computed.
    named
        The modes that the case gives a name; one that no mode bears is an error that says why.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> modes = gfor.load("two_area").scenario("gfor").modes()
    >>> modes.stability.stable
    True
    >>> mode = modes.named["electromechanical"]
    >>> print(f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.1f} %")
    0.582 Hz, 10.6 %
    """

    _elsewhere: ClassVar[Mapping[str, str]] = {
        "stable": ".stability.stable",
        "verdict": ".stability.verdict",
        **{name: f"modes[0].{name}, or a column of .table()" for name in _OF_EACH},
    }

    def __init__(self, result: ModesResult) -> None:
        if not hasattr(result, "prepared"):
            raise InputError(f"Modes({result!r}): modes come from load(…).scenario(…).modes()")
        self.result, self.named = result, NamedModes(result)

    @property
    def stability(self) -> Stability:
        """The verdict over the whole spectrum."""
        return self.result.stability

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what is to be borne in mind of the modes."""
        return self.result.warnings

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.result.modes)

    def __len__(self) -> int:
        return len(self.result.modes)

    def __getitem__(self, index: int | str) -> Mode:
        if isinstance(index, str):
            return self.named[index]
        if isinstance(index, bool) or not isinstance(index, int | np.integer | slice):
            raise InputError(
                f"modes[{index!r}]: give a place in the range, such as 0, or a mode's name"
            )
        try:
            return self.result.modes[index]
        except IndexError:
            raise NoSuchIndexError(
                f"there is no modes[{index!r}]: {len(self)} modes are in the range, the first is modes[0]"
            ) from None

    def table(self) -> pd.DataFrame:
        """All modes in the range, least damped first: eigenvalue [1/s, rad/s], frequency, damping, name, states. Row 1
        is ``modes[0]``, whose ``shape`` holds its right eigenvector by state."""
        from orchestrator.studies.modes.tables import modes_table  # noqa: PLC0415 - imports the reading of cases

        index = pd.RangeIndex(1, len(self) + 1, name="mode")
        return modes_table([self.result]).frame().set_index(index)

    def participation(self) -> pd.DataFrame:
        """Participation of every state (row) in every mode (column, as in `table`)."""
        columns = {
            number: dict(mode.participation)
            for number, mode in enumerate(self.result.modes, start=1)
        }
        table = pd.DataFrame(columns, index=list(self.result.model.names))
        return table.rename_axis(index="state", columns="mode")

    @property
    def dataset(self) -> xr.Dataset:
        """The modes in the range over mode (as in `table`) and state; ``shape`` is the right eigenvector, complex."""
        table, share, of_both = self.table(), self.participation(), ["mode", "state"]
        shape = [[mode.shape.get(state, 0j) for state in share.index] for mode in self]

        def figure(name: str, unit: str) -> tuple[str, list[Any], dict[str, str]]:
            return "mode", [getattr(mode, name) for mode in self], {"units": unit}

        return xr.Dataset(
            {
                "eigenvalue": figure("eigenvalue", "rad/s"),
                "frequency": figure("frequency_hz", "Hz"),
                "damping": figure("damping_percent", "%"),
                "participation": (of_both, share.to_numpy().T),
                "shape": (of_both, np.reshape(shape, share.T.shape)),
            },
            {"mode": table.index, "name": ("mode", table["name"].to_numpy()), "state": share.index},
        )

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor modes --json`` prints of this scenario, as JSON's types."""
        from orchestrator.studies.modes.modes import modes_json  # noqa: PLC0415 - imports the reading of cases

        return dict(modes_json([self.result]))

    def power_flow(self) -> dict[str, pd.DataFrame]:
        """``buses`` [pu, °], ``branches`` and ``machines`` [MW, Mvar, %]; nothing for a case without a power flow."""
        from orchestrator.cases.scenario.flow_figures import power_flow_json  # noqa: PLC0415 - imports the reading of cases

        flow = power_flow_json(self.result.prepared) or {}
        kinds = [kind for kind, rows in flow.items() if isinstance(rows, list)]
        return {kind: pd.DataFrame(flow[kind]).set_index("name") for kind in kinds}

    @property
    def eigenvalues(self) -> Complex:
        """All eigenvalues [rad/s], complex, the largest real part first; zeros, such as the free angle's, are left out.

        They are ln(μ)/h of the step map, from which the modes and the verdict come."""
        found = eigenvalues(self.result.model)
        found = found[np.abs(found) > ZERO]
        return np.asarray(found[np.argsort(-found.real, kind="stable")])

    def save(self, folder: str | Path) -> Path:
        """Write what ``gfor modes --out`` leaves into a folder."""
        from orchestrator.studies.modes import beside  # noqa: PLC0415 - as below
        from orchestrator.studies.runs.files import write_modes  # noqa: PLC0415 - plots: a second to import

        place = made_folder(folder, "folder")
        write_modes([self.result], place, (), [*beside.sentences_beside([self.result])])
        return place

    def plot(self, ax: Axes = None, *, radians: bool = False, annotate: bool = False) -> Axes:
        """Eigenvalue map with rays of equal damping; large crosses are modes with a name.

        A mode lies at its real part [1/s] and its frequency [Hz].

        Parameters
        ----------
        ax
            Matplotlib Axes, such as those with another scenario's modes; by default those of a new figure.
        radians
            The imaginary part [rad/s] in the place of the frequency: both axes have one unit.
        annotate
            Write frequency and damping beside each mode, with its name where it has one.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> case = gfor.load("two_area")
        >>> axes = case.scenario("gfor").modes().plot()
        >>> axes = case.scenario("pod_p").modes().plot(axes)
        >>> axes.get_xlabel()
        'Real part [1/s]'
        """
        from orchestrator.studies.runs.mode_plots import draw_eigenvalues  # noqa: PLC0415 - a second to import

        axes = axes_or_new(ax, 7.2, 5.0)
        draw_eigenvalues(axes, [self.result], curves_on(axes), radians=radians, annotate=annotate)
        axes.legend(loc="best", fontsize="small")
        return axes

    def plot_shape(self, mode: str | int = 0, ax: Axes = None) -> Axes:
        r"""A mode's shape: an arrow for each state that shows who swings against whom, the longest of length 1.

        Parameters
        ----------
        mode
            A name, as `named` has it, or the place in the range: 0 is row 1 of `table`.
        ax
            Polar Matplotlib Axes; by default those of a new figure.

        Raises
        ------
        InputError
            If there is no such mode, or no state of the case shows who swings.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> axes = gfor.load("two_area").scenario("gfor").modes().plot_shape("electromechanical")
        >>> axes.get_xlabel()
        '→ sg1\n← sg2'
        """
        from orchestrator.studies.runs.mode_plots import draw_shape  # noqa: PLC0415 - a second to import

        shown = self[mode]
        if not self.result.swing:
            raise InputError(
                "the case names no states that show who swings ([analysis] swing), and none stands out; "
                f"modes[{mode!r}].shape has all states"
            )
        axes = axes_or_new(ax, 4.0, 4.2, polar=True)
        draw_shape(axes, shown, self.result.swing, None)
        axes.set_title(f"{shown.frequency_hz:.3f} Hz, {shown.damping_percent:.2f} %")
        return axes

    def __repr__(self) -> str:
        prepared = self.result.prepared
        head = f"Modes of {prepared.case.name}, {prepared.name}"
        more = "".join(f"; warning: {text}" for text in self.warnings)
        return f"<{head}: {len(self)} in range; {self.stability.sentence()}{more}>"

    def _repr_html_(self) -> str:
        r = self.result
        outside = [] if r.hidden is None else [r.hidden.sentence()]
        lines = [
            self.stability.sentence(),
            *outside,
            *(f"warning: {text}" for text in self.warnings),
        ]
        least = min(self, key=lambda mode: mode.damping_percent, default=None)
        figures = f"{least.frequency_hz:.3f} Hz, {least.damping_percent:.2f} %" if least else ""
        verdict = f"{self.stability.verdict}{', least damped ' if least else ''}{figures}"
        title = f"Modes of {r.prepared.case.name}: {r.prepared.title}"
        top = headline(verdict, self.stability.stable)
        return page(title, lines, self.table(), verdict=top)


class NoSuchIndexError(InputError, IndexError):
    """Fewer modes are in the range."""


class NoSuchModeError(InputError, KeyError):
    """No mode of a scenario bears a name."""


class NamedModes(dict[str, Mode]):
    """The modes of a scenario by the names that its case gives."""

    def __init__(self, result: ModesResult) -> None:
        super().__init__(result.named)
        self._result = result

    def __missing__(self, name: str) -> Mode:
        r = self._result
        where = f"scenario {r.prepared.name!r} of {r.prepared.case.name}"
        if name in r.unnamed:
            raise NoSuchModeError(f"{where}: {r.unnamed[name]}")
        names = ", ".join(map(repr, self)) or "none"
        raise NoSuchModeError(
            f"{where} has no mode named {name!r} in the range; its named modes: {names}"
        )


class Run(NoTruth):
    """A scenario's modes and its response in time. `Scenario.run` makes it.

    Attributes
    ----------
    result
        All that was computed.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> run = gfor.load("infinite_bus").scenario("dip").run(stop=1.2)
    >>> run.dataset["grid.v"].attrs["units"]
    'pu'
    >>> run.modes.stability.stable
    True
    """

    def __init__(self, result: RunResult) -> None:
        if not hasattr(result, "modes"):
            raise InputError(
                f"Run({result!r}): a run comes from load(…).scenario(…).run(); recorded runs are opened by open(…)"
            )
        self.result = result

    @property
    def dataset(self) -> xr.Dataset:
        """Return what was recorded over the time [s], with units, long names and provenance.

        Its values cannot be written into, since modes and figures are made from them; ``dataset.copy(deep=True)`` can.
        """
        shown = self.result.dataset.copy(deep=False)
        for variable in shown.variables.values():
            if isinstance(variable.data, np.ndarray):
                variable.data.flags.writeable = False
        return shown

    @property
    def stable(self) -> bool | None:
        """True if the run and the modes before and after its events show no growth; None where that is not known."""
        return answer_of_run.of_run(self.result).good

    @property
    def verdict(self) -> str:
        """The verdict in one sentence, as ``gfor run`` has it."""
        answer = answer_of_run.of_run(self.result)
        told = joined("; ", filter(None, (answer.remark, answer.quiet_relays)))
        return spelled(joined(": ", filter(None, (answer.word, told))))

    @property
    def linear(self) -> xr.Dataset | None:
        """The linear model's response to the same events, where it was asked for."""
        return self.result.linear

    @property
    def modes(self) -> Modes:
        """The modes before the events."""
        return Modes(self.result.modes)

    @property
    def ring_down(self) -> IdentifiedMode | None:
        """The case's first mode as the response shows it."""
        return self.result.ring_down

    @property
    def findings(self) -> list[Finding]:
        """Return what the run did wrong, in the order of its beginning."""
        return list(self.result.findings)

    @property
    def failure(self) -> CosimError | None:
        """The error that ended the run before its time."""
        return self.result.failure

    def signal(self, expression: str) -> xr.DataArray:
        """A recorded variable ``"a.b"``, or the difference ``"a.b - c.d"`` of two.

        Raises
        ------
        InputError
            If it was not recorded.
        """
        return comparison.recorded(self.dataset, expression, self.result.modes.prepared.name)

    def table(self) -> pd.DataFrame:
        """All recorded signals over the time [s]."""
        return self.dataset.to_dataframe()

    def source(self, start: Time | None = None, stop: Time | None = None) -> Sources:
        """Where the run's oscillations come from; see `orchestrator.source`.

        Parameters
        ----------
        start, stop
            The part of the run that is used [s]; by default all of it.
        """
        label = str(self.dataset.attrs.get("scenario", "run"))
        return oscillations.sources_of(self.dataset, label, start, stop, self.result.modes.prepared)

    def summary(self) -> dict[str, Any]:
        """The same as ``gfor run --json`` prints of this scenario, as JSON's types."""
        from orchestrator.studies.runs.files import summary_of  # noqa: PLC0415 - plots: a second to import

        return summary_of(self.result)

    def save(self, folder: str | Path) -> Path:
        """Write what ``gfor run`` leaves of this scenario in its folder, for `compare`, ``gfor report`` and others.

        Other scenarios' results that are in the folder stay, but for the tables of all together."""
        from orchestrator.output.results.file_writers import save_netcdf  # noqa: PLC0415 - as below
        from orchestrator.output.results.recording_writer import TRAJECTORY  # noqa: PLC0415 - as below
        from orchestrator.studies.modes import beside  # noqa: PLC0415 - as below
        from orchestrator.studies.runs.files import save_run, save_study  # noqa: PLC0415 - plots: a second to import

        place, run_id, name = (
            made_folder(folder, "folder"),
            new_run_id(),
            self.result.modes.prepared.name,
        )
        scenario = ScenarioFolder(place, name, run_id)
        save_netcdf(self.result.dataset, scenario.path / TRAJECTORY)
        save_run(self.result, scenario, csv=False)
        with staged(place, run_id, [name]) as staging:
            save_study([self.result], staging, [*beside.sentences_beside([self.result.modes])])
        return place

    def plot(self, signal: str | None = None, ax: Axes = None) -> Axes:
        """A signal over the time; dashed, the linear model's response where it was asked for.

        Parameters
        ----------
        signal
            ``"a.b"`` or ``"a.b - c.d"``; by default the first that the case plots.
        ax
            Matplotlib Axes, such as those with another run's signal; by default those of a new figure.

        Raises
        ------
        InputError
            If the signal was not recorded.
        """
        from orchestrator.studies.runs.mode_plots import draw_signal  # noqa: PLC0415 - a second to import

        expression = self._first_plotted() if signal is None else signal
        unit = (
            self.signal(expression).attrs.get("units")
            or self.dataset[expression.split(" - ")[0].strip()].units
        )
        axes = axes_or_new(ax, 7.2, 3.2)
        draw_signal(axes, [self.result], expression, first=curves_on(axes))
        axes.set_xlabel("Time [s]")
        axes.set_ylabel(f"{expression} [{unit}]")
        axes.legend(loc="best", fontsize="small")
        return axes

    def _first_plotted(self) -> str:
        for plot in self.result.modes.prepared.case.table.plots:
            for panel in plot.panels:
                return str(panel.signal)
        raise InputError(
            f"the case plots no signal; name one of: {', '.join(map(str, self.dataset.data_vars))}"
        )

    def __repr__(self) -> str:
        prepared, times = self.result.modes.prepared, self.dataset["time"].values
        end = float(times[-1]) if len(times) else 0.0
        failed = f"; ended early: {self.failure}" if self.failure else ""
        what = (
            f"Run of {prepared.case.name}, {prepared.name}: {end:g} s, {len(self.dataset)} signals"
        )
        return f"<{what}; {self.verdict}{failed}>"

    def _repr_html_(self) -> str:
        lines = [f"modes before the events: {self.modes.stability.sentence()}"]
        lines += [f"ended early: {self.failure}"] if self.failure else []
        lines += [f"found: {finding.message}" for finding in self.findings]
        prepared = self.result.modes.prepared
        return page(
            f"Run of {prepared.case.name}: {prepared.title}",
            lines,
            self._ranges(),
            verdict=headline(self.verdict, self.stable),
        )

    def _ranges(self) -> pd.DataFrame:
        """One row for each signal: unit, first and last value, the least and the largest."""
        rows = {}
        for name, signal in self.dataset.data_vars.items():
            values = signal.values
            shown = (
                (values[0], values[-1], values.min(), values.max()) if len(values) else [np.nan] * 4
            )
            rows[name] = [signal.attrs.get("units", ""), *shown]
        return pd.DataFrame.from_dict(
            rows, orient="index", columns=["unit", "first", "last", "least", "largest"]
        )
