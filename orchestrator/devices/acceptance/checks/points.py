"""Checks of a converter where a case may put it: without power, with full power either way, at another rating."""

import re
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Flags, Numbers
from orchestrator.core.errors import ComponentError, EndedError
from orchestrator.core.units import to_unit
from orchestrator.devices.acceptance.checks import port
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.droop import FREQUENCY, VOLTAGE
from orchestrator.devices.acceptance.checks.events import scale
from orchestrator.devices.acceptance.checks.port import (
    ANSWER,
    IMPORTING,
    POINTS,
    WHY,
    followed,
    present_current,
    rating_of,
)
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.binding.misfits import BALANCE, NO_LIMIT
from orchestrator.devices.fmi.port_mapping import BoundDescription

_IDLE = OperatingAt(1.0, 0.1, 0.0, 0.0)
_FULL = (OperatingAt(1.02, 0.2, 1.0, 0.0), OperatingAt(1.02, -0.3, -1.0, 0.0))

# difference of the power of two points [pu, S_n], which no setting in steps of 1 % can show
_APART = 0.0037
_RESTS = 2000  # steps for which it is watched at each point

_SMALLER, _LARGER = (0.3, 0.42), (2.2, 3.5)  # bounds of other ratings, in parts of its own

_DIP = 0.05  # voltage of the dip that shows the limit at another rating [pu]
_DIP_LASTS = 0.15  # its duration [s]
_CYCLE = 0.02  # time of the mean at its end [s]: a period of 50 Hz

_ANSWERS = 1.0  # time [s] after which its answer at another rating is taken
_SEEN = 0.01  # least answer [pu, S_n] that is compared
_OTHERWISE = 0.1  # part of an answer by which it may differ at another rating
# part by which a current in a dip may miss the limit of another rating, and be that limit
_STAYS = 0.25


def _points(subject: Subject) -> Iterator[tuple[str, OperatingAt]]:
    yield "without power", _IDLE
    for point in _FULL:
        yield f"at P_0 = {point.P:g}", point
    draw = subject.random("operating points")
    for sign in (1, -1):
        v, theta, P, Q = draw.uniform((0.96, -3.1, 0.15, -0.2), (1.04, 3.1, 0.8, 0.2))
        for more in (0.0, _APART):
            point = OperatingAt(
                round(v, 3), round(theta, 3), round(sign * P + more, 5), round(Q, 3)
            )
            yield f"at P_0 = {point.P:.5g}, Q_0 = {point.Q:.3g}, v_0 = {point.v:.4g}", point


@check(
    "operating_points",
    "Does it start and rest without power, with full power either way, and at points drawn at random?",
    needs=(*SAME, "steady_state", "power_balance"),
)
def operating_points(subject: Subject) -> CheckResult:
    if not subject.starts:
        return port.without_start("operating_points", subject)
    tried, left_out, found = 0, [], []
    for words, point in _points(subject):
        reason = port.cannot_import(subject, point)
        if reason:
            left_out.append(reason)
            continue
        try:
            with subject.running(point=point) as running:
                begin = port.present_current(running)
                moved = np.abs(
                    port.currents(running, 0j, affordable(subject, _RESTS)) - begin
                ).max()
        except ComponentError as error:
            left_out.append(f"{words} it refuses to work: {error.log or error.status}")
            continue
        tried += 1
        power = point.voltage * begin.conjugate()
        found.append((point, power))
        says = f"{words} its power is {power:.4g} pu"
        if not np.isfinite([abs(power), moved]).all():
            return failed("operating_points", "not a number", f"{words} its current is no number")
        if abs(power - complex(point.P, point.Q)) > BALANCE:
            return failed(
                "operating_points", "power not as asked", f"{says}, and is as asked at other points"
            )
        if moved > port.DRIFT and point not in _FULL:
            return failed(
                "operating_points",
                "no steady state",
                f"{words} its current moves by {moved:.3g} pu",
            )
        if moved > port.DRIFT:
            left_out.append(f"{words} its current moves by {moved:.3g} pu")
    seen = f"it starts and rests at {tried} points, among them {'none' if not tried else 'no power and full power'}"
    coarse = _coarse(found)
    if coarse:
        return remarked(
            "operating_points", f"{coarse}; {seen}", "ask in which steps it takes its power"
        )
    if left_out:
        remedy = "do not use it so, or ask how it works there"
        return remarked(
            "operating_points",
            f"it starts and rests at {tried} points; {'; '.join(left_out)}",
            remedy,
        )
    return passed("operating_points", seen)


def _coarse(found: list[tuple[OperatingAt, complex]]) -> str:
    """Where a small change of the power that is asked for is not followed; "" where all are."""
    for (one, first), (other, second) in pairwise(found):
        asked, got = other.P - one.P, (second - first).real
        if abs(asked - _APART) < 1e-9 and abs(got - asked) > asked / 2:
            return f"where P_0 is {asked:g} pu higher its power is {got:.3g} pu higher: it takes its power in steps"
    return ""


@check(
    "ratings",
    "Is it the same in per unit at another rating?",
    needs=(*SAME, "steady_state", "power_balance"),
)
def ratings(subject: Subject) -> CheckResult:
    """Start it with other values of S_n, and look at its power, its answer and its current in a deep dip."""
    described = subject.description
    takes = "S_n" in (
        described.port.start if isinstance(described, BoundDescription) else described.variables
    )
    if not subject.starts or not takes:
        return not_applicable(
            "ratings", "because it takes no rating (the binding has no [start.S_n])"
        )
    draw, seen, refused, otherwise = subject.random("ratings"), [], [], []
    with subject.running() as running:
        own = port.rating_of(running)
    usual, answer = _in_a_dip(subject, own)[1], _answer(subject, own)
    limit = port.current_limit(subject)
    for bounds in (_SMALLER, _LARGER):
        part = round(draw.uniform(*bounds), 3)
        words = f"at S_n = {part * own:.4g} MVA, {part:g} of what it has"
        try:
            power, current = _in_a_dip(subject, part * own)
            apart = abs(_answer(subject, part * own) - answer)
        except ComponentError as error:
            refused.append(f"{words}, it refuses to start: {error.log or error.status}")
            continue
        asked = complex(subject.point.P, subject.point.Q)
        if not np.isfinite([abs(power), current]).all():
            return failed("ratings", "not a number", f"{words}, its current is no number")
        if abs(power - asked) > BALANCE * max(1.0, abs(asked)):
            says = f"{words}, its power is {power:.4g} pu where {asked:.4g} is asked"
            return failed("ratings", "base of another rating", says, power=[power.real, power.imag])
        says = f"{words}, its current in a dip to {_DIP:g} pu is {current:.3g} pu, and {usual:.3g} pu at its own rating"
        if abs(current * part - usual) < _STAYS * usual < _STAYS * NO_LIMIT:
            return failed("ratings", "limit of another rating", says, current=current)
        if limit is not None and current > 1.05 * limit >= usual:
            return failed(
                "ratings",
                "above its current limit",
                f"{says}; {limit:g} pu is declared",
                current=current,
            )
        seen.append(says)
        if apart > _OTHERWISE * max(abs(answer), _SEEN):
            says = f"its answer to less voltage and frequency is {apart:.2g} pu away from the {abs(answer):.2g} pu"
            otherwise.append(f"{words}, {says} at its own rating")
    if otherwise:
        remedy = "ask which of its parameters count on another rating or in units, and set them together with S_n"
        return remarked("ratings", "; ".join([*otherwise, *refused]), remedy)
    if refused:
        remedy = "do not use it at other ratings, or ask which it takes"
        return remarked("ratings", "; ".join([*seen, *refused]), remedy)
    return passed("ratings", "; ".join(seen))


def _in_a_dip(subject: Subject, rating: float) -> tuple[complex, float]:
    """The power from which it starts at a rating [MVA], and the current over the last cycle of a dip [pu, S_n]."""
    h = subject.step_size
    with subject.running(parameters={"S_n": rating}) as running:
        power = subject.start_voltage * port.present_current(running).conjugate()
        port.currents(running, 0j, max(1, round(_CYCLE / h)))
        during = port.currents(
            running, (_DIP - 1) * subject.start_voltage, max(1, round(_DIP_LASTS / h))
        )
    return power, float(np.abs(during[-max(1, round(_CYCLE / h)) :]).mean())


def _answer(subject: Subject, rating: float) -> complex:
    """By how much its current changes with 2 % less voltage and 0.1 % less frequency [pu, S_n]."""
    h = subject.step_size
    steps = affordable(subject, round(_ANSWERS / h))
    with subject.running(parameters={"S_n": rating}) as running:
        begin = port.present_current(running)
        change = (1 - VOLTAGE) * np.exp(-100j * np.pi * FREQUENCY * h * np.arange(steps))
        current = port.followed(running, change)
    return complex((current * np.abs(change) / change)[-max(1, round(_CYCLE / h)) :].mean() - begin)


# A start [s] at which single precision has no milliseconds left; a day has more seconds
_LATE = 20_000.0

_SAME = 1e-4  # part of their range by which two answers may differ
_EVENLY = 0.05  # part by which a store's motion at rest may differ from the rate of its first step
_FILLED = 0.1  # most by which an answer may follow what is stored, in parts of itself
_PORT = ("i_re", "i_im", "p", "q", "omega")  # outputs that have to rest
_STILL = 100.0  # the same, in parts of the motion of a device at rest

# part of an output's size by which an angle of six million radians, short of digits, changes it
_ROUNDED = 1e-8
# frequency by which the device is turned forth, and back for twice as long [pu]
_FASTER = 0.012
_LASTS = 9.0  # time in all [s]
# difference of the currents that two angles bring [pu, S_n]: a jump of some hundredths of a
# milliradian
_TURNED = 5e-5

_POWER = re.compile(r"^[pq](?![a-z])|power", re.IGNORECASE)
_NEAR = 0.02


@check("later_times", "Does it answer alike at later times?", needs=(*SAME, "steady_state"))
def later_times(subject: Subject) -> CheckResult:
    """The answer to a small step at once, after a long rest, and where it starts at another time."""
    if not subject.port:
        return not_applicable("later_times", WHY["no port"])
    steps, h, said, found = affordable(subject, ANSWER), subject.step_size, [], 0.0
    rested = subject.memory.get("rested")
    if rested is not None:
        point, rest, late = rested
        first = subject.trajectory(steps, h, subject.one_step(), point=point)
        stores = _find_stores(subject, first, late, rest.time)
        filled = float(np.abs(late[0, stores] / first[0, stores] - 1).max(initial=0.0))
        level = np.where(stores, late[0] - first[0], 0.0)
        apart = _differs(first, late - level, _STILL * rest.moved)
        said.append(f"after {rest.time:.3g} s at rest it is {apart:.2g} of its range away")
        if stores.any():
            names = ", ".join(str(name) for name in np.array(subject.outputs)[stores])
            said.append(f"where what it stores ({names}) moves by {100 * filled:.2g} %")
        found = apart if apart > min(filled, _FILLED) else 0.0
    first = subject.trajectory(steps, h, subject.one_step())
    try:
        subject.start_time = _LATE
        apart = _differs(
            first,
            subject.trajectory(steps, h, subject.one_step()),
            _ROUNDED * np.abs(first).max(axis=0),
        )
        said.append(f"started at {_LATE:g} s it is {apart:.2g} of its range away")
        found = max(found, apart)
    except (ComponentError, EndedError) as error:
        said.append(f"not judged where it starts at {_LATE:g} s: {error}")
    finally:
        subject.start_time = 0.0
    says = f"the answer to a small step: {', '.join(said)}"
    return (
        failed("later_times", "counts time", says, apart=found)
        if found > _SAME
        else passed("later_times", says, apart=found)
    )


def _find_stores(subject: Subject, first: Numbers, late: Numbers, seconds: float) -> Flags:
    """Find outputs that moved at rest all the time as fast as they begin to move, such as a battery's state of charge.

    ``first``, ``late``: outputs at the communication points of the answer, at once and after a rest.
    ``seconds``: duration of the rest [s]."""
    moved = late[0] - first[0]
    at_its_rate = (first[1] - first[0]) / subject.step_size * seconds
    even = (np.abs(moved - at_its_rate) < _EVENLY * np.abs(moved)) & (first[0] != 0.0)
    own = np.array([name not in _PORT for name in subject.outputs])
    found: Flags = even & own
    return found


def _differs(first: Numbers, late: Numbers, least: Numbers | float) -> float:
    """By which part of its range an output differs by more than the least."""
    return difference(first, np.where(np.abs(late - first) < least, first, late))[0]


@check("angles", "Is it the same wherever its angle begins?", needs=(*SAME, "steady_state"))
def angles(subject: Subject) -> CheckResult:
    """The network turns it by two turns either way, from two angles; the second run is the first, turned."""
    if not subject.starts:
        return port.without_start("angles", subject)
    h, found = subject.step_size, []
    steps = max(3, round(scale(subject, _LASTS) * _LASTS / h))
    rates = np.where(np.arange(steps) < steps / 3, _FASTER, -_FASTER)
    turned = np.exp(100j * np.pi * h * np.cumsum(rates))
    for theta in subject.random("angles").uniform(2.0, 3.1) * np.array([1.0, -1.0]):
        with subject.running(point=OperatingAt(1.0, theta, 0.3, 0.05)) as running:
            found.append(followed(running, turned) * np.exp(-1j * theta) / turned)
    apart = np.abs(found[1] - found[0])
    at = int(np.argmax(apart > _TURNED))
    if not apart.max() <= _TURNED:
        says = f"turned by {100 * _FASTER:g} % of frequency, its current from theta_0 = {theta:.3g} rad differs from "
        says += f"that from {-theta:.3g} rad by {apart.max():.2g} pu, first at t = {at * h:.3g} s"
        return failed("angles", "jumps with its angle", says, apart=float(apart.max()))
    says = f"turned by {100 * np.pi * _FASTER * h * steps / 3:.3g} rad forth and back, from two angles, it differs by "
    return passed("angles", f"{says}{apart.max():.2g} pu")


@check("shown_power", "Do its outputs of power show what it gives?", needs=(*SAME, "power_balance"))
def shown_power(subject: Subject) -> CheckResult:
    """Only factors that a wrong unit or base brings are told: what is measured elsewhere differs by losses."""
    variables = subject.description.variables
    units = {
        n: unit for n in subject.outputs if (unit := _megawatts(n, variables[n].unit)) is not None
    }
    if not subject.starts or not units:
        return not_applicable("shown_power", "because it shows no power besides its current")
    powers, shown = [], []
    for point in (*POINTS[:3], IMPORTING[0]):
        try:
            with subject.running(point=point) as running:
                rating, values = (
                    rating_of(running),
                    dict(zip(subject.watched, running.read(), strict=True)),
                )
                powers.append(point.voltage * present_current(running).conjugate())
        except ComponentError:
            continue
        shown.append([values[n] * (unit or rating) / rating for n, unit in units.items()])
    if len(powers) < 3:
        return not_applicable("shown_power", f"because it starts at {len(powers)} points only")
    known = {
        1e3: "1000",
        1e-3: "1/1000",
        rating: "S_n",
        1 / rating: "1/S_n",
        1e3 * rating: "1000·S_n",
    }
    for name, row in zip(units, np.array(shown).T, strict=True):
        for word, flows in (("P", np.real(powers)), ("Q", np.imag(powers))):
            ratio = float(row @ flows / (flows @ flows))
            fits = np.abs(row - ratio * flows).max() <= _NEAR * np.abs(row).max()
            factor = next(
                (
                    t
                    for f, t in known.items()
                    if abs(abs(ratio) / f - 1) < _NEAR and abs(f - 1) > 0.5
                ),
                "",
            )
            size = np.abs(flows) * np.abs(row).max() / np.abs(flows).max()
            rectified = (
                variables[name].unit != "MVA"
                and flows.min() < 0 < flows.max()
                and np.abs(np.abs(row) - size).max() <= _NEAR * np.abs(row).max()
                and np.unique(np.sign(row)).size == 1
            )
            if rectified:
                says = f"{name} shows the size of the {word} that flows, and one sign whichever way it flows"
                return failed("shown_power", "wrong sign", says)
            if fits and factor:
                says = f"{name} is declared in {variables[name].unit} and shows {abs(ratio):.4g} times the {word}"
                return failed(
                    "shown_power", "wrong units", f"{says} that flows ({factor})", ratio=ratio
                )
    return passed("shown_power", f"{', '.join(units)}: no wrong unit is seen")


def _megawatts(name: str, unit: str) -> float | None:
    """Megawatts in one of its unit, 0 for the rating; None where it is no power."""
    if unit in ("pu", "p.u.", ""):
        return 0.0 if unit and _POWER.search(name.rpartition(".")[2]) else None
    for mega in ("MW", "Mvar", "MVA"):
        try:
            return to_unit(f"1 {unit}", mega)
        except ValueError:
            continue
    return None
