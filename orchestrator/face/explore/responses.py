"""Time responses for the page: the linear model's at once, and the co-simulation's while it runs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestrator.cases.form.names import variables_of
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.late import import_xarray_alone
from orchestrator.face.api.results import Run
from orchestrator.face.api.scenario import Scenario
from orchestrator.output.report.html.charts import thinned
from orchestrator.output.results.signals import combined, signal
from orchestrator.output.results.staging import new_run_id
from orchestrator.output.results.trajectory import open_trajectory
from orchestrator.systems.coupling.observers import ObservedRun

if TYPE_CHECKING:
    import xarray as xr

_POINTS = 1000  # of a streamed curve
_PAUSE = 0.25  # between two parts of a streamed curve [s]
_MOST = 24  # signals that one question may ask for
_FEW = 6  # of a recording that has none of those that are asked for

_COMPARED = {"events": "events: was", "step_size_s": "step [s]: was"}
"""What a recording keeps of its scenario beside values, by its attribute; and the words of a difference."""

Say = Callable[[dict[str, Any]], None]


def plotted(scenario: Scenario) -> list[str]:
    """Return what the case plots, as far as the scenario records it: signals ``a.b`` or ``a.b - c.d``."""
    recorded = set(scenario.prepared.record)
    listed = [
        str(panel.signal) for plot in scenario.prepared.case.table.plots for panel in plot.panels
    ]
    return [one for one in dict.fromkeys(listed) if set(variables_of(one)) <= recorded]


def chosen(scenario: Scenario, wanted: Sequence[str]) -> list[str]:
    """Recorded signals by name, pattern, or difference of two; those that the case plots where none is given."""
    found: list[str] = []
    for one in wanted:
        fits = [name for name in scenario.prepared.record if fnmatchcase(name, one)]
        found += fits or ([one] if set(variables_of(one)) <= set(scenario.prepared.record) else [])
    return list(dict.fromkeys(found or plotted(scenario) or scenario.prepared.record))[:_MOST]


def curves(dataset: xr.Dataset, names: Sequence[str]) -> dict[str, list[list[float]]]:
    """By signal its times and values, thinned so that peaks stay."""
    times: Numbers = dataset["time"].values
    found = {name: seen for name in names if (seen := signal(dataset, name)) is not None}
    return {
        name: [part.tolist() for part in thinned(times, seen.values)]
        for name, seen in found.items()
    }


class Streamed:
    """Observes a run, and says from time to time what came since: ``{"time": …, "signals": …}``."""

    def __init__(self, scenario: Scenario, names: Sequence[str], say: Say) -> None:
        steps = max(1, round(scenario.prepared.stop_time / scenario.prepared.step_size))
        self.every = max(scenario.prepared.record_every, steps // _POINTS)
        self._names, self._say = names, say
        self._needed = list(dict.fromkeys(name for one in names for name in variables_of(one)))
        self._rows: list[list[float]] = []
        self._said = time.monotonic()
        self._stop = scenario.prepared.stop_time

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        """See `Observer.begin`."""

    def observe(self, run: ObservedRun) -> None:
        ends = (name.partition(".") for name in self._needed)
        self._rows.append(
            [run.time, *(run.components[c].get([variable])[variable] for c, _, variable in ends)]
        )
        if time.monotonic() - self._said > _PAUSE:
            self._flush()

    def end(self, run: ObservedRun) -> None:
        self._flush()

    def _flush(self) -> None:
        if self._rows:
            columns = dict(zip(["time", *self._needed], np.array(self._rows).T, strict=True))
            seen = {
                one: combined(one, [columns[name] for name in variables_of(one)]).tolist()
                for one in self._names
            }
            self._say({"time": columns["time"].tolist(), "signals": seen, "until": self._stop})
            self._rows = []
        self._said = time.monotonic()


def undrawn(wanted: Sequence[str], drawn: Iterable[str]) -> list[str]:
    """Return the names and patterns that no curve is of: others may be drawn in their place, which the page tells."""
    names = list(drawn)
    return [
        one for one in wanted if one not in names and not any(fnmatchcase(n, one) for n in names)
    ]


def linear(scenario: Scenario, wanted: Sequence[str]) -> dict[str, Any]:
    import_xarray_alone()
    drawn = curves(scenario.response(), chosen(scenario, wanted))
    return {"curves": drawn, "undrawn": undrawn(wanted, drawn)}


def simulated(scenario: Scenario, wanted: Sequence[str], say: Say) -> dict[str, Any]:
    """Run the co-simulation and keep it as ``gfor run`` does: ``folder``, ``curves``, ``findings``, ``ended_early``;
    ``undrawn``: what `undrawn` returns."""
    import_xarray_alone()
    names = chosen(scenario, wanted)
    run: Run = scenario.run(observers=[Streamed(scenario, names, say)])
    folder = run.save(Path("results") / "explore" / f"{scenario.prepared.case.name}_{new_run_id()}")
    drawn = curves(run.dataset, names)
    ring_down = None
    if run.ring_down is not None:
        ring_down = {
            "frequency_hz": run.ring_down.frequency_hz,
            "damping_percent": run.ring_down.damping_percent,
        }
    return {
        "folder": str(folder),
        "curves": drawn,
        "undrawn": undrawn(wanted, drawn),
        "answer": run.summary()["answer"],
        "findings": [finding.message for finding in run.findings],
        "ended_early": None if run.failure is None else str(run.failure),
        "ring_down": ring_down,
    }


def recorded(place: str, scenario: Scenario, wanted: Sequence[str]) -> dict[str, Any]:
    """Return what an earlier run or an instrument recorded: ``curves``, the ``names`` of all signals, and what
    ``differs`` between a run and the scenario as it is now."""
    if not place:
        raise InputError(
            f"nothing was recorded of scenario {scenario.name!r}; choose another one, or run it"
        )
    import_xarray_alone()
    prepared, dataset = scenario.prepared, open_trajectory(Path(place))
    names = [str(name) for name in dataset.data_vars]
    found = [
        name for one in wanted for name in ([n for n in names if fnmatchcase(n, one)] or [one])
    ]
    drawn = curves(dataset, list(dict.fromkeys(found or plotted(scenario)))[:_MOST])
    told, differs = dataset.attrs, []
    if "values" in told:
        were, live = json.loads(told["values"]), prepared.values
        differs = [
            f"{name} was {were.get(name, 'not set')}, is {live.get(name, 'not set')}"
            for name in {**were, **live}
            if not _equal(were.get(name), live.get(name))
        ]
        now = {"events": "; ".join(map(str, prepared.events)), "step_size_s": prepared.step_size}
        differs += [
            f"{words} {told.get(key) or 'none'}, is {now[key] or 'none'}"
            for key, words in _COMPARED.items()
            if told.get(key) != now[key]
        ]
    drawn = drawn or curves(dataset, names[:_FEW])
    return {
        "curves": drawn,
        "undrawn": undrawn(wanted, drawn),
        "names": names,
        "differs": differs,
        "of": place,
    }


def _equal(one: Any, other: Any) -> bool:
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return isclose(one, other, rel_tol=1e-9, abs_tol=1e-12) if numbers else bool(one == other)
