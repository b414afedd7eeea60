"""A sweep as a labelled dataset, as a long table, and as JSON."""

from __future__ import annotations

import fnmatch
import itertools
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.late import xr
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.output.report.short_texts import kinds_of
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.output.results.file_writers import provenance, save_netcdf, save_table
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.studies.sweep.axes import grid_places
from orchestrator.studies.sweep.point import PointRecord
from orchestrator.studies.sweep.sweep import ScenarioSweep, SweepResult
from orchestrator.studies.sweep.trajectories import GridPlace, Trajectory
from orchestrator.studies.sweep.verdicts import verdicts

_FIGURES = ("real", "imag", "frequency", "damping", "similarity")
_ATTRIBUTES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))

# xarray's own attributes have the short names
_IN_DATASET = {"real": "eigenvalue_real", "imag": "eigenvalue_imag"}
_SEPARATOR = "; "  # between the warnings of one point
_BEGINNINGS = "start followed refined entered broken"


Curve = list[tuple[GridPlace, dict[str, Any]]]  # A trajectory's figures by place


class Samples:
    def __init__(self, result: SweepResult) -> None:
        self.result = result
        self._curves: dict[int, Curve] = {}
        self.axes = result.plan.axes
        records = (r.modes for s in result.scenarios for r in s.points.values() if r.modes)
        every, patterns = (
            dict.fromkeys(n for r in records for n in r.names),
            result.plan.case.table.analysis.swing,
        )
        self.states = [
            name for name in every if any(fnmatch.fnmatchcase(name, p) for p in patterns)
        ]
        self.components = [*dict.fromkeys(name.partition(".")[0] for name in every)]

    def of(self, sweep: ScenarioSweep, trajectory: Trajectory) -> Curve:
        if id(trajectory) not in self._curves:
            self._curves[id(trajectory)] = list(self._samples(sweep, trajectory))
        return self._curves[id(trajectory)]

    def _samples(
        self, sweep: ScenarioSweep, trajectory: Trajectory
    ) -> Iterator[tuple[GridPlace, dict[str, Any]]]:
        for place, point in trajectory.points.items():
            modes = sweep.points[place].modes
            if modes is None:
                continue
            value = complex(modes.eigenvalues[point.mode])
            factors = modes.participation()[point.mode]
            states = {
                n: float(f) for n, f in zip(modes.names, factors, strict=True) if n in self.states
            }
            components: dict[str, float] = {}
            for name, factor in zip(modes.names, factors, strict=True):
                component = name.partition(".")[0]
                components[component] = components.get(component, 0.0) + float(factor)
            yield (
                place,
                {
                    "real": value.real,
                    "imag": value.imag,
                    "frequency": value.imag / (2 * np.pi),
                    "damping": damping_percent(value),
                    "similarity": point.similarity,
                    "named": point.named,
                    "beginning": point.beginning,
                    "states": states,
                    "components": components,
                },
            )

    def setting(self, place: GridPlace) -> dict[str, float | bool]:
        return {axis.key: axis.values[int(i)] for axis, i in zip(self.axes, place, strict=True)}


Labelled = dict[str, tuple[list[str], Any]]
"""Arrays with the names of their dimensions, by the name in the dataset."""


def sweep_dataset(samples: Samples) -> xr.Dataset:
    """Everything over (scenario, varied parameters, trajectory); NaN where a trajectory is not."""
    arrays = _of_trajectories(samples) | _of_points(samples)
    data: dict[str, Any] = {
        name: (*found, dict(_ATTRIBUTES[name])) for name, found in arrays.items()
    }
    flags = {"flag_values": list(range(5)), "flag_meanings": _BEGINNINGS, "_FillValue": np.int8(-1)}
    data["beginning"][2].update(flags)
    data["stable"][2]["_FillValue"] = np.int8(-1)
    return xr.Dataset(data, coords=_coordinates(samples), attrs=_attributes(samples))


def _most_trajectories(samples: Samples) -> int:
    return max((len(s.trajectories) for s in samples.result.scenarios), default=0)


def _sizes_of_points(samples: Samples) -> tuple[int, ...]:
    """Sizes of the scenarios and of the grid of points."""
    return (len(samples.result.scenarios), *(len(axis.values) for axis in samples.axes))


def _of_trajectories(samples: Samples) -> Labelled:
    """Figures of each trajectory's mode at each point."""
    shape = (*_sizes_of_points(samples), _most_trajectories(samples))
    dims = ["scenario", *(axis.key for axis in samples.axes), "trajectory"]
    figures = {name: np.full(shape, np.nan) for name in _FIGURES}
    named, beginning = np.zeros(shape, dtype=np.int8), np.full(shape, -1, dtype=np.int8)
    of_states = np.full((*shape, len(samples.states)), np.nan)
    of_components = np.full((*shape, len(samples.components)), np.nan)
    for s, sweep in enumerate(samples.result.scenarios):
        for t, trajectory in enumerate(sweep.trajectories):
            for place, sample in samples.of(sweep, trajectory):
                at = (s, *(int(i) for i in place), t)
                for name, array in figures.items():
                    array[at] = sample[name]
                named[at], beginning[at] = sample["named"], sample["beginning"]
                of_states[at] = [sample["states"].get(name, np.nan) for name in samples.states]
                of_components[at] = [
                    sample["components"].get(name, np.nan) for name in samples.components
                ]
    return {
        **{_IN_DATASET.get(name, name): (dims, array) for name, array in figures.items()},
        "named": (dims, named),
        "beginning": (dims, beginning),
        "participation": ([*dims, "state"], of_states),
        "component_participation": ([*dims, "component"], of_components),
    }


def _of_points(samples: Samples) -> Labelled:
    """Residual, verdict, error and warnings of each point."""
    shape = _sizes_of_points(samples)
    dims = ["scenario", *(axis.key for axis in samples.axes)]
    residual = np.full(shape, np.nan)
    errors, warnings = (np.full(shape, "", dtype=object) for _ in range(2))
    verdicts = {
        "stable": np.full(shape, -1, dtype=np.int8),
        "largest_growth_rate": np.full(shape, np.nan),
        "frequency_hz": np.full(shape, np.nan),
    }
    for s, sweep in enumerate(samples.result.scenarios):
        for place in itertools.product(*map(range, shape[1:])):
            point, at = sweep.points[place], (s, *place)
            residual[at] = point.residual
            errors[at] = point.error or ""
            warnings[at] = _SEPARATOR.join(point.warnings)
            for key, array in verdicts.items():
                if point.stability.get(key) is not None:
                    array[at] = point.stability[key]
    at_points = {
        "residual": residual,
        "stable": verdicts["stable"],
        "largest_growth_rate": verdicts["largest_growth_rate"],
        "largest_growth_frequency": verdicts["frequency_hz"],
        "error": errors.astype(str),
        "warnings": warnings.astype(str),
    }
    return {name: (dims, array) for name, array in at_points.items()}


def _coordinates(samples: Samples) -> dict[str, Any]:
    """Names of scenarios, trajectories, states and components, and the values of the axes."""
    scenarios, longest = samples.result.scenarios, _most_trajectories(samples)
    names = [[""] * longest for _ in scenarios]
    for row, sweep in zip(names, scenarios, strict=True):
        row[: len(sweep.trajectories)] = [trajectory.name for trajectory in sweep.trajectories]
    coordinates: dict[str, Any] = {
        "scenario": (
            "scenario",
            [s.prepared.name for s in scenarios],
            {"long_name": "Scenario"},
        ),
        "trajectory": (
            "trajectory",
            np.arange(1, longest + 1, dtype=np.int32),
            {"long_name": "Trajectory"},
        ),
        "trajectory_name": (
            ["scenario", "trajectory"],
            np.array(names, dtype=str),
            {"long_name": "Name"},
        ),
        "state": ("state", samples.states, {"long_name": "State"}),
        "component": ("component", samples.components, {"long_name": "Component"}),
    }
    for axis in samples.axes:
        values = [float(value) for value in axis.values]
        coordinates[axis.key] = (
            axis.key,
            values,
            {"units": axis.unit or "1", "long_name": axis.title},
        )
    return coordinates


def _attributes(samples: Samples) -> dict[str, Any]:
    result = samples.result
    origin = provenance(result.plan.scenarios[0])
    everyone = [provenance(prepared) for prepared in result.plan.scenarios]
    own = {
        key: json.dumps({p["scenario"]: p[key] for p in everyone})
        for key in ("title", "values", "schedule", "fmus")
    }
    low, high = result.plan.frequency_range
    return (
        {k: v for k, v in origin.items() if k not in ("scenario", "events")}
        | own
        | {
            "overrides": json.dumps(result.plan.overrides),
            "models": result.plan.scenarios[0].models or "",
            "basis": json.dumps(result.plan.scenarios[0].basis),
            "warned": json.dumps([*_questions_of(samples), *warned(samples)]),
            "frequency_range_hz": [low, high],
            "verdicts": json.dumps([_verdict_json(*one) for one in verdicts(result)]),
        }
    )


def _verdict_json(title: str, verdict: VerdictSentence) -> dict[str, Any]:
    return {"scenario": title, "stable": verdict.good, "sentence": str(verdict)}


def _questions_of(samples: Samples) -> dict[str, None]:
    return {
        str(question): None
        for sweep in samples.result.scenarios
        for question in sweep.prepared.questions
    }


def warned(samples: Samples) -> list[str]:
    """Each kind of warning once, with the number of points that have it."""
    asked = _questions_of(samples)  # said already, before the sweep
    points = [record for sweep in samples.result.scenarios for record in sweep.points.values()]
    kinds = kinds_of(
        (record, (text for text in record.warnings if text not in asked)) for record in points
    )
    return [f"at {len(having)} of {len(points)} points: {text}" for text, having in kinds]


def sweep_rows(samples: Samples) -> list[dict[str, Any]]:
    rows = []
    units = {
        axis.key: f"{axis.key} [{axis.unit}]" if axis.unit else axis.key for axis in samples.axes
    }
    for sweep in samples.result.scenarios:
        for trajectory in sweep.trajectories:
            for place, sample in samples.of(sweep, trajectory):
                setting = {units[key]: value for key, value in samples.setting(place).items()}
                figures = {
                    f"{name} [{unit}]" if unit != "1" else name: f"{sample[name]:.10g}"
                    for name in _FIGURES
                    if (unit := _ATTRIBUTES[_IN_DATASET.get(name, name)]["units"])
                }
                shares = {f"participation {s}": _share(sample["states"], s) for s in samples.states}
                shares |= {
                    f"participation {c}": _share(sample["components"], c)
                    for c in samples.components
                }
                rows.append(
                    {
                        "scenario": sweep.prepared.name,
                        **setting,
                        "trajectory": trajectory.name,
                        **figures,
                    }
                    | {"named": int(sample["named"]), "beginning": sample["beginning"].name.lower()}
                    | {**shares, **_verdict(sweep.points[place]), "error": ""}
                    | {"warnings": _SEPARATOR.join(sweep.points[place].warnings)}
                )
    empty = dict.fromkeys(
        rows[0] if rows else ["scenario", *units.values(), "error", "warnings"], ""
    )
    for sweep, place, error in samples.result.failures():
        setting = {units[key]: value for key, value in samples.setting(place).items()}
        rows.append(empty | {"scenario": sweep.prepared.name, **setting, "error": error})
    return rows


def _verdict(record: PointRecord) -> dict[str, str]:
    rate = record.stability.get("largest_growth_rate")
    word = "" if record.stability.get("stable") is None else str(record.stability["stable"]).lower()
    hertz = record.stability.get("frequency_hz")
    return {
        "stable": word,
        "largest growth rate [1/s]": "" if rate is None else f"{rate:.10g}",
        "frequency of largest growth rate [Hz]": "" if hertz is None else f"{hertz:.10g}",
    }


def _share(shares: dict[str, float], name: str) -> str:
    return f"{shares[name]:.6g}" if name in shares else ""


def sweep_json(samples: Samples) -> dict[str, Any]:
    result = samples.result
    failed: dict[str, list[dict[str, Any]]] = {s.prepared.name: [] for s in result.scenarios}
    for sweep, place, error in result.failures():
        failed[sweep.prepared.name].append({"values": samples.setting(place), "error": error})
    limits = [limit.as_json() for limit in result.limits]
    only = limits[0] if len(limits) == 1 else {}
    found = only | {"limits": limits} if limits else {}
    return found | {
        "case": result.plan.case.name,
        "parameters": [
            {"name": a.key, "unit": a.unit, "values": list(a.values)} for a in samples.axes
        ],
        "step_size_s": result.plan.scenarios[0].step_size,
        "points": {
            "computed": result.computed,
            "stored": result.stored,
            "refining": result.refined,
        },
        "scenarios": [
            _scenario_json(samples, sweep, failed[sweep.prepared.name])
            for sweep in result.scenarios
        ],
    }


def _scenario_json(
    samples: Samples, sweep: ScenarioSweep, failed: list[dict[str, Any]]
) -> dict[str, Any]:
    unstable = [
        {"values": samples.setting(place)} | sweep.points[place].stability
        for place in sweep.unstable(samples.axes)
    ]
    trajectories = []
    for trajectory in sweep.trajectories:
        points = [_point_json(samples.setting(p), f) for p, f in samples.of(sweep, trajectory)]
        trajectories.append({"name": trajectory.name, "points": points})
    warnings = [
        {"values": samples.setting(place), "warnings": list(sweep.points[place].warnings)}
        for place in grid_places(samples.axes)
        if sweep.points[place].warnings
    ]
    return {
        "name": sweep.prepared.name,
        "title": sweep.prepared.title,
        "stable": sweep.stable,
        "unstable": unstable,
        "trajectories": trajectories,
        "failed": failed,
        "warnings": warnings,
    }


def _point_json(setting: dict[str, float | bool], sample: dict[str, Any]) -> dict[str, Any]:
    return {
        "values": setting,
        **eigenvalue_json(complex(sample["real"], sample["imag"]), sample["damping"]),
        "similarity": None if np.isnan(sample["similarity"]) else sample["similarity"],
        "named": sample["named"],
        "beginning": sample["beginning"].name.lower(),
        "participation": sample["states"],
        "components": sample["components"],
    }


def save_sweep(samples: Samples, folder: Path) -> list[str]:
    """Write sweep.nc and sweep.csv, and limits.json where limits were searched for; returns their names."""
    save_netcdf(sweep_dataset(samples), folder / "sweep.nc")
    save_table(sweep_rows(samples), folder / "sweep.csv")
    if not samples.result.limits:
        return ["sweep.nc", "sweep.csv"]
    found = json.dumps(
        [limit.as_json() for limit in samples.result.limits], indent=1, ensure_ascii=False
    )
    (folder / "limits.json").write_text(found, encoding="utf-8")
    return ["sweep.nc", "sweep.csv", "limits.json"]
