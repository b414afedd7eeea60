"""Sentences of a study of interactions."""

from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.interactions.judgement import (
    JudgedInteractions,
    JudgedSystem,
    place_of,
    plan_text,
)

_SHOWN = 3


def verdict_word(system: JudgedSystem) -> str:
    return {True: "stable", False: "UNSTABLE", None: "not known"}[system.stable]


def damping_text(system: JudgedSystem) -> str:
    """The least damping of a system [%]: ``7.81``; ``–`` where it was not computed, ``none`` where no mode counts."""
    if system.least_damping is None:
        return "–"
    return "none" if system.critical is None else f"{system.least_damping:.2f}"


def frequency_text(system: JudgedSystem) -> str:
    return "" if system.critical is None else place_of(system.critical)


def verdict_of(judgement: JudgedInteractions) -> VerdictSentence:
    whole = judgement.whole.record
    return VerdictSentence(
        whole.stable, verdict_word(judgement.whole), whole.error or whole.because
    )


def modes_sentence(judgement: JudgedInteractions) -> str:
    plan, found = judgement.result.plan, judgement.interaction_modes
    low, high = plan.request.frequencies
    percent = f"{100 * plan.request.threshold:g} %"
    head = f"{len(found)} of {len(judgement.modes)} modes from {low:g} to {high:g} Hz are shared"
    tail = f" by two vendors or more, with {percent} each at least"
    if not found:
        return head + tail
    shown = [f"{place_of(m.mode)} ({', '.join(m.vendors)})" for m in found[:_SHOWN]]
    return f"{head}{tail}: {'; '.join(shown)}{'; …' if len(found) > _SHOWN else ''}"


def alone_sentence(judgement: JudgedInteractions) -> str:
    found = [
        (vendor, system) for vendor, system in judgement.alone.items() if system.stable is False
    ]
    if not found:
        return ""
    shown = [f"{vendor}, {damping_text(one)} % at {frequency_text(one)}" for vendor, one in found]
    return f"UNSTABLE without the other vendors: {'; '.join(shown)}"


def pairs_sentence(judgement: JudgedInteractions) -> str:
    plan = judgement.result.plan
    if len(plan.vendors) < 2:
        return f"one vendor, {plan.vendors[0]}: there is no pair"
    worst, unknown = judgement.worst_pair, judgement.unknown_pairs
    known = len(judgement.pairs) - len(unknown)
    rest = "" if not unknown else f"; not known: {', '.join(pair.text for pair in unknown)}"
    grow = [pair.text for pair in judgement.pairs if pair.joint.stable is False]
    rest = (
        f"; UNSTABLE: {', '.join(grow)}{rest}"
        if grow and (worst is None or len(grow) > 1)
        else rest
    )
    least = judgement.least_damped_pair
    if (
        least is not None
        and least is not worst
        and len(judgement.pairs) > 1
        and least.joint.stable is not False
    ):
        where = f"{damping_text(least.joint)} % at {frequency_text(least.joint)}"
        rest = f"; the least damped pair is {least.text}, {where}{rest}"
    if worst is not None:
        among = f" of {known} pairs" if known > 1 else ""
        return f"worst pair{among}: {worst.sentence()}{rest}"
    if not known:
        return f"worst pair: not known: {'; '.join(pair.sentence() for pair in unknown)}"
    apart = [pair.sentence() for pair in judgement.uncompared_pairs]
    if apart:
        return f"worst pair: not known: {'; '.join(apart)}{rest}"
    if len(judgement.pairs) == 1:
        return f"no worst pair: {judgement.pairs[0].sentence()}{rest}"
    return (
        f"no worst pair: no mode of {known} pairs is damped less together than with one alone{rest}"
    )


def swap_sentence(judgement: JudgedInteractions) -> str:
    swapped, found = judgement.result.plan.swapped, judgement.assignments
    if not swapped:
        return ""
    worst, unknown = judgement.worst_assignment, [one for one in found if not one.is_known]
    if worst is None:
        return f"worst assignment: not known: {found[0].why_unknown}"
    grows = sum(one.stable is False for one in found)
    counted = (
        f"{grows} of {len(found)} are UNSTABLE" if grows else f"none of {len(found)} is UNSTABLE"
    )
    have = "has" if len(unknown) == 1 else "have"
    rest = f", {len(unknown)} {have} no verdict" if unknown else ""
    figure = f"least damping {damping_text(worst)} %{', ' if worst.critical else ''}{frequency_text(worst)}"
    return f"worst assignment: {plan_text(swapped, worst.name)}: {verdict_word(worst)}, {figure}; {counted}{rest}"


def stand_in_sentence(judgement: JudgedInteractions) -> str:
    plan = judgement.result.plan
    return (
        f"{plan.stand_in} stands in for the vendors that a system does without, at the same power flow; a mode counts "
        f"if vendors' converters hold {100 * plan.request.threshold:g} % of it, or if it grows; that of a pair is "
        "followed to the systems with one vendor and with none, whatever share these hold there"
        + (", and those of the assignments to the worst one" if plan.swapped else "")
    )


def sentences(judgement: JudgedInteractions) -> list[str]:
    every = [
        str(verdict_of(judgement)),
        modes_sentence(judgement),
        alone_sentence(judgement),
        pairs_sentence(judgement),
        swap_sentence(judgement),
        stand_in_sentence(judgement),
    ]
    return [text for text in every if text]
