"""A screening in words: its verdict, and what it rests on."""

from collections import Counter

import numpy as np

from orchestrator.analysis.critical_modes import DENSE
from orchestrator.analysis.shifted_equations import GROWING
from orchestrator.analysis.stability import zeros_in_words
from orchestrator.operating_points.item import Status
from orchestrator.report.tables import VerdictSentence
from orchestrator.screening.modes import UNSTABLE
from orchestrator.screening.record import ItemRecord
from orchestrator.screening.stress import not_judged
from orchestrator.screening.study import ScreenedItem
from orchestrator.screening.summary import ModeAt, Summary


def verdict_sentence(summary: Summary) -> str:
    return str(verdict_of(summary))


def verdict_of(summary: Summary) -> VerdictSentence:
    total = len(summary.result.items)
    if summary.unstable:
        worst = summary.unstable[0]
        for one in summary.least_damped():
            if one.item.record.stable is False:
                worst = one.item
                break
        lost = "".join(f"; {text}" for text in (not_judged(summary), summary.beyond) if text)
        text = f"{_count(len(summary.unstable), 'item')} of {total}; worst: {where(worst)}{_least(worst)}{lost}"
        return VerdictSentence(False, "UNSTABLE", text)
    computed = summary.counts[Status.COMPUTED]
    least = summary.least_damped()[:1]
    tail = f"; least damped: {where(least[0].item)}{_least(least[0].item)}" if least else ""
    if summary.free:
        first = summary.free[0]
        tail += (
            f"; at {_count(len(summary.free), 'item')}, first at {where(first)}, {zeros_in_words(first.record.zeros)}"
        )
    tail += f"; {summary.beyond}" if summary.beyond else ""
    if summary.stable:
        text = f"nothing grows at any of {total} points and outages{_but_slowly(summary)}{tail}"
        return VerdictSentence(True, "stable", text)
    left = summary.result.plan.number_of_items - total
    missing = [text] if (text := not_judged(summary)) else []
    missing += [f"{left} not computed yet"] if left else []
    if uncounted := computed - summary.counted:
        wanted = summary.result.plan.wanted
        missing.append(
            f"{uncounted} were searched only from {wanted.lowest_hz:g} to {wanted.highest_hz:g} Hz above -30 % damping "
            "(--whole counts all growth)"
        )
    doubtful = sum(item.record.stable is None and item.record.counted for item in summary.result.items)
    missing += [f"{doubtful} stand at the edge of a limit"] if doubtful else []
    text = f"nothing grows at {computed} of {total} points and outages, but {', '.join(missing)}{tail}"
    return VerdictSentence(None, "not known", text)


def what_was_counted(summary: Summary) -> str:
    wanted, computed = summary.result.plan.wanted, summary.counts[Status.COMPUTED]
    searched = sum(item.record.searched for item in summary.result.items)
    others = ", the others from a neighbour with a check that no mode is missed there" if searched < computed else ""
    return (
        f"Scenario {summary.result.plan.prepared.name}: modes from {wanted.lowest_hz:g} to {wanted.highest_hz:g} Hz "
        f"below {100 * wanted.damping:g} % damping, of the "
        f"{_what_was_linearised(summary)}: {searched} of {computed} items were searched from scratch"
        f"{others}. Growth at other frequencies was counted at "
        f"{summary.counted} of {computed} items, in systems of more than {DENSE} states where it is faster than "
        f"{GROWING:g} 1/s, or near 0."
    )


def _what_was_linearised(summary: Summary) -> str:
    step = summary.result.plan.prepared.step_size
    computed = [item.record.map_steps for item in summary.result.items if item.record.status is Status.COMPUTED]
    found = []
    for steps, number in sorted(Counter(computed).items()):
        which = f"map over {steps} communication steps ({steps * step:g} s), after which sampled controllers repeat"
        which = (
            "map over a communication step" if steps == 1 else which if steps else "system without a communication step"
        )
        found.append(which if number == len(computed) else f"{which} at {number} of {len(computed)} items")
    return ", of the ".join(found) or "system without a communication step"


def _but_slowly(summary: Summary) -> str:
    """What growth a stable verdict does not exclude; "" where all eigenvalues are known."""
    if not summary.slowest:
        return ""
    wanted = summary.result.plan.wanted
    return (
        f", but what grows slower than {summary.slowest:g} 1/s outside of {wanted.lowest_hz:g} to "
        f"{wanted.highest_hz:g} Hz is seen near 0 Hz only"
    )


def where(item: ScreenedItem) -> str:
    return f"{item.point.name}, {item.outage.name}"


def _least(item: ScreenedItem) -> str:
    if outside := growth_outside(item.record):
        return f": {outside}"
    if not item.record.critical:
        return ""
    one = ModeAt(item, item.record.critical[0])
    who = ", ".join(f"{name} {share:.2f}" for name, share in one.participation(2))
    return f": {one.frequency:.3f} Hz, {one.damping:.2f} % ({who})"


def growth_outside(record: ItemRecord) -> str:
    """What grows beside the critical modes, how fast if that is known, and at which frequency; "" if nothing does."""
    followed = np.delete(record.eigenvalues, record.critical)
    known = followed[followed.real > UNSTABLE].tolist()
    number = record.growing_elsewhere + 2 * len(known)
    if not number:
        return ""
    text = f"{number} eigenvalue{'s grow' if number > 1 else ' grows'} outside of the range"
    if record.fastest is not None:
        known.append(complex(*record.fastest))
    elif record.growing_elsewhere:
        return f"{text}; `gfor modes` shows how fast"
    fastest = max(known, key=lambda value: value.real)
    at = f"at {fastest.imag / (2 * np.pi):.3g} Hz" if fastest.imag else "without an oscillation"
    return f"{text}, {'the fastest ' if number > 2 else ''}by {fastest.real:.3g} 1/s {at}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("s" if number != 1 else "")
