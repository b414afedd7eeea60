"""Checks of devices with three phases at voltages that are not balanced."""

from cmath import rect
from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, degrees, pi
from typing import Any

import numpy as np

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.phase_source import (
    SCR,
    X_R,
    Course,
    PhaseSource,
    at_ideal_source,
    of_phase_factors,
    omega_of,
    why_not,
)
from orchestrator.devices.acceptance.checks.port import (
    current_limit,
    present_current,
    without_start,
)
from orchestrator.devices.acceptance.checks.sequences import (
    PHASES,
    Ripple,
    SequencePair,
    cycles_of,
    lines_of,
    swap_b_and_c,
)
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.binding.misfits import NO_LIMIT

_ORDERED = 0.06  # time [s] for which the order of the phases is looked at
_FITS = 0.3  # distance from the power flow's current, in parts of it, within which an order fits

_NEGATIVE = 0.02
"""Negative sequence of the source at rest, in parts of its voltage.

EN 50160, 4.2.4: up to 2 % of the positive sequence, as means over 10 minutes, for 95 % of a week."""

_SETTLES = 0.8  # time [s] after which an answer is looked at, and over which
_LOOKED = 0.2
_GROWS = 1.5  # times as much negative sequence as the source has, or its current had a while before, that is amplified
_FAINT = 0.01  # change of that current [pu, S_n] below which it does not grow
_SWINGS = (
    0.05  # current at other frequencies [pu, S_n, r.m.s.] that swings, where it does not decay
)
_DECAYS = 0.5  # part of it that is left after 0.4 s where it does
_STILL = 1e-4  # negative sequence of a current [pu, S_n] that is none

# lines of an admittance, in fifths of the rated frequency: 10 to 300 Hz at 50 Hz. No line is another one's mirror in
# the network's frame, so that all are asked at once
_NEGATIVE_LINES = (1, 3, 4, 5, 8, 10, 12, 15, 20, 30)
_POSITIVE_LINES = (1, 3, 4, 8, 10, 12, 15, 20, 30)
_OF_RATED = 5
_LINE = 2e-3  # size of each line, in parts of the voltage
_ACTIVE = -0.02  # conductance [pu, S_n] from which on it feeds the negative sequence

_LASTS = 0.15  # duration of a fault [s], as in `limits`
_LONG = 0.5  # of a dip of one phase that does not take the voltage away
_REST = 0.6  # time [s] before the first event, and after each
_BACK = 0.3  # distance of the current from where it was [pu, S_n] from which it is not back
_GONE = 0.02  # current of a device that gives none [pu, S_n]
_ABOVE = 1.05  # part of a limit that a current may reach over a cycle

_STAYS_AT = 0.85
"""Positive sequence [pu] at which a device stays on, as in a balanced dip.

Commission Regulation (EU) 2016/631, article 16(2), for balanced voltages; for unbalanced faults it leaves the figure to
each transmission system operator (article 14(3)(b))."""

_SEEN = (
    0.02  # negative sequence [pu] of voltage and current from which the angle between them is one
)
_LEADS = (90.0, 100.0)
"""Angle [°] by which the negative sequence of the current leads that of the voltage.

IEEE 2800-2022, unbalanced faults, units behind a full converter; its size is left open. As quoted in Sandia's gap
analysis of the protection of grid-forming resources (2024); the standard's own text was not at hand."""


@check("phase_order", "Do its phases follow each other as a, b, c?")
def phase_order(subject: Subject) -> CheckResult:
    """Start it at a balanced voltage, and again with phases b and c exchanged in the voltage, the current or both."""
    because = why_not(subject)
    if because:
        return not_applicable("phase_order", because)
    if not subject.starts:
        return without_start("phase_order", subject)
    point, found = OperatingAt(), dict[tuple[bool, bool], float]()
    expected = (point.P - 1j * point.Q) / point.v
    for of_voltage in (False, True):
        course = _of_order(subject, point, of_voltage)
        if not np.isfinite(course.i).all():
            return failed("phase_order", "not a number", "its current is no number")
        for of_current in (False, True):
            last = slice(len(course.i) // 3, None)
            current = course.i[last]
            if of_current:
                current = swap_b_and_c(current, course.i_times[last], course.omega)
            found[of_voltage, of_current] = float(np.abs(current - expected).max() / abs(expected))
    seen = f"at a balanced voltage its current is {found[False, False]:.2g} of itself away from the power flow's"
    best = min(found, key=lambda order: found[order])
    if found[False, False] > _FITS and found[best] <= _FITS:
        what = " and ".join(
            word for word, turned in zip(("voltages", "currents"), best, strict=True) if turned
        )
        says = f"{seen}, and {found[best]:.2g} with phases b and c of its {what} exchanged"
        return failed("phase_order", "phases swapped", says, away=found[False, False])
    if found[False, False] > _FITS:
        return remarked(
            "phase_order",
            f"{seen}, in whichever order",
            "see what steady_state and power_balance say",
        )
    return passed("phase_order", seen, away=found[False, False])


def _of_order(subject: Subject, point: OperatingAt, of_voltage: bool) -> Course:
    """Its course at a balanced voltage; with phases b and c of it exchanged if that is asked for."""
    omega = omega_of(subject)
    assert omega is not None
    with subject.running(point=point) as running:
        return at_ideal_source(running, _ORDERED, {-2 * omega if of_voltage else 0.0: 1})


@dataclass(frozen=True)
class _Admittance:
    """Answers to small lines of one sequence [pu, S_n], by frequency [Hz]."""

    own: dict[float, complex]  # the current of the same sequence and frequency
    coupled: dict[float, float]  # size of the current at the mirror frequency of the other sequence

    @property
    def numbers(self) -> dict[str, list[float]]:
        """Real and imaginary parts by the frequency in Hz, for JSON."""
        return {f"{f:g}": [value.real, value.imag] for f, value in self.own.items()}


def _admittance(subject: Subject, *, negative: bool) -> _Admittance:
    """Lines of one sequence at an ideal source, all in one run.

    A line of negative sequence at f lies at −(f_n + f) in the network's frame, one of positive sequence at f − f_n."""
    omega = omega_of(subject)
    assert omega is not None
    chosen = _NEGATIVE_LINES if negative else _POSITIVE_LINES
    places = [-(line + _OF_RATED) if negative else line - _OF_RATED for line in chosen]
    rates = [place * omega / _OF_RATED for place in places]
    angles = subject.random(f"lines, {negative}").uniform(-pi, pi, len(rates))
    factors = {0.0: 1 + 0j} | {
        rate: rect(_LINE, angle) for rate, angle in zip(rates, angles, strict=True)
    }
    with subject.running() as running:
        course = at_ideal_source(running, _SETTLES + 2 * _LOOKED, factors)
    late = course.between(_SETTLES, _SETTLES + 2 * _LOOKED)
    every = [0.0, *rates, *(-rate for rate in rates)]
    volts, amperes = lines_of(late.v, late.v_times, every), lines_of(late.i, late.i_times, every)
    own, coupled = {}, {}
    for k, line in enumerate(chosen, start=1):
        value = -amperes[k] / volts[k]
        hertz = line * omega / (2 * pi * _OF_RATED)
        own[hertz] = complex(value.conjugate() if negative else value)
        coupled[hertz] = float(abs(amperes[k + len(rates)] / volts[k]))
    return _Admittance(own, coupled)


@check("negative_sequence", "What does it do with a negative sequence?", needs=("phase_order",))
def negative_sequence(subject: Subject) -> CheckResult:
    """Measure its admittance to both sequences, then give the source 2 % of negative sequence behind its impedance."""
    because = why_not(subject)
    if because:
        return not_applicable("negative_sequence", because)
    draw = subject.random("negative sequence")
    with subject.running() as running:
        source = PhaseSource(running)
        source.run(_REST)
        source.set_sequences(SequencePair(1, rect(_NEGATIVE, draw.uniform(-pi, pi))))
        course = source.run(_SETTLES + 2 * _LOOKED)
    if not np.isfinite(course.i).all():
        says = f"its current is no number with {100 * _NEGATIVE:g} % of negative sequence"
        return failed("negative_sequence", "not a number", says)
    early, before, late = (
        course.between(begin, begin + _LOOKED)
        for begin in (_LOOKED, _SETTLES / 2 + _LOOKED, _SETTLES + _LOOKED)
    )
    at_bus, current, ripple = late.voltage, late.current, late.ripple
    times = abs(at_bus.negative) / (_NEGATIVE * abs(source.E))
    moved = [
        abs(one.current.negative - other.current.negative)
        for one, other in ((before, early), (late, before))
    ]
    grows = moved[1] > max(moved[0], _FAINT) and abs(current.negative) > _GROWS * abs(
        before.current.negative
    )
    figures: dict[str, Any] = {
        "I_negative": abs(current.negative),
        "V_negative": abs(at_bus.negative),
        "amplified": times,
        "ripple_P": ripple.p,
        "ripple_Q": ripple.q,
    }
    seen = f"{100 * _NEGATIVE:g} % of negative sequence behind SCR {SCR:g} and X/R {X_R:g}: "
    seen += _words_of(at_bus, current, ripple)
    if times > _GROWS or grows:
        how = f"{times:.3g} times the source's stands at its bus"
        how += ", and its current grows more and more" if grows else ""
        fault = "amplifies the negative sequence"
        return failed("negative_sequence", fault, f"{how}; {seen}", **figures)
    if late.remainder > _SWINGS and late.remainder > _DECAYS * before.remainder:
        how = f"its current swings by {late.remainder:.3g} pu r.m.s. at other frequencies, and that does not decay"
        return failed("negative_sequence", "keeps moving", f"{how}; {seen}", **figures)
    return _judge_admittances(subject, seen, figures)


def _judge_admittances(subject: Subject, seen: str, figures: dict[str, Any]) -> CheckResult:
    """Measure the admittance to both sequences; a device that feeds the negative one at f_n is remarked on."""
    negative, positive = (_admittance(subject, negative=which) for which in (True, False))
    hertz = list(negative.own)[_NEGATIVE_LINES.index(_OF_RATED)]
    y = negative.own[hertz]
    figures |= {"Y_negative": negative.numbers, "Y_positive": positive.numbers}
    figures["coupling"] = {f"{f:g}": size for f, size in negative.coupled.items()}
    seen += f"; at {hertz:g} Hz Y₋ = {_of_complex(y)} pu of its rating{_as_impedance(y)}, and "
    seen += f"{negative.coupled[hertz]:.2g} pu of positive sequence at {3 * hertz:g} Hz"
    active = [f for f, value in negative.own.items() if value.real < _ACTIVE]
    if active:
        where = ", ".join(f"{f:g}" for f in active)
        least = min(negative.own[f].real for f in active)
        seen += f"; at {where} Hz it feeds the negative sequence, with a conductance down to {least:.3g} pu"
    if hertz in active:
        remedy = "a network that damps little swings with it: ask how its negative sequence is controlled"
        return remarked("negative_sequence", seen, remedy, **figures)
    return passed("negative_sequence", seen, **figures)


def _words_of(voltage: SequencePair, current: SequencePair, ripple: Ripple) -> str:
    """Both sequences in a sentence's words."""
    says = f"it gives {abs(current.negative):.3g} pu of negative sequence"
    if abs(current.negative) > _STILL:
        angle = _lead_of(voltage, current)
        way = "ahead of" if angle >= 0 else "behind"
        says += f", {abs(angle):.0f}° {way} the {abs(voltage.negative):.3g} pu at its bus"
    return f"{says}; its power swings by ±{ripple.p:.3g} pu of P and ±{ripple.q:.3g} pu of Q at twice the frequency"


def _lead_of(voltage: SequencePair, current: SequencePair) -> float:
    """Angle [°] by which the negative sequence of the current leads that of the voltage, −180 to 180."""
    turn = current.negative / voltage.negative
    return degrees(atan2(turn.imag, turn.real))


def _of_complex(value: complex) -> str:
    return f"{value.real:.3g} {'−' if value.imag < 0 else '+'} j{abs(value.imag):.3g}"


def _as_impedance(y: complex) -> str:
    """The impedance that such an admittance is; "" for one that takes hardly any current."""
    return f", as {_of_complex(1 / y)} pu in series" if abs(y) > _FITS else ""


@dataclass(frozen=True)
class _Event:
    """Factors on the phases of the source, for a while [s]."""

    name: str
    factors: tuple[complex, complex, complex]
    lasts: float = _LASTS

    @property
    def source(self) -> SequencePair:
        return of_phase_factors(self.factors)


def _events(draw: np.random.Generator) -> Iterator[_Event]:
    """Dips of one and of two phases, and jumps of one; phases, depths and angles are drawn."""

    def at(place: int, factor: complex, other: complex = 1) -> tuple[complex, complex, complex]:
        """One phase with a factor, and the two others with another one."""
        factors = [other] * 3
        factors[place] = factor
        return factors[0], factors[1], factors[2]

    def phase() -> int:
        return int(draw.integers(3))

    def others(place: int) -> str:
        return " and ".join(name for k, name in enumerate(PHASES) if k != place)

    for least, most, lasts in ((0.6, 0.75, _LONG), (0.0, 0.2, _LASTS)):
        place, to = phase(), round(draw.uniform(least, most), 3)
        yield _Event(f"dip of phase {PHASES[place]} to {to:g} pu", at(place, to), lasts)
    place, angle = phase(), draw.choice((-1, 1)) * round(draw.uniform(30, 60), 1)
    yield _Event(
        f"jump of phase {PHASES[place]} by {angle:g}°", at(place, rect(1, angle * pi / 180))
    )
    for least, most, lasts in ((0.8, 0.9, _LONG), (0.0, 0.3, _LASTS)):
        place, to = phase(), round(draw.uniform(least, most), 3)
        yield _Event(f"dip of phases {others(place)} to {to:g} pu", at(place, 1, to), lasts)
    # both phases meet at the middle of the line between them: −½ of the third one
    place, part = phase(), round(draw.uniform(0.0, 0.3), 3)
    factors = [1 + 0j] * 3
    turn = np.exp(2j * pi / 3)
    ahead, behind = (place + 1) % 3, (place + 2) % 3
    factors[ahead] = complex(part + (1 - part) * -0.5 * turn)
    factors[behind] = complex(part + (1 - part) * -0.5 / turn)
    name = f"short circuit between phases {others(place)} that leaves {part:g} of their voltage"
    yield _Event(name, (factors[0], factors[1], factors[2]))


@dataclass(frozen=True)
class _Answer:
    """Response to an event [pu, S_n]."""

    event: _Event
    phases: tuple[float, float, float]  # largest current of each over a cycle, from `_LASTS` on
    peak: float  # of any phase
    ripple: Ripple
    away: float  # distance of the current from where it was, afterwards
    gone: bool  # whether it gives no current in the end
    lead: (
        float | None
    )  # of the negative sequence of its current [°]; None where there is hardly any

    @property
    def most(self) -> float:
        return max(self.phases)

    def __str__(self) -> str:
        each = ", ".join(
            f"{size:.3g} pu in {name}" for name, size in zip(PHASES, self.phases, strict=True)
        )
        return f"{each} in the {self.event.name} for {self.event.lasts:g} s"


@check(
    "unbalanced_dips",
    "Does it keep its limit in each phase, and come back from unbalanced dips?",
    needs=("phase_order",),
)
def unbalanced_dips(subject: Subject) -> CheckResult:
    """Dips of one and of two phases of a source, and jumps of one; a run goes on while it comes back."""
    because = why_not(subject)
    if because:
        return not_applicable("unbalanced_dips", because)
    rest = list(_events(subject.random("unbalanced dips")))
    answers, refused = list[_Answer](), list[str]()
    while rest:
        bad = _happen(subject, rest, answers, refused)
        if bad is not None:
            says = f"its current is no number in the {bad.name}, and fmi2DoStep returned OK"
            return failed("unbalanced_dips", "not a number", says, case=bad.name)
    return _judge(subject, answers, refused)


def _happen(
    subject: Subject, rest: list[_Event], answers: list[_Answer], refused: list[str]
) -> _Event | None:
    """Let events happen to one instance, as long as it comes back; those that happened leave the list."""
    cycle = round(2 * pi / (omega_of(subject) or 1) / subject.step_size)
    with subject.running() as running:
        source = PhaseSource(running)
        before = present_current(running)
        source.run(_REST)
        while rest:
            event = rest.pop(0)
            try:
                with subject.while_doing(f"in the {event.name}"):
                    source.set_sequences(event.source)
                    during = source.run(event.lasts)
                    source.set_sequences(SequencePair(1, 0))
                    after = source.run(_REST)
            except ComponentError as error:
                refused.append(f"{event.name}: {error.log or error.status}")
                return None
            if not np.isfinite([*during.i, *after.i]).all():
                return event
            last = during.phase_currents[
                -cycle - round((event.lasts - _LASTS) / subject.step_size) :
            ]
            over = cycles_of(last, cycle).max(axis=0)
            steady = during.between(event.lasts - 0.06, event.lasts)
            mean = complex(after.i[-cycle:].mean())
            answers.append(
                _Answer(
                    event,
                    (float(over[0]), float(over[1]), float(over[2])),
                    float(np.abs(during.phase_currents).max()),
                    steady.ripple,
                    away=abs(mean - before),
                    gone=bool(np.abs(after.i[-cycle:]).max() < _GONE < abs(before)),
                    lead=_lead_where_seen(steady),
                )
            )
            if answers[-1].away > _BACK:
                return None
    return None


def _lead_where_seen(steady: Course) -> float | None:
    voltage, current = steady.voltage, steady.current
    if min(abs(voltage.negative), abs(current.negative)) < _SEEN:
        return None
    return _lead_of(voltage, current)


def _words_of_leads(answers: list[_Answer]) -> str:
    """Say where the negative sequence of the current stands, beside the one code whose figure is known."""
    leads = [answer.lead for answer in answers if answer.lead is not None]
    if not leads:
        return "it gives hardly any negative sequence; IEEE 2800-2022 asks for some"
    outside = sum(not _LEADS[0] <= lead <= _LEADS[1] for lead in leads)
    says = f"the negative sequence of its current leads that of the voltage by {min(leads):.0f} to {max(leads):.0f}°; "
    says += f"IEEE 2800-2022 asks for {_LEADS[0]:g} to {_LEADS[1]:g}° behind a full converter"
    return says + (f", which {outside} of {len(leads)} do not keep" if outside else "")


def _judge(subject: Subject, answers: list[_Answer], refused: list[str]) -> CheckResult:
    name = "unbalanced_dips"
    if not answers:
        return remarked(name, "; ".join(refused[:2]), "ask how it rides through unbalanced dips")
    declared = current_limit(subject)
    worst = max(answers, key=lambda answer: answer.most)
    highest = max(answers, key=lambda answer: answer.peak)
    swings = max(answers, key=lambda answer: answer.ripple.p)
    seen = (
        f"{len(answers)} dips and jumps of one and of two phases behind SCR {SCR:g}, drawn at random: over a cycle at "
        f"most {worst}, peak {highest.peak:.3g} pu in the {highest.event.name}; its power swings by up to "
        f"±{swings.ripple.p:.3g} pu of P and ±{swings.ripple.q:.3g} pu of Q in the {swings.event.name}"
    )
    seen += f"; {_words_of_leads(answers)}"
    figures: dict[str, Any] = {
        "phases": dict(zip(PHASES, worst.phases, strict=True)),
        "peak": highest.peak,
        "declared": declared,
        "ripple_P": swings.ripple.p,
        "ripple_Q": swings.ripple.q,
        "tried": len(answers),
        "leads": {one.event.name: one.lead for one in answers if one.lead is not None},
    }
    most = _ABOVE * declared if declared is not None else NO_LIMIT
    if worst.most > most and (declared is not None or not subject.is_machine):
        over = [phase for phase, size in zip(PHASES, worst.phases, strict=True) if size > most]
        fault = (
            "above its limit in one phase" if len(over) < len(PHASES) else "above its current limit"
        )
        limit = (
            f"{declared:g} pu is declared"
            if declared is not None
            else f"no limit is declared, and no converter gives more than {NO_LIMIT:g} pu"
        )
        where = f"phase {over[0]}" if len(over) == 1 else f"phases {' and '.join(over)}"
        return failed(name, fault, f"more than its limit in {where}; {limit}; {seen}", **figures)
    gone = [answer for answer in answers if answer.gone]
    tripped = [answer for answer in gone if abs(answer.event.source.positive) >= _STAYS_AT]
    if tripped:
        left = tripped[0].event.source
        says = f"it gives no current any more after the {tripped[0].event.name}, which leaves "
        says += f"{abs(left.positive):.3g} pu of positive sequence and brings {abs(left.negative):.3g} pu of negative"
        return failed(name, "trips in an unbalanced dip", f"{says}; {seen}", **figures)
    lost = [answer for answer in answers if answer.away > _BACK]
    seen += f"; it gives no current any more after the {gone[0].event.name}" if gone else ""
    seen += (
        f"; it is {lost[0].away:.2g} pu away after the {lost[0].event.name}"
        if lost and not gone
        else ""
    )
    seen += f"; {refused[0]}" if refused else ""
    if lost or refused or gone:
        return remarked(name, seen, "ask how it rides through unbalanced dips", **figures)
    return passed(name, seen, **figures)
