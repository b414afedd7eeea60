"""A design over operating points in words and tables."""

from collections import Counter

from orchestrator.core.errors import few
from orchestrator.linear.spectra.stability import zeros_in_words
from orchestrator.output.report.short_texts import kinds_of
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.coordinated_design.objective import APART
from orchestrator.studies.coordinated_design.study import PointsDesign
from orchestrator.studies.coordinated_design.verdict import MORE, PointsVerdict
from orchestrator.studies.operating_points.words import all_items, counted_items

_SHOWN = 4
_AT_BOUND = 1e-2  # part of the largest gain within which one stands at it


def verdict_sentence(verdict: PointsVerdict) -> str:
    """The verdict on all points and outages in one sentence; the first word says it."""
    return str(verdict_of(verdict))


def verdict_of(verdict: PointsVerdict) -> VerdictSentence:
    total, wanted = len(verdict.points), verdict.wanted
    limiting, worst = verdict.limiting, verdict.worst
    if limiting is None or limiting.target is None or worst is None:
        tail = "; no mode to be damped is left from 0.1 to 2 Hz" if verdict.known else ""
    else:
        unmoved = ", which these controllers hardly move" if limiting.unmoved else ""
        which = " of the modes that these controllers move" if verdict.some_apart else ""
        if verdict.names:
            which = f" of {few(verdict.names, _SHOWN)}"
        tail = f"; least damped{which}: {limiting.where}: {limiting.target.words}{unmoved}"
    tail += _of_all_modes(verdict)
    aim = "" if wanted is None else f"{100 * wanted:g} % at {all_items(total)}"
    if verdict.met and wanted is not None:
        return _reached(verdict, wanted, aim, tail)
    tail += _standing_apart(verdict)
    if aim and verdict.apart:
        aim += ", of the modes that these controllers move"
    if verdict.met:
        return VerdictSentence(True, "better", f"{_least_of_points(verdict)}{tail}")
    reasons = _reasons(verdict)
    if verdict.met is None:
        return VerdictSentence(None, "not known", f"{', '.join(reasons)}{tail}")
    word = "NOT REACHED" if wanted is not None else "NO BETTER"
    if wanted is None:
        reasons.insert(0, _least_of_points(verdict))
    short = wanted is not None and worst is not None and worst < wanted
    beyond = (
        f"; {_cannot_be_had(verdict, worst)}"
        if short and worst is not None and not verdict.astray
        else ""
    )
    return VerdictSentence(False, word, f"{', '.join([aim] * bool(aim) + reasons)}{beyond}{tail}")


def _reached(verdict: PointsVerdict, wanted: float, aim: str, tail: str) -> VerdictSentence:
    """The verdict where what is wanted is there; its word also says for which modes it is not."""
    before, below = verdict.worst_before, verdict.below
    held = before is not None and before >= wanted
    word = "HELD WITHOUT THE CONTROLLERS ALREADY" if held else "REACHED"
    reason = ""
    if below is not None:
        point, mode = below
        word += (
            " for the named modes, NOT REACHED for others"
            if verdict.names
            else " for the modes that these controllers move, NOT REACHED for others"
        )
        reason = f"{point.where}: {mode.words} is below {100 * wanted:g} %; "
    if held and before is not None:
        reason += f"{100 * before:.2f} % without any gain; "
    rest = f"{tail}{_standing_apart(verdict)}{_no_margin(verdict.thin, wanted)}"
    return VerdictSentence(True if below is None else None, word, f"{reason}{aim}{rest}")


def _least_of_points(verdict: PointsVerdict) -> str:
    """The least damping of all points before, and the point where it became lower: each with its mode."""
    before, total = verdict.limiting_before, len(verdict.points)
    text = f"the least damping of {all_items(total)}"
    if before is not None and before.target_before is not None:
        text += f" was that of {before.where}: {before.target_before.words}"
    if not verdict.lowered:
        return text
    first = verdict.lowered[0]
    assert first.target_before is not None
    assert first.target is not None
    return (
        f"{text}; LOWER than before at {len(verdict.lowered)} of them, most at {first.where}: "
        f"{first.target_before.words} before, {first.target.words} now"
    )


def _of_all_modes(verdict: PointsVerdict) -> str:
    """The least damped of all modes, beside those that the design damps where these are not all."""
    before, after = verdict.least_before, verdict.least
    if not (verdict.names or verdict.some_apart) or after is None or after.least is None:
        return ""
    without = ""
    if before is not None and before.least_before is not None:
        without = f"; without the controllers: {before.where}: {before.least_before.words}"
    return f"; of all modes: {after.where}: {after.least.words}{without}"


def _standing_apart(verdict: PointsVerdict) -> str:
    """The modes below the aim that these controllers do not move."""
    if not verdict.apart:
        return ""
    point, mode = verdict.apart[0]
    places = len({id(one) for one, _ in verdict.apart})
    bound = f"less than {100 * APART:.1g} points with K ≤ {verdict.largest:g} pu"
    return (
        f"; apart, at {counted_items(places, len(verdict.points))}, stand modes that these controllers move by "
        f"{bound}; the least damped: {point.where}: {mode.words}"
    )


def _no_margin(thin: float | None, wanted: float) -> str:
    if thin is None:
        return ""
    why = (
        f"{100 * thin:.2f} %"
        if thin < wanted
        else "another mode below its least damping, or growth,"
    )
    return f"; no margin: {why} with gains of × {MORE:g}"


def _cannot_be_had(verdict: PointsVerdict, worst: float) -> str:
    """Tell what is known of how much can be had; that it cannot be had is said where settings were tried one by one."""
    best = f"best {100 * worst:.2f} %"
    if not verdict.compared:
        return f"{best} (found by a search; no grid of settings was compared)"
    return (
        f"it CANNOT be had with K ≤ {verdict.largest:g} pu: {best}, the better of a search and a grid of "
        f"{verdict.compared} settings"
    )


def _reasons(verdict: PointsVerdict) -> list[str]:
    total, reasons = len(verdict.points), []
    if verdict.unstable:
        first = verdict.unstable[0]
        named = f"the first: {first.where} ({first.after.rightmost})"
        reasons.append(f"UNSTABLE at {len(verdict.unstable)} of {total}, {named}")
    if verdict.harmed:
        worst = max(verdict.harmed, key=lambda point: point.worth.breach if point.worth else 0.0)
        mode = f": {worst.other.words}" if worst.other is not None and not worst.grows else ""
        reasons.append(
            f"other modes are harmed at {len(verdict.harmed)} of {total}, most at {worst.where}{mode}"
        )
    if verdict.failed:
        counts = Counter(
            str((p.before if not p.before.computed else p.after).status) for p in verdict.failed
        )
        said = ", ".join(f"{number} {status}" for status, number in counts.items())
        reasons.append(f"{len(verdict.failed)} of {total} have no modes ({said})")
    if verdict.doubtful:
        reasons.append(f"{len(verdict.doubtful)} of {total} stand at the edge of a limit")
    return reasons


def what_it_rests_on(design: PointsDesign) -> str:
    request, steps = design.plan.request, design.found.steps
    modes = (
        "all modes from 0.1 to 2 Hz"
        if not request.modes
        else "the modes " + ", ".join(request.modes)
    )
    modes += "" if request.modes else ", save those that the controllers do not move"
    return (
        f"Damped: {modes}. No other mode may fall below {100 * request.least_damping:g} % or, where the least of its "
        f"band of frequencies is there already, below that less 0.1 points. Gains from {request.gain_bounds[0]:g} to "
        f"{request.gain_bounds[1]:g} pu. The search computed all points {design.evaluations} times on linear models; "
        f"the best came from {steps} linear programs. The figures are those of power flow, steady state and "
        "eigenvalues computed anew at every point, of the system without a communication step."
    )


def about_settings(design: PointsDesign) -> list[str]:
    """Controllers that were left out, and gains that stand at their bound."""
    largest = design.plan.request.gain_bounds[1]
    texts = [text for group, _ in design.used for text in group.remarks]
    if design.left_out:
        names = ", ".join(group.name for group in design.left_out)
        texts.append(f"left out, as they bring less than 0.01 points of damping: {names}")
    texts += [
        f"the gain of {group.name} stands at its bound, {largest:g} pu: a larger one may give more; see --gain-bounds"
        for group, setting in design.used
        if setting.gain >= (1 - _AT_BOUND) * largest
    ]
    return texts


def remarks(verdict: PointsVerdict) -> list[str]:
    total, texts = len(verdict.points), []
    if verdict.failed:
        texts.append(f"{len(verdict.failed)} of {total} have no modes:")
        texts += [f"  {point.where}: {point.why_not}" for point in verdict.failed[:_SHOWN]]
        texts += [f"  … and {len(verdict.failed) - _SHOWN} more, in the files"] * (
            len(verdict.failed) > _SHOWN
        )
    if verdict.astray:
        worst = verdict.astray[0]
        assert worst.predicted is not None
        assert worst.worth is not None
        texts.append(
            f"the search was led astray: at {len(verdict.astray)} of {total} its linear models were wrong, most at "
            f"{worst.where}, where they expected {100 * worst.predicted.worst:.2f} % and "
            f"{100 * worst.worth.worst:.2f} % came out"
        )
    if verdict.unforeseen:
        place = verdict.unforeseen[0].where
        texts.append(
            f"the search was led astray: at {len(verdict.unforeseen)} of {total}, first at {place}, its linear models "
            "showed no harm to other modes, and there is; give a lower upper end of --gain-bounds, or fewer controllers"
        )
    left = [point for point in verdict.known if point.left]
    if left:
        mode = left[0].left[0]
        texts.append(
            f"at {len(left)} of {total}, first at {left[0].where}, the controllers move a mode out of 0.1 to 2 Hz, to "
            f"{mode.words}; it counts as before"
        )
    free = [point for point in verdict.known if point.after.zeros > 1]
    if free:
        texts.append(
            f"at {len(free)} of {total}, first at {free[0].where}: {zeros_in_words(free[0].after.zeros)}"
        )
    unnamed = [point for point in verdict.known if point.unnamed]
    if unnamed:
        texts.append(
            f"at {len(unnamed)} of {total}, first at {unnamed[0].where}: a name that is asked for is borne by no mode, "
            "or its mode meets another one while the gains grow, so all modes from 0.1 to 2 Hz count there"
        )
    kinds = kinds_of((point, point.after.warnings) for point in verdict.known)
    return [
        *texts,
        *(f"at {len(x)} of {total}, first at {x[0].where}: {text}" for text, x in kinds[:_SHOWN]),
    ]
