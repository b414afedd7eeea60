"""The verdict on every scenario of a sweep, in the words of the terminal, of files and of pages."""

import math
from collections.abc import Sequence

from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import damping_percent, mode_in_words, shares_of_components
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.sweep.axes import Axis, grid_places
from orchestrator.studies.sweep.sweep import ScenarioSweep, SweepResult
from orchestrator.studies.sweep.trajectories import GridPlace

_TURNS = 3  # changes of stability along an axis that are named


def verdicts(result: SweepResult) -> list[tuple[str, VerdictSentence]]:
    """Each scenario's title with the verdict over all its points; an unstable one first."""
    order = {False: 0, None: 1, True: 2}
    axes = result.plan.axes
    return [
        (sweep.prepared.title, _verdict(sweep, axes))
        for sweep in sorted(result.scenarios, key=lambda one: order[one.stable])
    ]


def _verdict(sweep: ScenarioSweep, axes: Sequence[Axis]) -> VerdictSentence:
    total = math.prod(len(axis.values) for axis in axes)
    least = _least(sweep, axes)
    places, known = sweep.unstable(axes), sweep.counts(axes)
    rest = f" ({known[True]} stable, {known[None]} not known)" if known[None] else ""
    if places:
        worst = f"worst at {place_text(axes, places[0])}: {sweep.points[places[0]].because}"
        at = f"at {len(places)} of {total} points{rest}{least}; {worst}{_turns(sweep, axes)}"
        return VerdictSentence(False, "UNSTABLE", at)
    if sweep.stable is False:
        between = f"between two points of the grid{rest}; take more points{least}"
        return VerdictSentence(False, "UNSTABLE", between)
    if known[None]:
        counted = f"{known[None]} of {total} points have no verdict, {known[True]} are stable, 0 are unstable{least}"
        return VerdictSentence(None, "not known", counted)
    if sweep.stable is None:
        between = f"a point between those of the grid has no verdict{least}"
        return VerdictSentence(None, "not known", between)
    return VerdictSentence(True, "stable", f"nothing grows at any of {total} points{least}")


def least_damped(
    sweep: ScenarioSweep, axes: Sequence[Axis]
) -> tuple[GridPlace, ModeSet, int] | None:
    """Return the place of the grid with the least damping of the range, its modes, and which; None without modes."""
    modes_at = {place: sweep.points[place].modes for place in grid_places(axes)}
    found = [
        (place, modes, k)
        for place, modes in modes_at.items()
        if modes is not None
        for k in range(len(modes.eigenvalues))
    ]
    return min(
        found,
        key=lambda one: damping_percent(complex(one[1].eigenvalues[one[2]])),
        default=None,
    )


def _least(sweep: ScenarioSweep, axes: Sequence[Axis]) -> str:
    """The least damped mode of the range at all places of the grid, and where that is; "" without modes."""
    found = least_damped(sweep, axes)
    if found is None:
        return ""
    place, modes, k = found
    shares = shares_of_components(zip(modes.names, modes.participation()[k].tolist(), strict=True))
    told = mode_in_words(complex(modes.eigenvalues[k]), shares.items())
    return f"; least damping at {place_text(axes, place)}: {told}"


def _turns(sweep: ScenarioSweep, axes: Sequence[Axis]) -> str:
    """Between which neighbours of the only axis the verdict changes; "" of several axes."""
    if len([axis for axis in axes if len(axis.values) > 1]) != 1:
        return ""
    places = sorted(
        grid_places(axes),
        key=lambda place: [float(a.values[int(i)]) for a, i in zip(axes, place, strict=True)],
    )
    words = {True: "stable", False: "unstable", None: "not known"}
    found = [sweep.points[place].stability.get("stable") for place in places]
    turns = [
        f"{words[one]} at {place_text(axes, here)}, {words[other]} at {place_text(axes, there)}"
        for here, there, one, other in zip(places, places[1:], found, found[1:], strict=False)
        if one is not other
    ]
    more = f"; {len(turns) - _TURNS} more changes" if len(turns) > _TURNS else ""
    return f"; {'; '.join(turns[:_TURNS])}{more}" if turns else ""


def place_text(axes: Sequence[Axis], place: GridPlace) -> str:
    """``grid.X_L = 0.1 pu``."""
    return ", ".join(
        f"{axis.key} = {value_text(axis.values[int(i)])} {axis.unit}".rstrip()
        for axis, i in zip(axes, place, strict=True)
    )


def value_text(value: float | bool) -> str:
    """A value of an axis as it is typed."""
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
