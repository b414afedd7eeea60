"""Sweeps: modes over a grid of parameters."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import xarray as xr

from orchestrator.api.progress import shown_progress
from orchestrator.api.show import Axes, new_axes, page
from orchestrator.api.values import plain_value
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.schema import Value
from orchestrator.errors import InputError
from orchestrator.points.processes import Processes
from orchestrator.points.serial import Serial
from orchestrator.points.store import PointStore
from orchestrator.results.mode_json import eigenvalue_json
from orchestrator.sweep.axes import Vary, parse_vary
from orchestrator.sweep.dataset import Samples, sweep_dataset, sweep_json
from orchestrator.sweep.sweep import SweepResult, plan_sweep, run_sweep


class ParameterSweep:
    """The modes of scenarios over a grid of parameters. `Case.sweep` makes it.

    Attributes
    ----------
    result
        All points, and the modes followed over them.
    """

    def __init__(self, result: SweepResult) -> None:
        self.result = result
        self._samples = Samples(result)

    @property
    def dataset(self) -> xr.Dataset:
        """Everything over scenario, varied parameters and trajectory, as in ``sweep.nc``."""
        return sweep_dataset(self._samples)

    def table(self) -> pd.DataFrame:
        """One row for every mode at every point: eigenvalue [1/s, rad/s], frequency, damping ratio, the mode's name.

        ``named`` says whether the case's name falls on the mode there.
        """
        rows = [
            {"scenario": sweep.prepared.name, **self._samples.setting(place), "mode": trajectory.name}
            | eigenvalue_json(complex(sample["real"], sample["imag"]), sample["damping"])
            | {"named": bool(sample["named"])}
            for sweep in self.result.scenarios
            for trajectory in sweep.trajectories
            for place, sample in self._samples.of(sweep, trajectory)
        ]
        axes = [axis.key for axis in self._samples.axes]
        figures = ["real", "imag", "frequency_hz", "damping_percent", "named"]
        return pd.DataFrame(rows, columns=["scenario", *axes, "mode", *figures])

    def failures(self) -> pd.DataFrame:
        """The points that have no modes, and why."""
        rows = [
            {"scenario": sweep.prepared.name, **self._samples.setting(place), "error": error}
            for sweep, place, error in self.result.failures()
        ]
        return pd.DataFrame(rows, columns=["scenario", *(axis.key for axis in self._samples.axes), "error"])

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor sweep --json`` prints, as JSON's types."""
        return sweep_json(self._samples)

    def plot(self, ax: Axes = None) -> Axes:
        """The modes in the complex plane; a circle where each begins.

        Parameters
        ----------
        ax
            Matplotlib Axes; by default those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from orchestrator.sweep.plots import draw_trajectories  # noqa: PLC0415 - a second to import

        axes = new_axes(8.0, 6.2) if ax is None else ax
        if not draw_trajectories(axes, self._samples):
            raise InputError("no point of the sweep has a mode that could be drawn; see its failures()")
        axes.legend(loc="best", fontsize="small")
        return axes

    def __repr__(self) -> str:
        names = ", ".join(axis.key for axis in self._samples.axes)
        return f"<ParameterSweep of {self.result.plan.case.name} over {names}: {self._points()}>"

    def _points(self) -> str:
        failed = sum(1 for _ in self.result.failures())
        return f"{self.result.plan.number_of_points} points, {failed} of them without modes"

    def _repr_html_(self) -> str:
        words = {True: "stable at all points", False: "UNSTABLE at some points", None: "stability not known"}
        lines = [self._points(), *(f"{s.prepared.title}: {words[s.stable]}" for s in self.result.scenarios)]
        return page(repr(self).strip("<>").partition(":")[0], lines, self.table())


def sweep_parameters(
    file: CaseFile,
    vary: Mapping[str, Iterable[Any]] | Iterable[str],
    scenarios: Sequence[str],
    values: Mapping[str, Value],
    step_size: float | None,
    frequencies: tuple[float, float],
    workers: int,
    folder: str | Path | None,
    *,
    progress: bool,
) -> ParameterSweep:
    """Plan and compute a sweep, as `Case.sweep` offers it.

    Parameters
    ----------
    file
        The case.
    vary
        Values by ``component.parameter``, or texts as with ``--vary``.
    scenarios
        Names; all of them where empty.
    values
        Values by ``component.variable`` that hold at every point.
    step_size
        Communication step [s]; the case's where None.
    frequencies
        Modes from the first to the second are followed [Hz].
    workers
        Processes to compute in, at least 1.
    folder
        Keeps the points; they are forgotten where None.
    progress
        Show a bar.
    """
    if workers < 1:
        raise InputError(f"workers = {workers}; it must be a whole number of at least 1")
    plan = plan_sweep(file, _varied(vary), scenarios, values, step_size, frequencies)
    executor = Processes(workers, ["orchestrator.sweep.worker"]) if workers > 1 else Serial()
    with TemporaryDirectory() as passing, closing(executor), shown_progress("Points", shown=progress) as report:
        store = PointStore(Path(folder or passing) / "points")
        return ParameterSweep(run_sweep(plan, executor, store, report))


def _varied(vary: Mapping[str, Iterable[Any]] | Iterable[str]) -> list[Vary]:
    """What is varied, from values by name or from texts."""
    if isinstance(vary, Mapping):
        lists = {key: tuple(map(plain_value, values)) for key, values in vary.items()}
        empty = [key for key, values in lists.items() if not values]
        if empty:
            raise InputError(f"{', '.join(empty)}: a sweep needs values, such as {{'grid.X_L': [0.1, 0.3]}}")
        return [Vary(key, None, len(values), False, values) for key, values in lists.items()]
    try:
        return [parse_vary(text) for text in ([vary] if isinstance(vary, str) else vary)]
    except ValueError as error:
        raise InputError(str(error)) from error
