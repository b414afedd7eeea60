"""Whether a converter answers voltage and frequency with the right signs, and rests at its frequency."""

from collections.abc import Callable
from math import pi

import numpy as np

from orchestrator.acceptance.checks.base import SAME, Result, check, failed, not_applicable, passed, remarked
from orchestrator.acceptance.checks.droop import FREQUENCY, POINT, POINTS, SETTLED, VOLTAGE, Answer, droop
from orchestrator.acceptance.checks.port import WHY, of_current
from orchestrator.acceptance.checks.running import affordable
from orchestrator.acceptance.checks.subject import Point, Subject
from orchestrator.arrays import Complex, Numbers
from orchestrator.errors import ComponentError
from orchestrator.fmi.port import BoundDescription

_LASTS = 3.0
"""Time [s] in which an answer settles."""

_EARLY = (0.005, 0.025)
"""Cycle in which a converter is still the source behind its impedance that it was; oscillations of the network's
frequency have no mean over it."""

_MORE = 0.97
"""Reactive power in the end, in parts of the first cycle's, from which it is looked closer: a droop leaves less."""

_SOME = 1e-3
"""Change of power [pu, S_n] that is an answer."""

_SETTLED = 0.05
"""Part of an answer by which it may still move."""

_AWAY = 0.5
"""Power [pu, S_n] by which it may differ after such small changes, and be stable."""

_OMEGA = 1e-3
_PLAIN = ("pu", "p.u.", "1")


@check("rated_frequency", "Is its frequency 1 at rest?", needs=SAME)
def rated_frequency(subject: Subject) -> Result:
    """An FMU for 60 Hz that is bound as one of 50 Hz has omega = 1.2."""
    info = subject.description.variables.get("omega")
    if not subject.port or info is None or info.causality != "output" or info.unit not in _PLAIN:
        return not_applicable(
            "rated_frequency", "because it has no output 'omega' in pu (a binding's [signals] may name one)"
        )
    steps = affordable(subject, 2000)
    with subject.running() as running:
        omega = running.hold(np.zeros((1, len(running.rest))), steps, subject.step_size)[
            :, subject.outputs.index("omega")
        ]
    rest, f_n = float(np.median(omega[-max(1, steps // 10) :])), _rated(subject)
    seen = f"omega is {rest:.6g} at rest, in a network of its rated frequency"
    if abs(rest - 1) > 0.02:
        known = f", so it is made for {rest * f_n:.4g} Hz where {f_n:g} Hz is bound" if f_n else ""
        return failed("rated_frequency", "wrong rated frequency", f"{seen}{known}", omega=rest)
    if abs(rest - 1) > _OMEGA:
        return remarked("rated_frequency", seen, "let it settle, or ask what omega is", omega=rest)
    return passed("rated_frequency", seen, omega=rest)


def _rated(subject: Subject) -> float:
    described = subject.description
    return described.port.f_n if isinstance(described, BoundDescription) else 50.0


@check("signs", "Do P and Q answer voltage and frequency with the right signs?", needs=(*SAME, "power_balance"))
def signs(subject: Subject) -> Result:
    if not subject.port:
        return not_applicable("signs", WHY["no port"])
    fit = 1.0 / subject.memory.get("seconds_per_step", 1e-6)
    steps = int(min(_LASTS / subject.step_size, fit))
    if steps * subject.step_size < 0.5:
        return not_applicable(
            "signs", f"because {steps} steps of {subject.step_size:g} s show too little of its answer"
        )
    try:
        voltage, frequency = _answers(subject, steps, POINT)
    except ComponentError as error:
        return remarked("signs", f"small changes of voltage or frequency end with an error: {error}", "ask why")
    figures = {
        "Q_of_lower_voltage": voltage.power.imag, "P_of_lower_frequency": frequency.power.real,
        "moving": [voltage.moving, frequency.moving],
    }  # fmt: skip
    if not np.isfinite([voltage.far, frequency.far]).all():
        return failed("signs", "not a number", "its power is no number after small changes, and fmi2DoStep returned OK")
    wrong = _wrong(voltage, frequency) or _wrong_droop(subject, steps, voltage, frequency)
    said = f"{_said(voltage, frequency)}, {steps * subject.step_size:.2g} s later"
    if wrong:
        return failed("signs", wrong[0], f"{wrong[1]} ({said})", **figures)
    if max(voltage.far, frequency.far) > _AWAY:
        return remarked(
            "signs", f"it goes {max(voltage.far, frequency.far):.3g} pu away ({said})",
            "it is unstable at a stiff bus, or answers much; ask for the shortest network impedance that it bears",
            **figures,
        )  # fmt: skip
    return passed("signs", said, **figures)


def _answers(subject: Subject, steps: int, point: Point) -> tuple[Answer, Answer]:
    """To lower voltage, and to lower frequency."""
    omega = 2 * pi * _rated(subject) * FREQUENCY
    return (
        _answer(subject, steps, point, lambda sign, time: np.full(len(time), 1 - sign * VOLTAGE, complex)),
        _answer(subject, steps, point, lambda sign, time: np.exp(-1j * sign * omega * time)),
    )


def _answer(subject: Subject, steps: int, point: Point, factor: Callable[[float, Numbers], Complex]) -> Answer:
    """Change the voltage by a factor of time, up and down."""
    h = subject.step_size
    time: Numbers = np.arange(steps, dtype=np.float64) * h
    found, far = [], 0.0
    names = subject.inputs
    for sign in (1.0, -1.0):
        with subject.running(point=point if subject.starts else None) as running:
            rest = complex(*(running.rest[names.index(n)] for n in ("v_re", "v_im")))
            begin = of_current(running, running.read()[None])[0]
            turned = factor(sign, time)
            rows = np.zeros((steps, len(names)))
            for name, part in (("v_re", np.real), ("v_im", np.imag)):
                rows[:, names.index(name)] = part(rest * (turned - 1))
            current = of_current(running, running.hold(rows, steps, h))
        power = rest * turned * current.conj() - rest * np.conj(begin)
        frame = current * np.conj(turned / np.abs(turned)) - begin
        far = max(far, float(np.nan_to_num(np.abs(power), nan=np.inf).max()))
        found.append((frame * np.conj(rest) / abs(rest), power))
    half = [(a - b) / 2 for a, b in zip(*found, strict=True)]
    early, late, later = (slice(round(a / h), max(round(a / h) + 1, round(b / h))) for a, b in _windows(steps * h))
    i, s = ([part[window].mean() for window in (early, late, later)] for part in half)
    moving = max(abs(s[2].real - s[1].real), abs(s[2].imag - s[1].imag))
    return Answer(complex(i[2]), complex(s[0]), complex(s[2]), float(moving), far)


def _windows(end: float) -> tuple[tuple[float, float], ...]:
    """An early cycle, and two windows at the end."""
    return _EARLY, (0.7 * end, 0.8 * end), (0.9 * end, end)


def _wrong(voltage: Answer, frequency: Answer) -> tuple[str, str] | None:
    """Name of a fault, and what shows it."""
    if frequency.far > _AWAY and voltage.far > _AWAY:
        return "unstable", "small changes of voltage and of frequency at a stiff bus make its power run away"
    steady = [a.moving < max(_SOME, _SETTLED * abs(a.power)) for a in (voltage, frequency)]
    # Constant current or impedance takes so much with the voltage, and is no answer.
    least = 3 * VOLTAGE * abs(POINT.Q) + _SOME
    if steady[0] and voltage.power.imag < -least:
        return "wrong sign", "its reactive power falls with the voltage, and should rise"
    if steady[1] and frequency.power.real < -_SOME:
        return "wrong sign", "its active power falls with the frequency, and should rise"
    return None


def _wrong_droop(subject: Subject, steps: int, voltage: Answer, frequency: Answer) -> tuple[str, str] | None:
    """Look closer where lower voltage brings more reactive power in the end than in the first cycle."""
    if not subject.starts or voltage.power.imag < _MORE * voltage.early_power.imag or not voltage.early_power.imag > 0:
        return None
    if max(voltage.moving, frequency.moving) > SETTLED:
        steps *= 3
    found = [] if max(voltage.moving, frequency.moving) > SETTLED else [(POINT, voltage, frequency)]
    for point in (POINT, *POINTS)[len(found) :]:
        try:
            found.append((point, *_answers(subject, steps, point)))
        except ComponentError:
            continue  # it may not be able to work there
    slope = droop(found) if found else None
    if slope is None or slope > 0:
        return None
    says = f"the voltage behind its impedance rises by {-100 * slope:.2g} % a pu of reactive power, and should fall"
    return "wrong sign", f"{says}: look for the sign of Q in its droop"


def _said(voltage: Answer, frequency: Answer) -> str:
    q, p = voltage.power.imag, frequency.power.real
    first = f"{100 * VOLTAGE:g} % less voltage gives {q:+.3g} pu of reactive power"
    second = f"{100 * FREQUENCY:g} % less frequency {p:+.3g} pu of active power"
    if abs(q) < 3 * VOLTAGE * abs(POINT.Q) + _SOME:
        first += " (it does not support the voltage)"
    if abs(p) < _SOME:
        second += " (it does not support the frequency)"
    return f"{first}, {second}"
