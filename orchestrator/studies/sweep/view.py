"""A sweep as Python has it: the modes over a grid of parameters, as tables, files and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.late import pd, xr
from orchestrator.core.safe_files import made_folder
from orchestrator.core.spelling import spelled
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.explorer_cells import CELLS, Cell, CellLine, Cells
from orchestrator.output.report.notebook import Axes, axes_or_new, headline, page
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.sweep.dataset import Samples, save_sweep, sweep_dataset, sweep_json
from orchestrator.studies.sweep.sweep import SweepResult


class ParameterSweep(NoTruth):
    """The modes of scenarios over a grid of parameters. `Case.sweep` makes it.

    Attributes
    ----------
    result
        All points, and the modes followed over them.
    samples
        The modes' figures at every point, for tables and plots.
    limits
        How far the parameter may go in each scenario, where ``until`` asks for it.
    """

    def __init__(self, result: SweepResult) -> None:
        self.result = result
        self.samples = Samples(result)
        self.limits = tuple(result.limits)

    @property
    def stable(self) -> bool | None:
        """True if nothing grows at any point of any scenario; None where a point has no verdict and none grows."""
        verdicts = [scenario.stable for scenario in self.result.scenarios]
        if False in verdicts:
            return False
        return None if None in verdicts else True

    @property
    def remarks(self) -> list[str]:
        """Return what failed, was refined or was not recognised, one sentence each."""
        from orchestrator.studies.sweep import tables  # noqa: PLC0415 - imports Matplotlib, a second

        return list(map(spelled, tables.remarks(self.samples)))

    @property
    def dataset(self) -> xr.Dataset:
        """Everything over scenario, varied parameters and trajectory, as in ``sweep.nc``."""
        return sweep_dataset(self.samples)

    def __getitem__(self, name: str) -> xr.Dataset:
        """One mode as it was followed, over scenario and varied parameters; NaN where it is not.

        ``name``: of the followed mode, as `table` has it under ``mode``; ``sweep["electromechanical"].damping``."""
        data = self.dataset
        names = data["trajectory_name"].values
        known = sorted({str(one) for one in names.ravel() if one})
        if name not in known:
            raise InputError(
                f"no mode was followed as {name!r}; the followed modes: {', '.join(known) or 'none'}"
            )
        found = [
            data.isel(scenario=[s], trajectory=int(t)).drop_vars(["trajectory", "trajectory_name"])
            for s, t in zip(*(names == name).nonzero(), strict=True)
        ]
        return xr.concat(found, "scenario")

    def table(self) -> pd.DataFrame:
        """One row for every mode at every point: eigenvalue [1/s, rad/s], frequency, damping ratio, the mode's name.

        ``named`` says whether the case's name falls on the mode there."""
        rows = [
            {
                "scenario": sweep.prepared.name,
                **self.samples.setting(place),
                "mode": trajectory.name,
            }
            | eigenvalue_json(complex(sample["real"], sample["imag"]), sample["damping"])
            | {"named": bool(sample["named"])}
            for sweep in self.result.scenarios
            for trajectory in sweep.trajectories
            for place, sample in self.samples.of(sweep, trajectory)
        ]
        axes = [axis.key for axis in self.samples.axes]
        figures = ["real", "imag", "frequency_hz", "damping_percent", "named"]
        return pd.DataFrame(rows, columns=["scenario", *axes, "mode", *figures])

    def failures(self) -> pd.DataFrame:
        """The points that have no modes, and why."""
        rows = [
            {"scenario": sweep.prepared.name, **self.samples.setting(place), "error": error}
            for sweep, place, error in self.result.failures()
        ]
        return pd.DataFrame(
            rows, columns=["scenario", *(axis.key for axis in self.samples.axes), "error"]
        )

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor sweep --json`` prints, as JSON's types."""
        return sweep_json(self.samples)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``sweep.nc``, ``sweep.csv``, ``cells.json`` and the plots, as ``gfor sweep`` does; give their paths."""
        from orchestrator.studies.sweep.plots import save_sweep_plots  # noqa: PLC0415 - a second to import

        place = made_folder(folder)
        with staged(place, new_run_id()) as staging:
            tables = save_sweep(self.samples, staging)
            plots = save_sweep_plots(self.samples, staging)
            self._cells().save(staging, place)
        return [place / name for name in (*tables, CELLS, *(path.name for path in plots))]

    def _cells(self) -> Cells:
        """Followed modes by the values of the last axis; where there are several axes, each setting of the others."""
        plan, samples = self.result.plan, self.samples
        *others, last = range(len(plan.axes))
        named = any(t.case_name for s in self.result.scenarios for t in s.trajectories)
        rows: dict[tuple[str, str, tuple[float, ...]], dict[int, Cell]] = {}
        for sweep in self.result.scenarios:
            for trajectory in sweep.trajectories:
                if named and trajectory.case_name is None:
                    continue
                for place, one in samples.of(sweep, trajectory):
                    stable = sweep.points[place].stability.get("stable")
                    word = {
                        True: "",
                        False: "; another mode grows" if one["real"] < 0 else "",
                        None: "; not known",
                    }
                    text = f"{one['frequency']:.3f} Hz, {one['damping']:.2f} %{word[stable]}"
                    cell = Cell(text, one["damping"], stable, one["real"], one["frequency"])
                    key = sweep.prepared.name, trajectory.name, tuple(place[k] for k in others)
                    rows.setdefault(key, {})[int(place[last])] = cell
        titles = {sweep.prepared.name: sweep.prepared.title for sweep in self.result.scenarios}

        def side(scenario: str, mode: str, setting: tuple[float, ...]) -> CellLine:
            chosen = [
                (plan.axes[k], plan.axes[k].values[int(x)])
                for k, x in zip(others, setting, strict=True)
            ]
            words = [f"{axis.key} = {value:g} {axis.unit}".rstrip() for axis, value in chosen]
            values = {key: value for axis, one in chosen for key, value in axis.sets(one).items()}
            who = [titles[scenario]] if len(titles) > 1 else []
            return CellLine(", ".join([*words, *who, mode]), values, scenario)

        axis = plan.axes[last]
        columns = [CellLine(f"{value:g}", axis.sets(value)) for value in axis.values]
        cells = [[row.get(k) for k in range(len(axis.values))] for row in rows.values()]
        return Cells(
            f"Damping of followed modes over {axis.key} [{axis.unit or 1}]",
            plan.case,
            scenario=plan.scenarios[0].name,
            frequencies=plan.frequency_range,
            rows=[side(*key) for key in rows],
            columns=columns,
            cells=cells,
            values=plan.overrides,
            step=plan.step_size,
            followed=True,
        )

    def plot(self, ax: Axes = None) -> Axes:
        """The modes in the complex plane, on Matplotlib Axes or a new figure's; a circle where each begins."""
        from orchestrator.studies.sweep.plots import draw_trajectories  # noqa: PLC0415 - a second to import

        axes = axes_or_new(ax, 8.0, 6.2)
        if not draw_trajectories(axes, self.samples):
            raise InputError(
                "no point of the sweep has a mode that could be drawn; see its failures()"
            )
        axes.legend(loc="best", fontsize="small")
        return axes

    def __repr__(self) -> str:
        names = ", ".join(axis.key for axis in self.samples.axes)
        return f"<ParameterSweep of {self.result.plan.case.name} over {names}: {self._points()}>"

    def _points(self) -> str:
        failed = sum(1 for _ in self.result.failures())
        return f"{self.result.plan.number_of_points} points, {failed} of them without modes"

    def _repr_html_(self) -> str:
        words = {
            True: "stable at all points",
            False: "UNSTABLE at some points",
            None: "stability not known",
        }
        lines = [
            *(f"{s.prepared.title}: {words[s.stable]}" for s in self.result.scenarios),
            self._points(),
        ]
        title, top = repr(self).strip("<>").partition(":")[0], words[self.stable]
        return page(title, lines, self.table(), verdict=headline(top, self.stable))
