"""A screening in words: its verdict, what it rests on, what it could not judge, and its outages, worst first."""

import fnmatch
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.cases.new.widened_limits import HEADROOM
from orchestrator.core.errors import few
from orchestrator.core.options import Option, command
from orchestrator.core.spelling import Text
from orchestrator.linear.spectra.critical_modes import DENSE
from orchestrator.linear.spectra.modes import LOCAL_HZ, mode_in_words
from orchestrator.linear.spectra.shifted_equations import GROWING
from orchestrator.linear.spectra.stability import drift_in_words, zeros_in_words
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.operating_points.line_ends import LineEnd
from orchestrator.studies.operating_points.outages import Outage
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.operating_points.points_file import OperatingCase
from orchestrator.studies.operating_points.widening import widest
from orchestrator.studies.operating_points.words import ONE_ITEM, all_items, counted_items
from orchestrator.studies.screening.modes import UNSTABLE
from orchestrator.studies.screening.record import ItemRecord
from orchestrator.studies.screening.study import ScreenedItem, ScreeningPlan
from orchestrator.studies.screening.summary import ModeAt, Summary, least_of, where
from orchestrator.studies.screening.trips import runs_sentence

WIDENED = " (limit widened)"
"""Marks an item that was computed with wider limits than the case has."""

_NAMED = 4  # limits, or their units, that are named


@dataclass(frozen=True)
class OutageRow:
    name: str
    # the item with the least damping, or that grows; None where none has modes
    worst: ScreenedItem | None
    least: ModeAt | None  # its least damped mode; None where it has none in the range
    unjudged: tuple[ScreenedItem, ...]  # items without modes
    points: int

    @property
    def unstable(self) -> bool:
        return self.worst is not None and self.worst.record.stable is False


def _rank(item: ScreenedItem) -> tuple[bool, float, float]:
    """Return a key that puts unstable items first, the fastest growth first, and then those with the least damping.

    Of those where the common speed alone drifts, the swings are judged. Growth beside the critical modes counts too:
    a voltage that runs away has no damping ratio."""
    least = least_of(item)
    damping = least.damping if least else np.inf
    if item.record.stable is not False:
        return True, 0.0, damping
    if only_drifts(item.record):
        return False, 0.0, damping
    return False, -_fastest_growth(item.record), damping


def _fastest_growth(record: ItemRecord) -> float:
    """Return the growth [1/s] of what grows fastest; 0 where growing eigenvalues were only counted."""
    known = [float(value) for value in record.eigenvalues.real]
    known += [record.fastest[0]] if record.fastest is not None else []
    return max([0.0, *known])


def by_outage(summary: Summary) -> list[OutageRow]:
    groups: dict[str, list[ScreenedItem]] = {}
    for item in summary.result.items:
        groups.setdefault(item.outage.name, []).append(item)
    rows = []
    for name, items in groups.items():
        known = [item for item in items if item.record.status is Status.COMPUTED]
        worst = min(known, key=_rank, default=None)
        least = None if worst is None else least_of(worst)
        unjudged = tuple(item for item in items if item.record.status is not Status.COMPUTED)
        rows.append(OutageRow(name, worst, least, unjudged, len(items)))
    return sorted(rows, key=_rank_of_row)


def _rank_of_row(row: OutageRow) -> tuple[bool, bool, float, float]:
    """Return a key that puts unstable outages first, then those with points that were not judged."""
    _, growth, damping = _rank(row.worst) if row.worst else (True, 0.0, np.inf)
    return not row.unstable, not (row.unstable or row.unjudged), growth, damping


def load_of(plan: ScreeningPlan, point: OperatingCase) -> float:
    """Active power of all loads at a point [MW]."""
    elements = Elements.of(plan.prepared)
    grid = plan.prepared.system.components[elements.grid]

    def number(name: str) -> float:
        return float(point.values.get(f"{elements.grid}.{name}", grid.number(name)))

    return sum(
        number(f"{x}.scale") * number(f"{x}.P") for x in elements.loads if x not in point.out
    )


@dataclass(frozen=True)
class _Property:
    """A property that items have in common, in words, and a test for it."""

    text: str
    holds: Callable[[ScreenedItem], bool]


def not_judged(summary: Summary) -> str:
    """How many items have no modes, and what two or more of them have in common that no judged item has."""
    items = list(summary.failures())
    if not items:
        return ""
    kinds = ", ".join(
        f"{number} {status}" for status, number in Counter(i.record.status for i in items).items()
    )
    common = _cause(summary, items) if len(items) > 1 else ""
    return f"{len(items)} not judged ({kinds})" + (f", all {common}" if common else "")


def _cause(summary: Summary, items: Sequence[ScreenedItem]) -> str:
    """The outage or the load, else both, that separate items from all judged ones; "" if they do not."""
    judged = [x for x in summary.result.items if x.record.status is Status.COMPUTED]
    found = [one for one in (_out(summary, items), _loading(summary, items)) if one]
    for one in found:
        if not any(map(one.holds, judged)):
            return one.text
    if any(all(one.holds(item) for one in found) for item in judged):
        return ""
    return " ".join(one.text for one in found)


def _out(summary: Summary, items: Sequence[ScreenedItem]) -> _Property | None:
    elements = Elements.of(summary.result.plan.prepared)
    names = {item.outage.name for item in items}
    if len(names) == 1:
        (name,) = names
        text = _without(items[0].outage) if items[0].outage.elements else "of the intact network"
        return _Property(text, lambda item: item.outage.name == name)
    for kind, known in (
        ("unit", set(elements.units)),
        ("line or transformer", set(elements.lines)),
    ):
        if all(known & set(item.outage.elements) for item in items):
            return _Property(f"with a {kind} out", _takes(known))
    return None


def _without(outage: Outage) -> str:
    """Return in words what is missing: ``with line_1_2 out``, ``with line_1_2 open at bus_1``."""
    (only, *others) = outage.elements
    end = None if others else LineEnd.of(only)
    return f"with {outage.name} out" if end is None else f"with {end.line} open at {end.bus}"


def _takes(known: set[str]) -> Callable[[ScreenedItem], bool]:
    return lambda item: not known.isdisjoint(item.outage.elements)


def _loading(summary: Summary, items: Sequence[ScreenedItem]) -> _Property | None:
    plan = summary.result.plan
    loads = {point.name: load_of(plan, point) for point in plan.points}
    points = {item.point.name for item in items}
    if len(loads) == 2 and len(points) == 1:
        (name,) = points
        return _Property(f"at {name}", lambda item: item.point.name == name)
    middle, here = float(np.median(list(loads.values()))), [loads[name] for name in points]
    least, most = min(here), max(here)
    if least > middle:
        text = f"at high load (from {least:.4g} MW on; half of the points have at most {middle:.4g} MW)"
        return _Property(text, lambda item: loads[item.point.name] >= least)
    if most < middle:
        text = (
            f"at low load (up to {most:.4g} MW; half of the points have at least {middle:.4g} MW)"
        )
        return _Property(text, lambda item: loads[item.point.name] <= most)
    return None


def verdict_sentence(summary: Summary) -> str:
    return str(verdict_of(summary))


def verdict_of(summary: Summary) -> VerdictSentence:
    total, planned = len(summary.result.items), summary.result.plan.number_of_items
    if summary.unstable:
        drifting = [item for item in summary.unstable if only_drifts(item.record)]
        if len(drifting) == len(summary.unstable):
            return _drift_alone(summary)
        worst = min(summary.unstable, key=_rank)
        at = f"at {counted_items(len(summary.unstable), total, planned)}; worst: {where(summary, worst)}"
        rest = f"; at {len(drifting)} of them only the common speed drifts" if drifting else ""
        text = f"{at}{_least(worst)}{rest}{_told_beside(summary)}"
        return VerdictSentence(False, "UNSTABLE", text)
    if summary.gone_wrong:
        text = f"in {len(summary.gone_wrong)} of {len(summary.runs)} runs of outages, though no mode grows"
        lost = "".join(
            f"; {text}" for text in (runs_sentence(summary), not_judged(summary)) if text
        )
        return VerdictSentence(False, "UNSTABLE", f"{text}{lost}")
    computed = summary.counts[Status.COMPUTED]
    tail = _least_of_all(summary)
    if summary.free:
        first = summary.free[0]
        zeros = zeros_in_words(first.record.zeros)
        tail += f"; at {len(summary.free)} of them, first at {where(summary, first)}, {zeros}"
    ran = runs_sentence(summary)
    tail += "".join(f"; {text}" for text in (ran, summary.beyond, _widened(summary)) if text)
    if summary.stable:
        text = f"nothing grows at {all_items(total, 'any of')}{_but_slowly(summary)}{tail}"
        return VerdictSentence(True, "stable", text)
    left = planned - total
    text = not_judged(summary)
    missing = [text] if text else []
    missing += [f"{left} not computed yet"] if left else []
    uncounted = computed - summary.counted_items
    if uncounted:
        wanted = summary.result.plan.wanted
        missing.append(
            f"{uncounted} were searched only from {wanted.lowest_hz:g} to {wanted.highest_hz:g} Hz above -30 % damping "
            "(--whole counts all growth)"
        )
    doubtful = sum(
        item.record.stable is None and item.record.counted for item in summary.result.items
    )
    missing += [f"{doubtful} stand at the edge of a limit"] if doubtful else []
    tripping = len(summary.tripping)
    missing += [f"what relays leave at {tripping} of them is not judged"] if tripping else []
    known = f"nothing grows at {counted_items(computed, total, planned)}, but " if computed else ""
    return VerdictSentence(None, "not known", f"{known}{', '.join(missing)}{tail}")


def _drift_alone(summary: Summary) -> VerdictSentence:
    """The verdict where the drift of the common speed is all that grows: the swings are judged apart from it."""
    total, planned = len(summary.result.items), summary.result.plan.number_of_items
    fastest = max(summary.unstable, key=lambda item: _fastest_growth(item.record))
    rate, at = _fastest_growth(fastest.record), counted_items(len(summary.unstable), total, planned)
    most = f", the fastest {where(summary, fastest)}" if len(summary.unstable) > 1 else ""
    text = f"at {at}: {drift_in_words(rate)}{most}{_least_of_all(summary)}{_told_beside(summary)}"
    return VerdictSentence(False, "UNSTABLE", text)


def _told_beside(summary: Summary) -> str:
    """Tell behind growth of items that were not judged, of runs, of swings above the range and of widened limits."""
    told = (not_judged(summary), runs_sentence(summary), summary.beyond, _widened(summary))
    return "".join(f"; {text}" for text in told if text)


def _widened(summary: Summary) -> str:
    """At how many items limits were widened, of which units; "" where none was."""
    items = summary.widened
    if not items:
        return ""
    units = {one.name.partition(".")[0]: None for item in items for one in item.record.widenings}
    judged = summary.counts[Status.COMPUTED]
    at = counted_items(len(items), judged)
    return f"at {at} a limit is widened to what the point asks for ({few(units, _NAMED)})"


def question_of_widenings(summary: Summary) -> str:
    """Ask about the limits that items were computed without, and give the values that answer it; "" where none was."""
    items = summary.widened
    if not items:
        return ""
    each = widest(one for item in items for one in item.record.widenings)
    told = few(map(str, each.values()), _NAMED)
    typed = Text("")
    for name, one in each.items():
        typed += " " + Option.SET + f" {name}={one.taken:g}"
    at = f"{len(items)} of {len(summary.result.items)}, first {where(summary, items[0])}"
    return Text(
        f"question: at {at}, the point asks more of an exciter or governor than its limit gives: {told}. Their modes "
        f"are computed with the limit {HEADROOM:g} pu beyond the start; PSS/E would warn of suspect initial conditions "
        "and drift to the limit, where that loop is open and the voltage or the power is not held: ",
        Option.TRIPS + " '10 s'",
        " runs these outages with the limits as they are; is a limit wrong in the data? If the wider ones are meant, "
        "type",
        typed,
    )


def _least_of_all(summary: Summary) -> str:
    """Tell the least damped critical mode, and a swing of machines above the range that is damped less."""
    wanted, above = summary.result.plan.wanted, summary.least_above()
    least = next(iter(summary.least_damped()), None)
    text = f"{where(summary, least.item)}{_least(least.item)}" if least else ""
    if above is None or above.damping >= (least.damping if least else 100 * wanted.damping):
        return f"; least damped: {text}" if text else ""
    figures = f"{above.frequency:.3f} Hz, {above.damping:.2f} % ({above.who})"
    told = f"{where(summary, above.item)}: {figures}"
    end = f"{wanted.highest_hz:g} Hz"
    if not text:
        return f"; least damped, above {end}: {told}"
    return f"; least damped up to {end}: {text}, and LESS above: {told}"


def what_was_counted(summary: Summary) -> str:
    wanted, computed = summary.result.plan.wanted, summary.counts[Status.COMPUTED]
    searched = sum(item.record.searched for item in summary.result.items)
    others = (
        ", at the others from those of a neighbour, with a check that none is missed"
        if searched < computed
        else ""
    )
    large = (
        f": in a system of more than {DENSE} states, such as this, what grows faster than {GROWING:g} 1/s, or near 0"
        if summary.slowest
        else ""
    )
    one = summary.result.plan.number_of_items == 1
    counted = f"{summary.counted_items} of {computed}"
    if one:
        counted = "it as well" if summary.counted_items else "no point"
    return (
        f"Scenario {summary.result.plan.prepared.name}: modes from {wanted.lowest_hz:g} to {wanted.highest_hz:g} Hz "
        f"below {100 * wanted.damping:g} % damping, of the {_what_was_linearised(summary)}: "
        f"found anew at {ONE_ITEM if one else counted_items(searched, computed)}"
        f"{others}. Whether something grows at other frequencies was counted at "
        f"{counted}{large}.{_outages_not_asked(summary)}"
    )


def above_the_range(summary: Summary) -> str:
    """Tell of the least damped swing of machines above the range, or that none was looked for; "" where all is said.

    The range's default ends where large machines' swings end: small ones' lie above, and may hardly be damped."""
    plan = summary.result.plan
    wanted = plan.wanted
    items = [one for one in summary.result.items if one.record.status is Status.COMPUTED]
    if wanted.highest_hz >= LOCAL_HZ or not items:
        return ""
    typed = Option.RANGE + f" {wanted.lowest_hz:g}:{LOCAL_HZ:g}"
    least = summary.least_above()
    if least is not None and least.damping < 100 * wanted.damping:
        return (
            f"Not judged: above the range a machine swings: {where(summary, least.item)}: {least.frequency:.3f} Hz, "
            f"{least.damping:.2f} % ({least.who}); {typed} holds it."
        )
    if all(one.record.looked_above for one in items) or not _has_machines(plan):
        return ""
    return (
        f"Not judged: swings of machines from {wanted.highest_hz:g} to {LOCAL_HZ:g} Hz were not looked for; "
        f"{typed} does."
    )


def _has_machines(plan: ScreeningPlan) -> bool:
    """Tell whether a component has one of the states that swing with machines."""
    speeds = plan.prepared.case.table.analysis.swing
    names = (
        f"{name}.{variable}"
        for name, component in plan.prepared.system.components.items()
        for variable in component.description.variables
    )
    return any(fnmatch.fnmatchcase(name, speed) for name in names for speed in speeds)


def _outages_not_asked(summary: Summary) -> str:
    """Say that only the intact network was looked at, which else reads as if each outage were harmless."""
    if len(summary.result.plan.outages) > 1:
        return ""
    typed = command("screen CASE", (Option.OUTAGES, "n-1"))
    return f" No outage was asked for; {typed} takes each line and each unit out."


def _what_was_linearised(summary: Summary) -> str:
    step = summary.result.plan.prepared.step_size
    computed = [
        item.record.map_steps
        for item in summary.result.items
        if item.record.status is Status.COMPUTED
    ]
    found = []
    for steps, number in sorted(Counter(computed).items()):
        which = "map over a communication step" if steps else "system without a communication step"
        if steps > 1:
            which = f"map over {steps} communication steps ({steps * step:g} s), after which sampled controllers repeat"
        found.append(
            which if number == len(computed) else f"{which} at {number} of {len(computed)} items"
        )
    return ", of the ".join(found) or "system without a communication step"


def _but_slowly(summary: Summary) -> str:
    """Return what growth a stable verdict does not exclude; "" where all eigenvalues are known."""
    if not summary.slowest:
        return ""
    wanted = summary.result.plan.wanted
    return (
        f", but what grows slower than {summary.slowest:g} 1/s outside of {wanted.lowest_hz:g} to "
        f"{wanted.highest_hz:g} Hz is seen near 0 Hz only"
    )


def _least(item: ScreenedItem) -> str:
    """Tell the least damped critical mode, unless it is damped and another grows, and what grows beside it."""
    outside = "" if only_drifts(item.record) else growth_outside(item.record)
    one = least_of(item)
    parts = [outside] if outside else []
    if one is not None and (one.damping < 0 or not outside):
        parts.insert(0, mode_in_words(one.value, one.participation()))
    return f": {', and '.join(parts)}" if parts else ""


def growth_outside(record: ItemRecord) -> str:
    """Tell what grows beside the critical modes, how fast if known, and at which frequency; "" if nothing does."""
    number, fastest = _growing(record)
    if not number:
        return ""
    text = f"{number} eigenvalue{'s grow' if number > 1 else ' grows'} outside of the range"
    if fastest is None:
        return f"{text}; `gfor modes` shows how fast"
    rate = _rate(fastest, drifts=record.drifts)
    return f"{text}, {'the fastest ' if number > 2 else ''}by {rate}"


def growth_in_short(record: ItemRecord) -> str:
    """The same in a cell: the fastest alone."""
    number, fastest = _growing(record)
    if not number:
        return ""
    if fastest is None:
        return "how fast is not known"
    return f"+{_rate(fastest, drifts=record.drifts)}"


def only_drifts(record: ItemRecord) -> bool:
    """Return whether the drift of the common speed is all that grows, so that every swing is damped."""
    swings = record.eigenvalues[list(record.critical)]
    return record.drifts and _growing(record)[0] == 1 and not (swings.real > UNSTABLE).any()


def _growing(record: ItemRecord) -> tuple[int, complex | None]:
    """Number of eigenvalues that grow beside the critical modes, and the fastest; None where they were only counted."""
    followed = np.delete(record.eigenvalues, record.critical)
    known = followed[followed.real > UNSTABLE].tolist()
    number = record.growing_elsewhere + 2 * len(known)
    if record.fastest is not None:
        known.append(complex(*record.fastest))
    elif record.growing_elsewhere:
        return number, None
    return number, max(known, key=lambda value: value.real, default=None)


def _rate(value: complex, *, drifts: bool) -> str:
    if drifts:
        return f"{value.real:.3g} 1/s: the common speed"
    at = f"at {value.imag / (2 * np.pi):.3g} Hz" if value.imag else "without an oscillation"
    return f"{value.real:.3g} 1/s {at}"
