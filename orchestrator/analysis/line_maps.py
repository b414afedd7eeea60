"""The step map of the schedules of second order, in which inputs follow straight lines during a step."""

import numpy as np

from orchestrator.analysis.blocks import Blocks
from orchestrator.analysis.equations import Equations, Indices
from orchestrator.analysis.feedthrough import check_feedthrough
from orchestrator.analysis.linear_model import HELD, LinearModel
from orchestrator.coupling.schedule import Schedule
from orchestrator.errors import AnalysisError


def line_model(blocks: Blocks, schedule: Schedule) -> LinearModel:
    """Compose the step map of ``midpoint`` or ``newton``.

    In w stand all outputs at the step's beginning, those at its end, those on the extrapolated lines' ends, and the
    external inputs, which are held.

    Raises an `AnalysisError` if direct feed-through closes a loop; if an output depends on an input of which its FMU
    says that it does not, as such an output is not read again after the step; or if a connection does more than carry
    its value."""
    if blocks.links:
        disturbed = ", ".join(link.name for link in blocks.links.values())
        raise AnalysisError(
            f"schedule {schedule.name!r} has no place for a connection with a delay or a cut: {disturbed}"
        )
    check_feedthrough(blocks, list(blocks.components))
    _check_declared(blocks)
    p, windows, names = len(blocks.output_names), blocks.state_windows(), blocks.state_names()
    guessed = _guessed(blocks, schedule)
    n, first_external = len(names), 3 * p
    equations = Equations(n + len(guessed), 3 * p + len(blocks.inputs))
    every = np.arange(p)

    def entries(name: str, first: Indices) -> Indices:
        """Where a component's inputs stand in w; ``first`` has that of each output."""
        sources = blocks.sources[name]
        return np.where(sources < p, first[np.minimum(sources, p - 1)], first_external + sources - p)

    for name, c in blocks.components.items():
        equations.output(every[blocks.window[name]], windows[name], c.C, entries(name, every), c.D)
    for k, i in enumerate(guessed):
        place, nothing = slice(n + k, n + k + 1), np.zeros((1, 0))
        equations.output(2 * p + every[i : i + 1], place, -np.eye(1), every[i : i + 1], np.full((1, 1), 2.0))
        equations.next_state(place, slice(0, 0), nothing, every[i : i + 1], np.eye(1))
    newest = every + (p if schedule.coupling == "newton" else 2 * p)
    for group in schedule.groups:
        ends = {name: entries(name, newest) for name in group}
        for name in group:
            c, x, begin, end = blocks.components[name], windows[name], entries(name, every), ends[name]
            A, B, E = blocks.over_step(name)
            equations.next_state(x, x, A, begin, B / 2 - E)
            equations.next_state(x, slice(0, 0), np.zeros((len(A), 0)), end, B / 2 + E)
            rows = p + every[blocks.window[name]]
            equations.output(rows, x, c.C @ A, begin, c.C @ (B / 2 - E))
            equations.output(rows, slice(0, 0), np.zeros((len(rows), 0)), end, c.C @ (B / 2 + E) + c.D)
            newest[blocks.window[name]] = rows
    all_names = (*names, *(f"{blocks.output_names[i]}{HELD}" for i in guessed))
    return equations.model(all_names, blocks.step_size, blocks.disagreement, blocks.how)


def _guessed(blocks: Blocks, schedule: Schedule) -> list[int]:
    """Outputs whose end is extrapolated, because somebody takes them before they are stepped."""
    if schedule.coupling == "newton":
        return []
    known: set[int] = set()
    found: set[int] = set()
    p = len(blocks.output_names)
    for members in schedule.groups:
        found |= {i for name in members for i in blocks.sources[name].tolist() if i < p} - known
        known |= {i for name in members for i in range(p)[blocks.window[name]]}
    return sorted(found)


def _check_declared(blocks: Blocks) -> None:
    for name, c in blocks.components.items():
        connected = blocks.sources[name] < len(blocks.output_names)
        for row, output in enumerate(c.outputs):
            undeclared = np.array([given not in blocks.declared[name][output] for given in c.inputs], dtype=bool)
            for column in np.flatnonzero(undeclared & connected & (c.D[row] != 0)).tolist():
                raise AnalysisError(
                    f"component {name!r}: its FMU declares that {output} does not depend on {c.inputs[column]} "
                    f"directly, and it does ({c.D[row, column]:.3g}); a schedule of second order relies on that: take "
                    "gauss-seidel, or mend the dependencies in its modelDescription.xml"
                )
