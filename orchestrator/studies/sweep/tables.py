"""A sweep on a terminal."""

from rich.markup import escape
from rich.table import Table

from orchestrator.core.errors import number_of
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.studies.sweep.dataset import Samples, warned
from orchestrator.studies.sweep.limit import Ending
from orchestrator.studies.sweep.plots import axis_label
from orchestrator.studies.sweep.sweep import ScenarioSweep
from orchestrator.studies.sweep.trajectories import GridPlace, Trajectory
from orchestrator.studies.sweep.verdicts import least_damped, place_text, value_text, verdicts

_FAILURES_SHOWN = 5  # points that could not be computed


def _with_least_damping(samples: Samples, sweep: ScenarioSweep) -> Trajectory | None:
    """Return the trajectory on which the least damped mode of the verdict is."""
    found = least_damped(sweep, samples.axes)
    if found is None:
        return None
    place, _, mode = found
    there = (t for t in sweep.trajectories if place in t.points)
    return next((t for t in there if t.points[place].mode == mode), None)


def trajectories(samples: Samples) -> Table:
    """The ends of each trajectory, its least and its most damping, and its least similarity from point to point.

    The table shows the trajectories with a name and that of the least damping, or all if the case names no mode."""
    title = f"Each mode over {', '.join(axis_label(axis) for axis in samples.axes)}"
    figures = ("f [Hz]", "Damping [%]", "Least [%]", "Most [%]", "Points", "Alike")
    table = make_table(title, "Mode", *figures)
    anything = any(t.case_name for s in samples.result.scenarios for t in s.trajectories)
    for sweep in samples.result.scenarios:
        least_of_all = _with_least_damping(samples, sweep)
        for trajectory in sweep.trajectories:
            curve = samples.of(sweep, trajectory)
            unnamed = anything and trajectory.case_name is None
            if not curve or (unnamed and trajectory is not least_of_all):
                continue
            (_, first), (_, last) = curve[0], curve[-1]
            where, least = min(curve, key=lambda entry: float(entry[1]["damping"]))
            top, most = max(curve, key=lambda entry: float(entry[1]["damping"]))
            alike = [f["similarity"] for _, f in curve if f["similarity"] == f["similarity"]]
            named = sum(f["named"] for _, f in curve)
            points = f"{len(curve)}"
            if named not in (0, len(curve)):
                points += f", named at {named}"
            cells = (
                f"{sweep.prepared.title}: {trajectory.name}{', damped least' if unnamed else ''}",
                f"{first['frequency']:.3f} → {last['frequency']:.3f}",
                f"{first['damping']:.2f} → {last['damping']:.2f}",
                f"{least['damping']:.2f} at {_values(samples, where)}",
                f"{most['damping']:.2f} at {_values(samples, top)}",
                points,
                f"{min(alike):.2f}" if alike else "–",
            )
            table.add_row(*cells)
        table.add_section()
    table.caption = (
        "Alike: the least likeness of the mode's shape from point to point; 1 is the same."
    )
    table.caption_justify = "left"
    return table


def stability(samples: Samples) -> list[str]:
    """The verdict on every scenario over all its points, as rich markup; an unstable one first."""
    return [verdict.markup(title) for title, verdict in verdicts(samples.result)]


def limits(samples: Samples) -> list[str]:
    """How far the parameter may go, as rich markup: of each scenario the first limit, and what follows, a line each."""
    colours = {Ending.HOLDS: "green", Ending.FAILS: "red"}
    found = []
    for limit in samples.result.limits:
        colour = "yellow" if limit.strained else colours.get(limit.kind, "yellow")
        found.append(f"[bold {colour}]{escape(limit.title)}[/]: {escape(limit.lines[0])}")
        found += [f"  then: {escape(line)}" for line in limit.lines[1:]]
    return found


def remarks(samples: Samples) -> list[str]:
    result, texts = (
        samples.result,
        [f"question: {question}" for question in samples.result.plan.idle],
    )
    texts += [text for limit in result.limits for text in limit.remarks]
    failures = list(result.failures())
    if failures:
        texts.append(
            f"{number_of(len(failures), 'point')} of {result.plan.number_of_points} failed:"
        )
        texts += [
            f"  {sweep.prepared.name}, {place_text(samples.axes, place)}: {error}"
            for sweep, place, error in failures[:_FAILURES_SHOWN]
        ]
        more = len(failures) - _FAILURES_SHOWN
        texts += [f"  … and {more} more, in sweep.csv"] if more > 0 else []
    breaks = [
        (sweep, trajectory, place)
        for sweep in result.scenarios
        for trajectory in sweep.trajectories
        for place, point in trajectory.points.items()
        if point.beginning.name == "BROKEN"
    ]
    for sweep, trajectory, place in breaks[:_FAILURES_SHOWN]:
        texts.append(
            f"{sweep.prepared.name}: {trajectory.name} begins at {place_text(samples.axes, place)}, not recognised in "
            "the point before; take more points there"
        )
    more = len(breaks) - _FAILURES_SHOWN
    texts += [f"… and {more} more beginnings, marked 'broken' in sweep.csv"] if more > 0 else []
    if result.refined and not result.limits:
        texts.append(
            f"{number_of(result.refined, 'point')} between the values asked for served to recognise modes "
            "('refined' in sweep.csv)"
        )
    return [*texts, *warned(samples)]


def _values(samples: Samples, place: GridPlace) -> str:
    return ", ".join(value_text(value) for value in samples.setting(place).values())
