"""Tables of modes and runs for a terminal."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.table import Table

from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.report import power_flow
from orchestrator.output.report.tables import eigenvalue_text, first_few, make_table, share_text
from orchestrator.output.results.signals import relative_difference, signal
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.run import RunResult


def steady_states(results: Sequence[ModesResult]) -> Table:
    columns = ("Scenario", "States", "Residual per step", "Drift [1/s]", "Power-flow residual [pu]")
    rows = [
        (
            r.prepared.title,
            str(r.model.number_of_states),
            *(
                "–" if math.isnan(v) else f"{v:.1e}"
                for v in (r.operating_point.residual, r.operating_point.drift)
            ),
            f"{r.prepared.power_flow.residual:.1e}" if r.prepared.power_flow else "–",
        )
        for r in results
    ]
    return make_table("Steady state", *columns, rows=rows)


def named_modes(results: Sequence[ModesResult], reference_title: str | None) -> Table:
    """The modes that a case looks for, beside somebody else's figures where there are any."""
    names = list(
        dict.fromkeys(name for r in results for name in [*r.named, *r.unnamed, *r.references])
    )
    compared = any(r.references for r in results)
    columns = ["Scenario", "Mode [rad/s]", "f [Hz]", "Damping [%]"]
    if compared:
        columns += [f"{reference_title}: f [Hz]", "Damping [%]"]
    table = make_table(
        "Electromechanical modes" if len(names) > 1 else "Electromechanical mode", *columns
    )
    for name in names:
        for r in results:
            mode, reference = r.named.get(name), r.references.get(name)
            row = [f"{name}: {r.prepared.title}" if len(names) > 1 else r.prepared.title]
            if mode is None:
                row += ["not known" if name in r.unnamed else "none in range", "", ""]
            else:
                row += [
                    eigenvalue_text(mode.eigenvalue),
                    f"{mode.frequency_hz:.3f}",
                    f"{mode.damping_percent:.2f}",
                ]
            if reference is not None:
                row += [f"{reference.frequency_hz:.2f}", f"{reference.damping_percent:.2f}"]
            table.add_row(*row)
        table.add_section()
    return table


WELL_DAMPED = 0.3
"""Damping ratio from which a control's mode is only counted: it is over within a period."""


def all_modes(result: ModesResult, *, whole: bool = False) -> Table:
    """Modes in the range: those in which machines swing, or that have a name, above those of controls and fluxes.

    ``whole``: also lists the latter where they are well damped; else a line below counts them."""
    states, residual = result.model.number_of_states, result.operating_point.residual
    title = f"{result.prepared.title}: {states} states, residual {residual:.1e}"
    table = make_table(title, "Mode [rad/s]", "f [Hz]", "Damping [%]")
    table.add_column("Name")
    table.add_column("Most associated states (participation)", overflow="fold")
    swings, others = result.swings_apart()
    kept = [mode for mode in others if whole or not swings or mode.damping_ratio < WELL_DAMPED]
    counted = [mode.damping_percent for mode in others if mode.damping_ratio >= WELL_DAMPED]
    for mode in swings:
        _add_mode(table, result, mode)
    table.add_section()
    for mode in kept:
        _add_mode(table, result, mode)
    if len(kept) < len(others):
        modes = "modes" if len(counted) > 1 else "mode"
        how_many = f"{len(counted)} {modes} of controls and fluxes"
        table.caption = f"and {how_many}, damped by {min(counted):.0f} % or more: --details"
        table.caption_justify = "left"
    return table


def _add_mode(table: Table, result: ModesResult, mode: Mode) -> None:
    associated = ", ".join(f"{name} ({factor:.2f})" for name, factor in mode.participation[:3])
    name = result.name_of(mode) or ""
    figures = (f"{mode.frequency_hz:.4f}", f"{mode.damping_percent:.2f}")
    style = "bold" if name else None
    table.add_row(eigenvalue_text(mode.eigenvalue), *figures, name, associated, style=style)


def mode_shapes(results: Sequence[ModesResult]) -> Table:
    """Who swings against whom in the modes with a name, or in all where none has one, and who takes part."""
    names = list(dict.fromkeys(name for r in results for name in r.named))
    entries = [(name, r, r.named[name]) for name in names for r in results if name in r.named]
    if not names:
        entries = [(f"{mode.frequency_hz:.3f} Hz", r, mode) for r in results for mode in r.modes]
    groups = [mode.swing_groups(r.swing) for _, r, mode in entries]
    across, areas = any(group.between for group in groups), any(r.areas for r in results)
    columns = ["Mode", "Swing together", "Against"]
    columns += ["In between"] * across + ["Participation by component"] + ["By area"] * areas
    table = make_table("Mode shapes", *columns, left=len(columns))
    for (label, r, mode), group in zip(entries, groups, strict=True):
        sides = [first_few(side, str) for side in r.swing_of(mode)]
        between = [f"{s.partition('.')[0]} {angle:+.0f}°" for s, angle in group.between.items()]
        sides += [first_few(between, str)] * across
        row = [r.prepared.title if len(names) == 1 else f"{label}: {r.prepared.title}", *sides]
        row.append(first_few(mode.by_component.items(), share_text))
        row += [first_few(r.by_area(mode).items(), share_text)] if areas else []
        table.add_row(*row)
    return table


def power_flows(results: Sequence[ModesResult]) -> Iterator[Table]:
    flows: dict[str, dict[str, Any]] = {}
    for r in results:
        flow = power_flow_json(r.prepared)
        if flow:
            same = next((titles for titles, other in flows.items() if other == flow), "")
            flows.pop(same, None)
            flows[f"{same}, {r.prepared.title}" if same else r.prepared.title] = flow
    for titles, flow in flows.items():
        for kind in power_flow.COLUMNS:
            columns = power_flow.columns(flow[kind], kind)
            cells = power_flow.cells(flow[kind], kind)
            title, left = f"{kind.capitalize()}: {titles}", power_flow.TEXTS[kind]
            yield make_table(title, *columns.values(), left=left, rows=cells)
        yield make_table(f"Power flow: {titles}", "What", "Value", rows=power_flow.totals(flow))


def ring_downs(results: Sequence[RunResult]) -> Table:
    columns = (
        "Scenario",
        "f simulated [Hz]",
        "f mode [Hz]",
        "Damping simulated [%]",
        "Damping mode [%]",
    )
    rows = [
        (
            r.modes.prepared.title,
            f"{seen.frequency_hz:.4f}",
            f"{mode.frequency_hz:.4f}",
            f"{seen.damping_percent:.2f}",
            f"{mode.damping_percent:.2f}",
        )
        for r in results
        if (mode := r.ringing.electromechanical) and (seen := r.ring_down)
    ]
    return make_table(
        "Ring-down of the simulated response against the eigenvalue", *columns, rows=rows
    )


def linear_differences(results: Sequence[RunResult]) -> Table:
    """Largest difference between the linear model's response and the simulated one, signal by signal."""
    plots = results[0].modes.prepared.case.table.plots
    signals = dict.fromkeys(panel.signal for plot in plots for panel in plot.panels)
    table = make_table(
        "Linear model against the simulation: largest difference, of the largest deviation",
        "Scenario",
        *signals,
    )
    for r in results:
        if r.linear is not None:
            cells = []
            for expression in signals:
                seen, follows = signal(r.dataset, expression), signal(r.linear, expression)
                share = (
                    math.nan
                    if seen is None or follows is None
                    else relative_difference(seen, follows)
                )
                cells.append("–" if math.isnan(share) else f"{share:.2%}")
            table.add_row(r.modes.prepared.title, *cells)
    return table


def mode_shifts(results: Sequence[RunResult]) -> Table:
    steps = sorted({s.step_size for r in results for s in r.shifts})
    columns = ("Scenario", "Schedule", *(f"{h * 1e6:g} µs" for h in steps))
    table = make_table(
        "Shift of the electromechanical mode by the communication step [rad/s]", *columns, left=2
    )
    for r in results:
        for schedule in sorted({s.schedule for s in r.shifts}):
            values = {s.step_size: s.shift for s in r.shifts if s.schedule == schedule}
            table.add_row(r.modes.prepared.title, schedule, *(f"{values[h]:.1e}" for h in steps))
    return table


def run_statistics(results: Sequence[RunResult]) -> Table:
    table = make_table(
        "Run",
        "Scenario",
        "Steps",
        "Steps/s",
        "× real time",
        "Threads",
        "Time in FMUs",
        "By component",
    )
    for r in results:
        s = r.statistics
        if s:
            shares = sorted(((c.name, c.share) for c in s.components), key=lambda entry: -entry[1])
            speed = (f"{s.steps_per_second:,.0f}", f"{s.real_time_factor:.3g}", str(s.threads))
            inside = (f"{s.share_in_fmus:.0%}", first_few(shares, share_text))
            table.add_row(r.modes.prepared.title, str(s.steps), *speed, *inside)
    return table
