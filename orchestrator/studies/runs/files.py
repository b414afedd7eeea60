"""Everything a study leaves in its output folder."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import RunInterruptedError
from orchestrator.core.safe_files import write_bytes
from orchestrator.output.report.explorer_cells import word_of
from orchestrator.output.report.power_flow import COLUMNS
from orchestrator.output.results.file_writers import save_csv, save_json, save_netcdf, save_table
from orchestrator.output.results.recording_reader import in_memory, open_whole
from orchestrator.output.results.recording_writer import TRAJECTORY
from orchestrator.output.results.signals import relative_difference
from orchestrator.output.results.staging import ScenarioFolder, new_run_id, staged
from orchestrator.studies.modes.modes import ModesResult, modes_json, named_json, scenario_json
from orchestrator.studies.modes.tables import head_of, modes_table
from orchestrator.studies.runs.answer import EarlyEnd
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.mode_plots import (
    plot_eigenvalues,
    plot_mode_shapes,
    plot_participation,
    plot_signals,
)
from orchestrator.studies.runs.run import RunResult
from orchestrator.studies.runs.tables import ring_down_json
from orchestrator.systems.coupling.events import BusFault, LineFault
from orchestrator.systems.coupling.statistics import StepStatistics

_TABLES = ("modes.csv", "participation.csv", "mode_shapes.csv")  # of `save_modes`
_SPEED = ("steps_per_second", "share_in_fmus", "real_time_factor", "threads")
"""Figures of a summary that the steps' statistics have under the same names."""

_LEAST_PARTICIPATION = 1e-3  # smaller factors are left out of the files


def save_run(result: RunResult, scenario: ScenarioFolder, *, csv: bool = True) -> None:
    """Write what belongs to one scenario beside its recording, as soon as it is there, and put it in its place."""
    if csv:
        save_csv(result.dataset, scenario.path / "trajectory.csv")
    if result.linear is not None:
        save_netcdf(result.linear.assign_attrs(result.dataset.attrs), scenario.path / "linear.nc")
    modes_table([result.modes]).save(scenario.path / "modes.csv")
    place = scenario.publish(None if result.failure is None else str(result.failure))
    if not in_memory(result.dataset):
        result.dataset = open_whole(place / TRAJECTORY)


def save_modes(results: Sequence[ModesResult], folder: Path) -> list[Path]:
    modes_table(results).save(folder / "modes.csv")
    save_table(_participation_rows(results), folder / "participation.csv")
    save_table(_shape_rows(results), folder / "mode_shapes.csv")
    flows = {
        r.prepared.name: flow for r in results if (flow := power_flow_json(r.prepared)) is not None
    }
    for kind in COLUMNS if flows else ():
        rows = [{"scenario": name, **row} for name, flow in flows.items() for row in flow[kind]]
        save_table(rows, folder / f"power_flow_{kind}.csv")
    reference = results[0].prepared.case.table.reference
    names = ", ".join(dict.fromkeys(name for r in results for name in r.named))
    circles = reference.title if reference and any(r.references for r in results) else ""
    marks = "; ".join(
        f"{mark}: {text}" for mark, text in (("large", names), ("circles", circles)) if text
    )
    plots = [folder / "eigenvalues.png"]
    plot_eigenvalues(results, f"Modes ({marks})" if marks else "Modes", plots[0])
    for plot, name in (
        (plot_participation, "participation.png"),
        (plot_mode_shapes, "mode_shapes.png"),
    ):
        if plot(results, folder / name):
            plots.append(folder / name)
    return plots


def write_modes(
    results: Sequence[ModesResult], folder: Path, weights: Sequence[str], beside: Sequence[str]
) -> list[str]:
    """Write what ``gfor modes --out`` leaves, all of it at once; return the files' names."""
    with staged(folder, new_run_id()) as staging:
        plots = [path.name for path in save_modes(results, staging)]
        save_json(modes_json(results, weights, beside), staging / "modes.json")
        flows = sorted(path.name for path in staging.glob("power_flow_*.csv"))
    return [*_TABLES, "modes.json", *flows, *plots]


def files_of_study(case: CaseDefinition) -> dict[str, bytes | None]:
    """Return what `save_study` writes of every case, by name, with what is known of it before."""
    plots = [f"{table.name}.png" for table in case.table.plots]
    unknown = [
        *_TABLES,
        "step_size.csv",
        "summary.json",
        "eigenvalues.png",
        "participation.png",
        *plots,
    ]
    return {"case.toml": case.content, **dict.fromkeys(unknown)}


def save_study(
    results: Sequence[RunResult],
    folder: Path,
    beside: Sequence[str],
    early_end: EarlyEnd | None = None,
) -> list[Path]:
    case = results[0].modes.prepared.case
    write_bytes(folder / "case.toml", case.content)
    save_table(_shift_rows(results), folder / "step_size.csv")
    ended = None if early_end is None else early_end.as_json()
    # the files are put there at the end
    made_of = {"case": case.name, "case_file": word_of(case, folder.parent)}
    given = {r.modes.prepared.name: dict(r.modes.prepared.given) for r in results}
    summary = {
        **made_of,
        "ended_early": ended,
        "given": given,
        "scenarios": [summary_of(r) for r in results],
        "beside": list(beside),
    }
    save_json(summary, folder / "summary.json")
    plots = []
    for table in case.table.plots:
        path = folder / f"{table.name}.png"
        if plot_signals(table, results, path):
            plots.append(path)
    return [*plots, *save_modes([r.modes for r in results], folder)]


def _participation_rows(results: Sequence[ModesResult]) -> list[dict[str, Any]]:
    return [
        {
            **head_of(row),
            "of": kind,
            "element": element,
            "participation": f"{factor:.6g}",
        }
        for row in modes_table(results).rows
        for kind, factors in (
            ("state", dict(row.mode.participation)),
            ("component", row.mode.by_component),
            ("area", row.result.by_area(row.mode)),
        )
        for element, factor in factors.items()
        if factor >= _LEAST_PARTICIPATION
    ]


def _shape_rows(results: Sequence[ModesResult]) -> list[dict[str, Any]]:
    """Magnitude and angle of the states that swing, relative to the mode's largest of them."""
    rows = []
    for row in modes_table(results).rows:
        swing = {state: row.mode.shape[state] for state in row.result.swing}
        largest = max(swing.values(), key=abs, default=0)
        rows += [
            {
                **head_of(row),
                "state": state,
                "magnitude": f"{abs(value / largest):.6g}",
                "angle [deg]": f"{math.degrees(cmath.phase(value / largest)):.4g}",
            }
            for state, value in swing.items()
            if largest
        ]
    return rows


def _shift_rows(results: Sequence[RunResult]) -> list[dict[str, Any]]:
    return [
        {
            "scenario": r.modes.prepared.name,
            "schedule": s.schedule,
            "step size [s]": s.step_size,
            "real [1/s]": f"{s.eigenvalue.real:.8g}",
            "imag [rad/s]": f"{s.eigenvalue.imag:.8g}",
            "continuous real [1/s]": f"{s.continuous.real:.8g}",
            "continuous imag [rad/s]": f"{s.continuous.imag:.8g}",
            "shift [rad/s]": f"{s.shift:.4g}",
        }
        for r in results
        for s in r.shifts
    ]


def summary_of(result: RunResult) -> dict[str, Any]:
    """Figures of one scenario: steady state, named modes, references, ring-down, speed, findings, failure."""
    modes = result.modes
    # no event has happened that growth would have to wait for
    undecided = result.before_its_events and modes.stability.stable is not False
    stable = None if undecided else modes.stability.stable
    swing = {name: modes.swing_of(mode) for name, mode in modes.named.items()}
    events = modes.prepared.events
    bus_faults = [e.bus for e in events if isinstance(e, BusFault) and e.on]
    line_faults = [e.line for e in events if isinstance(e, LineFault) and e.on]
    failure = str(result.failure) if result.failure else None
    isolated = {name: list(map(asdict, found)) for name, found in result.protections.items()}
    return {
        "name": modes.prepared.name,
        "title": modes.prepared.title,
        **scenario_json(modes),
        "stable": stable,
        **named_json(modes),
        **ring_down_json(result),
        **_speed(result.statistics),
        "linear_difference": _linear_differences(result),
        "swing": swing,
        "step_size_s": modes.prepared.step_size,
        "stop_time": modes.prepared.stop_time,
        "schedule": modes.prepared.schedule.name,
        "tolerance": modes.prepared.schedule.tolerance,
        "adaptive_steps": _adaptive_steps(result.statistics),
        "events": list(map(str, events)),
        "bus_faults": bus_faults,
        "line_faults": line_faults,
        "sequences": [fault.as_json() for fault in modes.prepared.faults],
        "answer": of_run(result).as_json(),
        "power_flow": _power_flow(modes.prepared),
        "linearised": modes.linearised,
        "fit_errors": modes.fit_errors,
        "warnings": list(modes.warnings),
        "stable_in_simulation": result.stable_in_simulation,
        "findings": [finding.as_json() for finding in result.findings],
        "failure": failure,
        "interrupted": isinstance(result.failure, RunInterruptedError),
        "isolated": isolated,
    }


def _speed(statistics: StepStatistics | None) -> dict[str, Any]:
    """How fast the run was; each figure is None where it made no steps."""
    if statistics is None:
        return dict.fromkeys(_SPEED)
    return {figure: getattr(statistics, figure) for figure in _SPEED}


def _adaptive_steps(statistics: StepStatistics | None) -> dict[str, Any] | None:
    if statistics is None or statistics.adaptive is None:
        return None
    return asdict(statistics.adaptive)


def _power_flow(prepared: PreparedScenario) -> dict[str, Any] | None:
    """Voltages [pu, degrees] by bus, and what every unit feeds [MVA, MW, Mvar]."""
    flow = prepared.power_flow
    if flow is None:
        return None
    units = {}
    for name, power in flow.powers.items():
        rating = prepared.system.components[name].number("S_n")
        units[name] = {
            "rating_mva": rating,
            "p_mw": power.real * rating,
            "q_mvar": power.imag * rating,
        }
    buses = {bus: [abs(v), math.degrees(cmath.phase(v))] for bus, v in flow.voltages.items()}
    found = power_flow_json(prepared) or {}
    regions = {bus: prepared.regions.of(bus).as_json() for bus in prepared.regions.at}
    told = {"regions": regions} if regions else {}
    return {**found, "residual": flow.residual, "buses": buses, "units": units, **told}


def _linear_differences(result: RunResult) -> dict[str, float] | None:
    if result.linear is None:
        return None
    return {
        str(n): relative_difference(result.dataset[n], result.linear[n])
        for n in result.dataset.data_vars
    }
