"""Checks that a converter at its port does what a power flow expects of it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isinf

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import ComponentError, EndedError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.running import LONGEST, RUN_FOR, affordable, spent_since
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Running, Subject
from orchestrator.devices.binding.misfits import BALANCE, diagnosis, power_seen
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.port_mapping import BoundDescription

POINTS = (
    OperatingAt(1.0, 0.0, 0.5, 0.1),
    OperatingAt(1.03, 0.4, 0.7, -0.1),
    OperatingAt(0.97, -0.5, 0.3, 0.2),
    OperatingAt(1.0, 2.0, 0.6, 0.0),
    OperatingAt(1.01, -2.5, 0.4, -0.2),
)
# points at which it takes power
IMPORTING = (OperatingAt(1.0, 0.3, -0.5, 0.15), OperatingAt(1.02, -0.4, -0.3, -0.1))
# movement of the current in steady state [pu, S_n] that is a fault; 1e-6 is worth a remark
DRIFT = 1e-3
ANSWER = 400  # steps of the answer that is compared at several times
# steps to spend on a long rest, in parts of the time for which an FMU is made to run
_PART = 0.75
_LATER = 10.0  # time [s] for which it is left at rest after the time at which it wandered in 'runs'
# part of a movement that its second half has where it goes on; of a ramp it is a half
_GOES_ON = 0.4

WHY = {
    "no port": "because it has no port: give a binding with --binding (`gfor fmu bind` drafts one), or, around a "
    "controller alone, a device's file",
    "no start": "because the binding has no start values (P_0, Q_0, v_0, theta_0) to start from a power flow",
}


def without_start(name: str, subject: Subject) -> CheckResult:
    """Return the result of a check at the port for an FMU that cannot start from a power flow there."""
    return not_applicable(name, WHY["no start" if subject.port else "no port"])


def rating_of(running: Running) -> float:
    """S_n [MVA] with which it runs."""
    set_to = running.parameters.get("S_n", running.subject.use.values.get("S_n"))
    info = running.component.description.variables.get("S_n")
    if set_to is not None:
        return float(set_to)
    return SYSTEM_BASE_MVA if info is None or info.start is None else info.start_number


def current_limit(subject: Subject) -> float | None:
    """The largest current that the binding or the FMU declares [pu, S_n]; None where neither does."""
    described = subject.description
    if isinstance(described, BoundDescription):
        return described.port.current_limit
    info = described.variables.get("I_max")
    if info is None or info.start is None or info.unit not in ("pu", "p.u."):
        return None
    return info.start_number


def voltage_rows(running: Running, factors: Complex) -> Numbers:
    names = running.subject.inputs
    at = [names.index("v_re"), names.index("v_im")]
    moved = complex(*running.rest[at]) * (factors - 1)
    found: Numbers = np.zeros((len(factors), len(names)))
    found[:, at] = np.column_stack([moved.real, moved.imag])
    return found


def currents(running: Running, deviation: complex, steps: int) -> Complex:
    """Step with the voltage moved by a deviation [pu]; the injected current after each step [pu, S_n]."""
    names = running.subject.inputs
    change = np.zeros((1, len(names)))
    change[0, names.index("v_re")], change[0, names.index("v_im")] = deviation.real, deviation.imag
    return of_current(running, running.hold(change, steps, running.subject.step_size))


def followed(running: Running, factors: Complex) -> Complex:
    """Step with the voltage at the start multiplied by one factor after another; the injected current [pu, S_n]."""
    return of_current(
        running,
        running.hold(voltage_rows(running, factors), len(factors), running.subject.step_size),
    )


def of_current(running: Running, values: Numbers) -> Complex:
    """The injected current [pu, S_n] in rows of outputs."""
    names = running.subject.outputs
    found: Complex = values[:, names.index("i_re")] + 1j * values[:, names.index("i_im")]
    return found * SYSTEM_BASE_MVA / rating_of(running)


def present_current(running: Running) -> complex:
    """Injected current [pu, S_n]."""
    values = RealBatch(running.component, ("i_re", "i_im")).read()
    return complex(*values) * SYSTEM_BASE_MVA / rating_of(running)


def _points(subject: Subject) -> tuple[OperatingAt, ...]:
    return POINTS if subject.use.point is None else (subject.use.point, *POINTS)


def cannot_import(subject: Subject, point: OperatingAt) -> str:
    """Why it is not tried with that power: its declared bounds of P_0 forbid it; "" where they do not."""
    described = subject.description
    takers = [("P_0", point.P)]
    if isinstance(described, BoundDescription):
        takers = [(m.variable, m.factor * point.P + m.offset) for m in described.port.start["P_0"]]
        described = described.inner
    for name, value in takers:
        least, most = described.variables[name].minimum, described.variables[name].maximum
        if (least is not None and value < least) or (most is not None and value > most):
            return f"P_0 = {point.P:g} was not tried: {name} = {value:g} is outside of what the FMU declares"
    return ""


@check("steady_state", "Does it hold the steady state of a power flow?", needs=SAME)
def steady_state(subject: Subject) -> CheckResult:
    if not subject.starts:
        return without_start("steady_state", subject)
    steps, worst = affordable(subject, 5000), 0.0
    refused = []
    rest: _Rest | None = None
    for point in _points(subject)[:3]:
        try:
            with subject.running(point=point) as running:
                begin = present_current(running)
                moved = np.abs(currents(running, 0j, steps) - begin)
                worst = max(worst, float(np.nan_to_num(moved, nan=np.inf).max()))
                if rest is None and worst <= DRIFT:
                    rest = _rest(subject, running, begin, steps)
                    with suppress(ComponentError, EndedError):
                        late = running.record(
                            affordable(subject, ANSWER), subject.step_size, subject.one_step()
                        )
                        subject.memory["rested"] = point, rest, late
        except ComponentError as error:
            refused.append(str(error))
    if len(refused) == 3:
        return failed(
            "steady_state",
            "error in a step" if "fmi2DoStep" in refused[0] else "does not start",
            refused[0],
        )
    seen = f"the current moves by {worst:.3g} pu of its rating in {steps * subject.step_size:.3g} s at constant voltage"
    subject.memory["drift"] = worst
    if isinf(worst):
        return failed(
            "steady_state", "not a number", "its current is no number at constant voltage"
        )
    if worst > DRIFT:
        return failed("steady_state", "no steady state", seen, drift=worst)
    if rest is not None:
        worst = max(worst, rest.moved)
        seen += f", and by {rest.moved:.3g} pu in {rest.time:.3g} s"
        seen += ", and goes on" if rest.goes_on and rest.moved > 1e-6 else ""
    if isinf(worst):
        return failed("steady_state", "not a number", f"{seen}: its current is no number")
    if worst > DRIFT:
        return failed("steady_state", "leaves its steady state", seen, drift=worst)
    if worst > 1e-6 and rest is not None and rest.goes_on:
        return remarked(
            "steady_state", seen, "it does not settle: ask what goes on in it at rest", drift=worst
        )
    if worst > 1e-6:
        return remarked("steady_state", seen, "let it settle before linearising", drift=worst)
    return passed("steady_state", seen, drift=worst)


@dataclass(frozen=True)
class _Rest:
    """How far the current moved at constant voltage [pu, S_n], in what time [s], and whether that goes on."""

    moved: float
    time: float
    goes_on: bool


def _rest(subject: Subject, running: Running, begin: complex, steps: int) -> _Rest:
    """Leave it at rest until enough was seen, it moves too much, or there is no more time."""
    until, spent = subject.description.stop_time or 10.0, spent_since(subject)
    wanders_at = subject.memory.get("wanders_at", 0.0)
    budget = _PART * subject.memory.get("run_for", RUN_FOR)
    ends, moved = [(0.0, begin), (running.time, present_current(running))], 0.0
    while running.time < LONGEST and moved <= DRIFT:
        over = spent() > (budget if running.time >= until else 4 * budget)
        if over and (not wanders_at or running.time > wanders_at + _LATER):
            break
        try:
            current = currents(running, 0j, steps)
        except (ComponentError, EndedError):
            break  # it may end, or refuse to go on, after its experiment
        moved = max(moved, float(np.nan_to_num(np.abs(current - begin), nan=np.inf).max()))
        ends.append((running.time, complex(current[-1])))
    half = next(i for time, i in ends if time >= 0.5 * ends[-1][0])
    goes_on = abs(ends[-1][1] - half) > _GOES_ON * moved
    return _Rest(moved, ends[-1][0], goes_on)


@check(
    "power_balance",
    "Are sign, base and frame such that the power at its port is the power asked of it?",
)
def power_balance(subject: Subject) -> CheckResult:
    """Fit x = a·x_0 + b·conj(x_0) + c over several operating points, for powers and for currents."""
    if not subject.starts:
        return without_start("power_balance", subject)
    best: CheckResult | None = None
    settle = 0 if subject.memory.get("drift", 0.0) <= DRIFT else affordable(subject, 20000)
    for steps in dict.fromkeys((0, settle)):
        asked, found, voltages, left_out = _powers(subject, steps)
        if len(asked) < 3:
            return not_applicable(
                "power_balance",
                f"because it starts at {len(asked)} of {len(_points(subject)) + len(IMPORTING)} operating points only",
            )
        result = _judge(asked, found, voltages, steps * subject.step_size)
        if left_out and not result.fault:
            remedy = "nothing is known of it as a load or a charging store: do not use it so, or ask how it starts"
            result = remarked(
                "power_balance", f"{result.evidence}; {left_out}", remedy, **result.figures
            )
        if best is None or not result.fault:
            best = result
    assert best is not None
    return best


def _powers(
    subject: Subject, steps: int
) -> tuple[list[complex], list[complex], list[complex], str]:
    """Powers asked for, found, the voltages at which it starts; why it was not tried with imported power."""
    asked, found, voltages, left_out = [], [], [], ""
    for point in (*_points(subject), *IMPORTING):
        reason = cannot_import(subject, point) if point in IMPORTING else ""
        if reason:
            left_out = left_out or reason
            continue
        try:
            with subject.running(point=point) as running:
                if steps:
                    currents(running, 0j, steps)
                power = point.voltage * present_current(running).conjugate()
        except ComponentError as error:
            if point in IMPORTING:
                left_out = left_out or f"it does not start with P_0 = {point.P:g}: {error}"
            continue
        asked.append(complex(point.P, point.Q))
        found.append(power)
        voltages.append(point.voltage)
    return asked, found, voltages, left_out


def _judge(
    asked: Sequence[complex], found: Sequence[complex], voltages: Sequence[complex], after: float
) -> CheckResult:
    s_0, s = np.array(asked), np.array(found)
    at = "at the start" if not after else f"after {after:.3g} s"
    if not np.isfinite(s).all():
        return failed("power_balance", "not a number", f"the power {at} is not finite")
    worst = float(np.abs(s - s_0).max())
    k = int(np.argmax(np.abs(s - s_0)))
    seen = power_seen(at, asked[k], found[k])
    # What is wrong with an axis shows in the currents, what is wrong with P or Q in the powers.
    v = np.array(voltages)
    in_power, in_current = _fit(s_0, s), _fit((s_0 / v).conj(), (s / v).conj())
    of, (a, b, c, rest) = (
        ("S", in_power) if in_power[3] <= 1.01 * in_current[3] else ("i", in_current)
    )
    figures = {
        "of": of,
        "a": [a.real, a.imag],
        "b": [b.real, b.imag],
        "c": [c.real, c.imag],
        "rest": rest,
        "worst": worst,
    }
    if worst <= BALANCE:
        says = f"S is what is asked within {worst:.2g} pu of the rating at {len(s)} points"
        return passed("power_balance", says, **figures)
    imports = s_0.real < 0
    if (np.abs(s - s_0)[~imports] <= BALANCE).all():
        says = "it is as asked where it gives power, and not where it takes power"
        return failed("power_balance", "power not as asked", f"{seen}: {says}", **figures)
    fault, says = diagnosis(of, a, b, c, rest)
    return failed("power_balance", fault, f"{seen}: {says}", **figures)


def _fit(asked: Complex, found: Complex) -> tuple[complex, complex, complex, float]:
    """The coefficients a, b, c of found = a·asked + b·conj(asked) + c, and the largest rest."""
    (a, b, c), *_ = np.linalg.lstsq(
        np.column_stack([asked, asked.conj(), np.ones(len(asked))]), found, rcond=None
    )
    return (
        complex(a),
        complex(b),
        complex(c),
        float(np.abs(found - (a * asked + b * asked.conj() + c)).max()),
    )
