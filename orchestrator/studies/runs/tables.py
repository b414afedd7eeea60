"""Tables of modes and runs for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from rich.table import Table

from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.report import mode_tables
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.mode_tables import eigenvalue_text
from orchestrator.output.report.power_flow import COLUMNS, flow_table, totals
from orchestrator.output.report.short_texts import first_few, share_text
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.signals import relative_difference, signal
from orchestrator.studies.modes.modes import ModesResult, named_json

if TYPE_CHECKING:  # modes have tables as well, and need no run
    from orchestrator.studies.runs.run import RunResult


_SHAPES_SHOWN = 12
"""Shapes of modes without a name that a screen shows."""

_IN_A_CELL = 5
"""Components that a cell names in a mode with a name."""

_IN_A_CELL_OF_MANY = 3
"""The same without: in a large system each takes half a line, and a row as many lines as the longest cell."""


def steady_states(results: Sequence[ModesResult]) -> Table:
    columns = ("Scenario", "States", "Residual per step", "Drift [1/s]", "Power-flow residual [pu]")
    return make_table("Steady state", *columns, rows=map(_steady_cells, results))


def _steady_cells(r: ModesResult) -> tuple[str, ...]:
    flow = r.prepared.power_flow
    return (
        r.prepared.title,
        str(r.model.number_of_states),
        _residual_cell(r.operating_point.residual),
        _residual_cell(r.operating_point.drift),
        _residual_cell(math.nan if flow is None else flow.residual),
    )


def _residual_cell(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1e}"


def named_modes(results: Sequence[ModesResult], reference: str | None) -> ShownTable:
    """The modes that a case looks for, beside somebody else's figures where there are any."""
    return mode_tables.named_modes([named_json(r) for r in results], reference)


_HARDLY = "the others hardly move"  # where nobody swings against those who swing together


@dataclass(frozen=True)
class _Shape:
    """A mode whose shape is shown, and the words that stand for it."""

    label: str
    result: ModesResult
    mode: Mode


def mode_shapes(
    results: Sequence[ModesResult], *, with_values: bool = False, whole: bool = False
) -> Table:
    """Who swings against whom in the modes with a name, and who takes part; where none has one, in the swings with the
    least damping.

    ``with_values``: shows the eigenvalues as well, if no other table does; else modes with a name have their frequency.
    ``whole``: shows all modes where none has a name; else a line below counts the others."""
    names = list(dict.fromkeys(name for r in results for name in r.named))
    shapes = _of_named(results, names) if names else _of_unnamed(results, whole=whole)
    groups = [shape.mode.swing_groups(shape.result.swing) for shape in shapes]
    across, areas = any(group.between for group in groups), any(r.areas for r in results)
    with_hertz = bool(names) and not with_values
    columns = ["Scenario" if len(names) == 1 else "Mode"] + ["Mode [rad/s]"] * with_values
    columns += ["f [Hz]"] * with_hertz
    columns += ["Swing together", "Against"]
    columns += ["In between"] * across + ["Participation by component"] + ["By area"] * areas
    few = partial(first_few, most=_IN_A_CELL if names else _IN_A_CELL_OF_MANY)
    title = f"Mode shapes: {names[0]}" if len(names) == 1 else "Mode shapes"
    table = make_table(title, *columns, left=len(columns))
    for shape, group in zip(shapes, groups, strict=True):
        r, mode = shape.result, shape.mode
        together, _ = r.swing_of(mode)
        hardly = group.is_still and not group.between and len(together) > 1
        sides = [few(together, str), _HARDLY if hardly else few(group.other_side, str)]
        between = [f"{s.partition('.')[0]} {angle:+.0f}°" for s, angle in group.between.items()]
        sides += [few(between, str)] * across
        row = [shape.label, *[eigenvalue_text(mode.eigenvalue)] * with_values]
        row += [f"{mode.frequency_hz:.3f}"] * with_hertz + sides
        row.append(few(mode.by_component.items(), share_text))
        row += [few(r.by_area(mode).items(), share_text)] if areas else []
        table.add_row(*row)
    rest = 0 if names else sum(len(r.modes) for r, _ in _unlike(results)) - len(shapes)
    if rest:
        table.caption = f"and {rest} more, swings with more damping and controls: " + Option.DETAILS
        table.caption_justify = "left"
    return table


def _of_named(results: Sequence[ModesResult], names: Sequence[str]) -> list[_Shape]:
    return [
        _Shape(r.prepared.title if len(names) == 1 else f"{name}: {r.prepared.title}", r, mode)
        for name in names
        for r in results
        if (mode := r.named.get(name)) is not None
    ]


def _of_unnamed(results: Sequence[ModesResult], *, whole: bool) -> list[_Shape]:
    """All modes, or the swings with the least damping, fewer of each system where there are more."""
    unlike, shapes = _unlike(results), list[_Shape]()
    for r, titles in unlike:
        swings, _ = r.swings_apart()
        first = sorted(swings or r.modes, key=lambda mode: mode.damping_ratio)
        behind = f": {titles}" if len(unlike) > 1 else ""
        shapes += [
            _Shape(f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.2f} %{behind}", r, mode)
            for mode in (r.modes if whole else first[: max(1, _SHAPES_SHOWN // len(unlike))])
        ]
    return shapes


def _unlike(results: Sequence[ModesResult]) -> list[tuple[ModesResult, str]]:
    """The first result of each system, with the titles of those that have its modes, as where only events differ."""
    alike: dict[tuple[complex, ...], list[ModesResult]] = {}
    for r in results:
        alike.setdefault(tuple(mode.eigenvalue for mode in r.modes), []).append(r)
    return [(same[0], ", ".join(r.prepared.title for r in same)) for same in alike.values()]


def power_flows(results: Sequence[ModesResult]) -> Iterator[Table | ShownTable]:
    flows: dict[str, dict[str, Any]] = {}
    for r in results:
        flow = power_flow_json(r.prepared)
        if flow:
            same = next((titles for titles, other in flows.items() if other == flow), "")
            flows.pop(same, None)
            flows[f"{same}, {r.prepared.title}" if same else r.prepared.title] = flow
    for titles, flow in flows.items():
        for kind in COLUMNS:
            yield flow_table(f"{kind.capitalize()}: {titles}", kind, flow[kind])
        yield make_table(f"Power flow: {titles}", "What", "Value", rows=totals(flow))


def ring_downs(results: Sequence[RunResult]) -> ShownTable | None:
    """The swing that each response shows, beside the eigenvalue; None if no response shows one."""
    titles = [{"title": r.modes.prepared.title, **ring_down_json(r)} for r in results]
    return mode_tables.ring_downs(titles)


def ring_down_json(result: RunResult) -> dict[str, Any]:
    """Return the swing that the response shows, and the mode of the system that rings."""
    pair = {"ring_down": result.ring_down, "ring_down_mode": result.ringing.electromechanical}
    return {
        key: seen and eigenvalue_json(seen.eigenvalue, seen.damping_percent)
        for key, seen in pair.items()
    }


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


def mode_shifts(results: Sequence[RunResult]) -> ShownTable:
    return mode_tables.mode_shifts(
        (r.modes.prepared.title, shift.schedule, shift.step_size, shift.shift)
        for r in results
        for shift in sorted(r.shifts, key=lambda shift: shift.schedule)
    )


def run_statistics(results: Sequence[RunResult]) -> Table:
    of_steps = ("Communication steps", "Steps a second", "Times real time")
    headings = (*of_steps, "Threads", "Time in FMUs", "By component")
    table = make_table("Run", "Scenario", *headings)
    for r in results:
        s = r.statistics
        if s:
            shares = sorted(((c.name, c.share) for c in s.components), key=lambda entry: -entry[1])
            speed = (f"{s.steps_per_second:,.0f}", f"{s.real_time_factor:.3g}", str(s.threads))
            inside = (f"{s.share_in_fmus:.0%}", first_few(shares, share_text))
            table.add_row(r.modes.prepared.title, str(s.steps), *speed, *inside)
    return table
