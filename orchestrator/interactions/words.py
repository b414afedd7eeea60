"""What a study of interactions says, in sentences."""

from orchestrator.interactions.judgement import Judgement, place_of, plan_text, why_unknown
from orchestrator.interactions.point import SystemRecord

_SHOWN = 3


def verdict_word(record: SystemRecord) -> str:
    """``stable``, ``UNSTABLE`` or ``not known``."""
    return {True: "stable", False: "UNSTABLE", None: "not known"}[record.stable]


def damping_text(record: SystemRecord) -> str:
    """The least damping of a system [%]: ``7.81``; ``–`` where it was not computed, ``none`` where nothing swings."""
    if record.least_damping is None:
        return "–"
    return "none" if record.critical is None else f"{record.least_damping:.2f}"


def frequency_text(record: SystemRecord) -> str:
    """The frequency of the least damped mode."""
    return "" if record.critical is None else place_of(record.critical)


def whole_sentence(judgement: Judgement) -> str:
    """The verdict on the system as it is."""
    whole = judgement.whole
    if whole.error is not None:
        return f"not known: {whole.error}"
    return str(whole.stability["sentence"])


def modes_sentence(judgement: Judgement) -> str:
    """How many modes vendors share."""
    plan, found = judgement.result.plan, judgement.interaction_modes
    low, high = plan.request.frequency_range
    percent = f"{100 * plan.request.threshold:g} %"
    head = f"{len(found)} of {len(judgement.modes)} modes from {low:g} to {high:g} Hz are shared"
    tail = f" by two vendors or more, with {percent} each at least"
    if not found:
        return head + tail
    shown = [f"{place_of(m.mode)} ({', '.join(m.vendors)})" for m in found[:_SHOWN]]
    return f"{head}{tail}: {'; '.join(shown)}{'; …' if len(found) > _SHOWN else ''}"


def pairs_sentence(judgement: Judgement) -> str:
    """Which pair is the worst."""
    plan = judgement.result.plan
    if len(plan.vendors) < 2:
        return f"one vendor, {plan.vendors[0]}: there is no pair"
    worst, unknown = judgement.worst_pair, judgement.unknown_pairs
    known = len(judgement.pairs) - len(unknown)
    rest = "" if not unknown else f"; not known: {', '.join(pair.text for pair in unknown)}"
    if worst is not None:
        among = f" of {known} pairs" if known > 1 else ""
        return f"worst pair{among}: {worst.sentence()}{rest}"
    if not known:
        return f"worst pair: not known: {'; '.join(pair.sentence() for pair in unknown)}"
    return f"no worst pair: none of {known} is damped less together than each alone{rest}"


def swap_sentence(judgement: Judgement) -> str:
    """Which assignment is the worst; empty without a swap."""
    swapped, found = judgement.result.plan.swapped, judgement.assignments
    if not swapped:
        return ""
    worst, unknown = judgement.worst_assignment, judgement.unknown_assignments
    if worst is None:
        return f"worst assignment: not known: {why_unknown(found[0][1])}"
    name, record = worst
    grows = sum(one.stable is False for _, one in found)
    counted = f"{grows} of {len(found)} are UNSTABLE" if grows else f"none of {len(found)} is UNSTABLE"
    rest = f", {len(unknown)} have no verdict" if unknown else ""
    figure = f"least damping {damping_text(record)} %{', ' if record.critical else ''}{frequency_text(record)}"
    return f"worst assignment: {plan_text(swapped, name)}: {verdict_word(record)}, {figure}; {counted}{rest}"


def stand_in_sentence(judgement: Judgement) -> str:
    """What stands at the places of the vendors that a system does without."""
    plan = judgement.result.plan
    return f"at the places of the vendors that a system does without stands {plan.stand_in}, at the same power flow"


def sentences(judgement: Judgement) -> list[str]:
    """All of them, the verdict on the system as it is first."""
    every = [
        whole_sentence(judgement), modes_sentence(judgement), pairs_sentence(judgement), swap_sentence(judgement),
        stand_in_sentence(judgement),
    ]  # fmt: skip
    return [text for text in every if text]
