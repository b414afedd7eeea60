"""Checks that a converter answers voltage and frequency with the right signs, and rests at its frequency."""

from collections.abc import Callable
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import ComponentError
from orchestrator.core.units import whole_percent
from orchestrator.devices.acceptance.checks import droop as droops
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.port import WHY, cannot_import, of_current
from orchestrator.devices.acceptance.checks.running import STEP_TAKES, affordable
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.binding.misfits import (
    SLIGHT,
    Misfit,
    at_rest,
    made_for,
    of_frequency,
    omega_seen,
)
from orchestrator.devices.fmi.port_mapping import BoundDescription

_LASTS = 3.0  # time in which an answer settles [s]
_MOST_TIME = 1.0  # of one answer [s of a usual FMU]
_SHORTER = 0.67  # part of that time at other voltages

_EARLY = (0.005, 0.025)
"""Cycle in which a converter is still the source behind its impedance that it was; oscillations of the network's
frequency have no mean over it."""

# late reactive power, in parts of the first cycle's, from which to look closer: a droop leaves less
_MORE = 0.97
_SOME = 1e-3  # change of power [pu, S_n] that is an answer
_SETTLED = 0.05  # part of an answer by which it may still move
_AWAY = 0.5  # power [pu, S_n] by which it may differ after such small changes, and be stable
# power [pu, S_n] that still moves where an angle runs; an answer that settles slowly moves less
_LOST = 0.02
# power [pu, S_n] of the wrong sign after a change in one direction, which has terms of second order
_EACH = 5e-3
# part of the first cycle's reactive power by which its droop lowers the answer, or raises it
_TURNED = 0.1
_RINGS = 1e-3  # swing in the end that counts [pu, S_n]
_DAMPED = 0.8  # part of the swing before from which it is not damped
_TOLD = 0.5  # part of the swing before from which it is reported

# changes of sign in a third of the time, from which a swing is fast enough to be judged in it
_CROSSINGS = 6
_OMEGA_APART = 2e-4
"""Deviation of a settled omega from the network's [pu]: a fifth of the change; a wrong sign or base leaves 0.6 or more
of the change, a frequency meter's own error far less."""

_OTHER_F_N = 0.02  # by which the part of 50 or 60 Hz in the other may be missed
# voltages [pu] of which one is drawn: the ends of what is usual
_HIGH, _LOW = (1.095, 1.105), (0.895, 0.905)
_DROOP_OF_Q = "the sign of its droop of reactive power"
_SIGNS, _WORDS = (1.0, -1.0), ("less", "more")  # of the changes of voltage and frequency

_NEEDS = (*SAME, "rated_frequency", "power_balance")
_PLAIN = ("pu", "p.u.", "1")


@check("rated_frequency", "Is its frequency 1 at rest?", needs=SAME)
def rated_frequency(subject: Subject) -> CheckResult:
    """An FMU for 60 Hz that is bound as one of 50 Hz has omega = 1.2."""
    if not subject.port or not _shows_omega(subject):
        return not_applicable(
            "rated_frequency",
            "because it has no output 'omega' in pu (a binding's [signals] may name one)",
        )
    steps = affordable(subject, 2000)
    with subject.running() as running:
        still, shown = np.zeros((1, len(running.rest))), subject.outputs.index("omega")
        rest, settled = at_rest(lambda: running.hold(still, steps, subject.step_size)[:, shown])
    seen = omega_seen(rest)
    found = of_frequency(rest, _rated(subject)) if settled else None
    if found:
        return failed("rated_frequency", found.fault, found.evidence, **found.figures)
    if abs(rest - 1) > SLIGHT:
        return remarked("rated_frequency", seen, "let it settle, or ask what omega is", omega=rest)
    return passed("rated_frequency", seen, omega=rest)


def _shows_omega(subject: Subject) -> bool:
    info = subject.description.variables.get("omega")
    return info is not None and info.causality == "output" and info.unit in _PLAIN


def _rated(subject: Subject) -> float:
    described = subject.description
    if isinstance(described, BoundDescription):
        return described.port.f_n
    own = described.variables.get("f_n")
    known = 50.0 if own is None or own.start is None else own.start_number
    return float(subject.use.values.get("f_n", known))


@check("signs", "Do P and Q answer voltage and frequency with the right signs?", needs=_NEEDS)
def signs(subject: Subject) -> CheckResult:
    """Small changes while it gives reactive power, while it takes some, and where a case uses it."""
    if not subject.port:
        return not_applicable("signs", WHY["no port"])
    fit = _MOST_TIME / STEP_TAKES
    steps = int(min(_LASTS / subject.step_size, fit))
    if steps * subject.step_size < 0.5:
        return not_applicable(
            "signs",
            f"because {steps} steps of {subject.step_size:g} s show too little of its answer",
        )
    places = [droops.POINT]
    if subject.starts:
        draw = subject.random("signs")
        high, low = (
            OperatingAt(round(draw.uniform(*bounds), 3), 0.0, 0.6, 0.1) for bounds in (_HIGH, _LOW)
        )
        places += [
            p
            for p in (subject.use.point, droops.ABSORBING, droops.CHARGING, high, low)
            if p is not None
        ]
    seen, refused = list[CheckResult](), []
    for point in places:
        if point is droops.CHARGING and cannot_import(subject, point):
            continue  # which 'power_balance' tells
        try:
            result = _at(subject, steps if point.v == 1.0 else round(_SHORTER * steps), point)
            if point is droops.CHARGING and seen and not result.fault:
                result = _evenly(_summary(seen), result)
        except ComponentError as error:
            if point is droops.CHARGING:
                continue
            refused.append(
                f"small changes of voltage or frequency at {_name_of(point)} end with an error: {error}"
            )
            continue
        if result.fault:
            return result
        seen.append(result)
    if not seen:
        return remarked("signs", refused[0], "ask why")
    first = _summary(seen)
    if refused:
        return remarked("signs", "; ".join([first.evidence, *refused]), "ask why", **first.figures)
    return first


def _summary(seen: list[CheckResult]) -> CheckResult:
    """The first remark, or the first result, with what was not judged at any point."""
    first = next((result for result in seen if result.verdict == "remark"), seen[0])
    unknown = any("not_judged" in result.figures for result in seen)
    return replace(first, figures=first.figures | ({"not_judged": _DROOP_OF_Q} if unknown else {}))


def _evenly(giving: CheckResult, taking: CheckResult) -> CheckResult:
    """The result while it takes power; a failure where its droop of the reactive power is another one than before.

    It lowers the answer to the voltage from the first cycle on, or raises it: not by turns."""
    settled = all(result.figures["moving"][0] < droops.SETTLED for result in (giving, taking))
    kept, kept_now = (
        result.figures["Q_in_parts_of_the_first_cycle"] for result in (giving, taking)
    )
    if settled and min(kept, kept_now) < 1 - _TURNED and max(kept, kept_now) > 1 + _TURNED:
        left = f"{whole_percent(kept_now)} are left in the end"
        says = f"of the reactive power that less voltage brings in the first cycle {left} "
        return failed(
            "signs",
            "uneven droop",
            f"{says}while it takes power, and {whole_percent(kept)} while it gives some",
            **taking.figures,
        )
    return taking


def _name_of(point: OperatingAt) -> str:
    turned = f", theta_0 = {point.theta:g} rad" if point.theta else ""
    return f"P_0 = {point.P:.3g}, Q_0 = {point.Q:.3g}{turned}" + (
        f", v_0 = {point.v:g}" if point.v != 1 else ""
    )


def _at(subject: Subject, steps: int, point: OperatingAt) -> CheckResult:
    voltage, frequency = _answers(subject, steps, point)
    figures: dict[str, Any] = {
        "Q_of_lower_voltage": voltage.power.imag,
        "P_of_lower_frequency": frequency.power.real,
        "moving": [voltage.moving, frequency.moving],
        "Q_in_parts_of_the_first_cycle": voltage.power.imag / voltage.early_power.imag
        if voltage.early_power.imag > _SOME
        else 1.0,
    }
    if not np.isfinite([voltage.far, frequency.far]).all():
        return failed(
            "signs",
            "not a number",
            "its power is no number after small changes, and fmi2DoStep returned OK",
        )
    wrong, unknown = _wrong(point, voltage, frequency), ""
    misfit = None if wrong else _wrong_omega(frequency, _rated(subject))
    if misfit:
        wrong = misfit.fault, misfit.evidence
        figures |= misfit.figures
    if not wrong:
        wrong, unknown = _wrong_droop(subject, steps, point, voltage, frequency)
    said = f"{_describe(point, voltage, frequency)}, {steps * subject.step_size:.2g} s later"
    if subject.starts:
        said += f", at {_name_of(point)}"
    if unknown:
        said += f"; {unknown}"
        figures["not_judged"] = _DROOP_OF_Q
    if wrong:
        return failed("signs", wrong[0], f"{wrong[1]} ({said})", **figures)
    if max(voltage.far, frequency.far) > _AWAY:
        says = f"it goes {max(voltage.far, frequency.far):.3g} pu away ({said})"
        remedy = "it is unstable at a stiff bus, or answers much; ask for the shortest network impedance that it bears"
        return remarked("signs", says, remedy, **figures)
    swings = [way.ringing for answer in (voltage, frequency) for way in answer.ways]
    late = max((late for before, late, _ in swings if late > _TOLD * before), default=0.0)
    if late > _RINGS:
        says = f"its power still swings by {late:.2g} pu about its course ({said})"
        return remarked(
            "signs", says, "ask how it is damped, and at which network impedance", **figures
        )
    lag = _lag(frequency)
    if lag:
        remedy = "ask for its time constant: what is controlled or judged by omega comes so late"
        return remarked("signs", f"{lag} ({said})", remedy, **figures)
    return passed("signs", said, **figures)


def _answers(
    subject: Subject, steps: int, point: OperatingAt
) -> tuple[droops.DroopAnswer, droops.DroopAnswer]:
    omega = 2 * pi * _rated(subject) * droops.FREQUENCY
    return (
        _answer(
            subject,
            steps,
            point,
            lambda sign, time: np.full(len(time), 1 - sign * droops.VOLTAGE, complex),
        ),
        _answer(subject, steps, point, lambda sign, time: np.exp(-1j * sign * omega * time)),
    )


def _answer(
    subject: Subject, steps: int, point: OperatingAt, factor: Callable[[float, Numbers], Complex]
) -> droops.DroopAnswer:
    """Change the voltage by a factor of time, up and down."""
    h = subject.step_size
    time: Numbers = np.arange(steps, dtype=np.float64) * h
    found, ways = [], []
    names = subject.inputs
    end = steps * h
    spans = _EARLY, (0.7 * end, 0.8 * end), (0.9 * end, end)
    windows = [slice(round(a / h), max(round(a / h) + 1, round(b / h))) for a, b in spans]
    shown = subject.outputs.index("omega") if _shows_omega(subject) else None
    for sign in _SIGNS:
        with subject.running(point=point if subject.starts else None) as running:
            rest = complex(*(running.rest[names.index(n)] for n in ("v_re", "v_im")))
            begin = of_current(running, running.read()[None])[0]
            turned = factor(sign, time)
            rows = np.zeros((steps, len(names)))
            for name, part in (("v_re", np.real), ("v_im", np.imag)):
                rows[:, names.index(name)] = part(rest * (turned - 1))
            values = running.hold(rows, steps, h)
        current = of_current(running, values)
        power = rest * turned * current.conj() - rest * np.conj(begin)
        frame = current * np.conj(turned / np.abs(turned)) - begin
        ways.append(_way(power, None if shown is None else values[:, shown], windows))
        found.append((frame * np.conj(rest) / abs(rest), power))
    half = [(a - b) / 2 for a, b in zip(*found, strict=True)]
    i, s = ([part[window].mean() for window in windows] for part in half)
    moving, far = float(_apart(s[1], s[2])), max(way.far for way in ways)
    return droops.DroopAnswer(
        complex(i[2]), complex(s[0]), complex(s[2]), moving, far, (ways[0], ways[1])
    )


def _way(power: Complex, omega: Numbers | None, windows: list[slice]) -> droops.Way:
    late, later = (complex(power[window].mean()) for window in windows[1:])
    far = float(np.nan_to_num(np.abs(power), nan=np.inf).max())
    part = len(power) // 3
    (before, _), (at_last, crossings) = _swing(power[part : 2 * part]), _swing(power[-part:])
    ringing = before, at_last, crossings
    if omega is None:
        return droops.Way(later, _apart(late, later), far, None, 0.0, ringing)
    tail = omega[windows[1].start :]
    return droops.Way(
        later,
        _apart(late, later),
        far,
        float(omega[windows[2]].mean()),
        float(np.ptp(tail)),
        ringing,
    )


def _swing(power: Complex) -> tuple[float, int]:
    """From crest to trough of P or Q [pu, S_n] about a curve of third order, and how often its sign changes."""
    time, swings = np.linspace(-1, 1, len(power)), []
    for part in (np.nan_to_num(power.real), np.nan_to_num(power.imag)):
        rest = part - np.polyval(np.polyfit(time, part, 3), time)
        swings.append((float(np.ptp(rest)), int(np.count_nonzero(np.diff(np.sign(rest))))))
    return max(swings)


def _apart(a: complex, b: complex) -> float:
    return max(abs(b.real - a.real), abs(b.imag - a.imag))


def _wrong(
    point: OperatingAt, voltage: droops.DroopAnswer, frequency: droops.DroopAnswer
) -> tuple[str, str] | None:
    if frequency.far > _AWAY and voltage.far > _AWAY:
        return (
            "unstable",
            "small changes of voltage and of frequency at a stiff bus make its power run away",
        )
    for answer, kind in zip((voltage, frequency), ("voltage", "frequency"), strict=True):
        for way in answer.ways:
            before, late, crossings = way.ringing
            if way.far < _AWAY and crossings >= _CROSSINGS and late > max(_RINGS, _DAMPED * before):
                says = f"after a small change of {kind} its power swings by {before:.2g} pu, and by {late:.2g} pu later"
                return "keeps moving", says
    lost = _lost(voltage, frequency)
    if lost:
        return "loses synchronism", lost
    steady = [a.moving < max(_SOME, _SETTLED * abs(a.power)) for a in (voltage, frequency)]
    least = _least(point)
    if steady[0] and voltage.power.imag < -least:
        return "wrong sign", "its reactive power falls with the voltage, and should rise"
    if steady[1] and frequency.power.real < -_SOME - 3 * droops.FREQUENCY * abs(
        point.P
    ):  # a constant torque's
        return "wrong sign", "its active power falls with the frequency, and should rise"
    for sign, word, by_voltage, by_frequency in zip(
        _SIGNS, _WORDS, voltage.ways, frequency.ways, strict=True
    ):
        if _rests(by_voltage) and sign * by_voltage.power.imag < -least - _EACH:
            return (
                "wrong sign",
                f"its reactive power changes by {by_voltage.power.imag:+.3g} pu with {word} voltage",
            )
        if _rests(by_frequency) and sign * by_frequency.power.real < -_EACH:
            return (
                "wrong sign",
                f"its active power changes by {by_frequency.power.real:+.3g} pu with {word} frequency",
            )
    return None


def _least(point: OperatingAt) -> float:
    """Constant current or impedance takes so much reactive power with the voltage, and is no answer."""
    return 3 * droops.VOLTAGE * abs(point.Q) + _SOME


def _rests(way: droops.Way) -> bool:
    return way.far <= _AWAY and way.moving < max(_SOME, _SETTLED * abs(way.power))


def _lost(*answers: droops.DroopAnswer) -> str:
    """Which change makes it run away, where the opposite one does not; "" where there is none."""
    for answer, kind, size in zip(
        answers, ("voltage", "frequency"), (droops.VOLTAGE, droops.FREQUENCY), strict=True
    ):
        for here, there, word in zip(answer.ways, answer.ways[::-1], _WORDS, strict=True):
            if here.far > _AWAY and here.moving > _LOST and there.far < _AWAY / 2:
                return (
                    f"with {100 * size:g} % {word} {kind} its power goes {here.far:.3g} pu away and does not settle; "
                    f"the opposite change moves it by {there.far:.3g} pu"
                )
    return ""


def _wrong_omega(frequency: droops.DroopAnswer, f_n: float) -> Misfit | None:
    """In synchronism its frequency is the network's, which the changes moved."""
    for sign, way in zip(_SIGNS, frequency.ways, strict=True):
        if way.omega is None or not _rests(way) or way.omega_moving > _OMEGA_APART / 10:
            continue
        network = 1 - sign * droops.FREQUENCY
        part = (way.omega - 1) / (network - 1)
        if min(abs(part - 1.2), abs(1 / part - 1.2) if part else 1.0) < _OTHER_F_N:
            says = f"omega moves by {part:.4g} times what the network's frequency does"
            return made_for(says, 1 / part, f_n, {})
        if abs(way.omega - network) > _OMEGA_APART:
            says = (
                f"omega settles at {way.omega:.6g} where the network's frequency is {network:.6g}"
            )
            return Misfit("wrong frequency", says)
    return None


def _lag(frequency: droops.DroopAnswer) -> str:
    """How far an omega is behind that still moves where the power rests: where its angle rests, it has arrived."""
    for sign, way in zip(_SIGNS, frequency.ways, strict=True):
        network = 1 - sign * droops.FREQUENCY
        if (
            way.omega is not None
            and way.moving < droops.SETTLED
            and abs(way.omega - network) > _OMEGA_APART
        ):
            return f"omega is {way.omega:.6g} and still on its way to the network's {network:.6g}, and its power rests"
    return ""


def _wrong_droop(
    subject: Subject,
    steps: int,
    point: OperatingAt,
    voltage: droops.DroopAnswer,
    frequency: droops.DroopAnswer,
) -> tuple[tuple[str, str] | None, str]:
    """Look closer where lower voltage brings more reactive power in the end than in the first cycle.

    A fault and what shows it, and why the droop of the reactive power could not be judged."""
    not_judged = f"{_DROOP_OF_Q} was not judged: "
    if voltage.power.imag < _MORE * voltage.early_power.imag:
        return None, ""
    if not subject.starts or not voltage.early_power.imag > 0:
        return None, f"{not_judged}it takes no start values, or gives no reactive power at first"
    if max(voltage.moving, frequency.moving) > droops.SETTLED:
        steps *= 3
    found = (
        []
        if max(voltage.moving, frequency.moving) > droops.SETTLED
        else [(point, voltage, frequency)]
    )
    for other in (point, *droops.further(point))[len(found) :]:
        try:
            answers = _answers(subject, steps, other)
        except ComponentError:
            continue  # it may not be able to work there
        if max(answer.moving for answer in answers) > droops.SETTLED:
            return None, f"{not_judged}it does not settle in time"
        found.append((other, *answers))
    slope = droops.droop(found) if found else None
    if slope is None:
        return None, f"{not_judged}it follows no linear law"
    if slope > 0:
        return None, ""
    says = f"the voltage behind its impedance rises by {-100 * slope:.2g} % a pu of reactive power, and should fall"
    return ("wrong sign", f"{says}: look for the sign of Q in its droop"), ""


def _describe(
    point: OperatingAt, voltage: droops.DroopAnswer, frequency: droops.DroopAnswer
) -> str:
    q, p = voltage.power.imag, frequency.power.real
    first = f"{100 * droops.VOLTAGE:g} % less voltage gives {q:+.3g} pu of reactive power"
    second = f"{100 * droops.FREQUENCY:g} % less frequency {p:+.3g} pu of active power"
    if abs(q) < _least(point):
        first += " (it does not support the voltage)"
    if abs(p) < _SOME:
        second += " (it does not support the frequency)"
    return f"{first}, {second}"
