"""The check of a damping controller (POD) in swings of every size and direction, at other points, steps and times."""

from collections.abc import Iterator
from math import exp
from typing import Any

import numpy as np

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.damping_memory import (
    DampingFault,
    find_growth,
    find_tiredness,
    find_unrest,
    find_windup,
)
from orchestrator.devices.acceptance.checks.damping_swings import (
    LATE_LOOKS,
    LOOKS,
    DampingBench,
    Effect,
    FrequencySwing,
    answer_size,
    controllers,
    likeness,
    ratio,
)
from orchestrator.devices.acceptance.checks.port import cannot_import, without_start
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject

_POINT = OperatingAt(1.0, 0.0, 0.4, 0.05)
_USUAL = 0.03  # peak of the output in the usual swing [pu, S_n]
_OF_LIMIT = 0.25  # the same in parts of a limit that is known
_SIZES = (
    1e-4,
    1e-3,
    5e-3,
)  # swings of the frequency [pu] of which the first that shows an answer is taken
_SMALL = 0.1  # other swings, in parts of the usual one
_LARGE = 3.0
_BEYOND = 12.0
_LARGEST = 0.006  # largest swing of the frequency [pu] in which its output is compared
_EVEN = 0.1  # part of the answer by which it may differ where nothing but size or direction differs
_ALIKE = 0.8  # correlation of two courses of one controller at different points
_ALIKE_AT_LIMIT = 0.6  # the same where a limit cuts one of them, and stops what integrates
_AT_LIMIT = 0.9  # output in parts of its declared limit from which that cuts it
_LEAST = 0.5  # how much smaller an answer may be at another point
_MOST = 2.0  # how much larger
_SAME_TIME = 0.05  # part of the answer by which it may differ at another time or step
_DAMAGED = 0.4  # part of the answer by which it may differ soon after events
_TIRED = 0.2  # the same if its answer fell short of what it should be while it worked: the cause is then its work
_PROPORTION = 0.15  # part of the answer by which that to a larger swing below the limit may differ
_LESS = 0.9  # how much smaller the answer to a larger swing may be
_OF_POWER = 0.85  # least power in parts of the declared limit, where its output is not shown
_FLAT = 0.05  # part by which the power may differ in two deviations that both reach the limit
_TO_LIMIT = 2.0  # the smaller of these deviations, in parts of the one whose swing gives the limit
_BEYOND_LIMIT = 3.0
_NOISE = 1e-7  # power [pu, S_n] that is rounding
_WITH = 0.5  # correlation with the frequency from which an output is told to go with it
_PUSHED = 3.0  # its duration [s]
_LIMIT = 0.03  # part of the declared limit by which the output's peak may differ from it
_HELD = 0.93  # part of its answer to a lasting deviation that a controller without a washout keeps
_SLOWER = 0.15  # part by which it may keep more than its declared washout lets it
_STAYS = 0.2  # part of its answer that seems to stay for ever, from which it is watched for longer
_BENT = 1e-3  # the same by which three looks have to be bent to tell what stays
_LEFT = 0.1  # part of the usual answer below which nothing is left to judge
_PART_OF_SWING = (
    0.75  # a second swing beyond that, in parts of the first: at a limit both bring the same
)
_RESTS = 60.0  # time at rest after which it is asked again [s]
_WAITS = (10.0, _RESTS)  # times at rest after which one that is silent at first is asked again [s]
_SOON = 2.0  # time after events [s]
_LATE = 15.0  # time after events of a second look [s]

_PLACES = (
    ((1.0, 1.0), (0.84, 0.95)),
    ((1.0, 1.0), (0.6, 0.75)),
    ((1.0, 1.0), (0.05, 0.2)),
    ((1.0, 1.0), (0.0, 0.03)),
    ((1.0, 1.0), (-0.2, -0.05)),
    ((1.0, 1.0), (-0.6, -0.4)),
    ((1.0, 1.0), (-0.9, -0.75)),
    ((0.9, 0.93), (0.3, 0.6)),
    ((0.94, 0.965), (0.3, 0.6)),
    ((1.035, 1.06), (0.3, 0.6)),
    ((1.08, 1.1), (0.3, 0.6)),
)
"""Bounds of voltage and power [pu] between which the points are drawn."""
_REACTIVE = ((-0.4, -0.25), (0.25, 0.4))
"""Bounds of reactive power [pu, S_n] of further points, at little power."""
_TURNED = (1.2, 2.8)
"""Bounds of the voltage's angle [rad] at these, forth and back."""


_ASK_FOR_ITS_SIGN = (
    "ask whether its sign is meant: `gfor modes CASE` with it on and off shows what it damps"
)


_ASK_FOR_ITS_SAMPLING = "ask for its sample time: half of it is a delay that studies have to hold"


@check(
    "pod",
    "Does its damping controller work for every size, direction, point, step and time?",
    needs=(*SAME, "steady_state", "power_balance"),
)
def pod(subject: Subject) -> CheckResult:
    """Swing the network's frequency with the damping controllers on and off; what differs is theirs."""
    if not subject.starts:
        return without_start("pod", subject)
    names = controllers(subject)
    if not names:
        return not_applicable(
            "pod",
            "because no damping controller is known: bind its switch as "
            '[signals."pod_p.enabled"] or [signals."pod_q.enabled"]',
        )
    bench = DampingBench(subject, names, _POINT)
    trial = _Trial(bench)
    tried = 0
    for fault in trial.faults():
        if fault is not None:
            return failed("pod", fault.name, fault.words)
        tried += 1
    says = f"{' and '.join(bench.titles)}: {tried} comparisons of sizes, directions, points, steps "
    says += f"and times are alike, in a swing of {bench.hertz:.3g} Hz"
    says += f"; {len(trial.passed_over)} points were not tried" if trial.passed_over else ""
    says += "".join(f"; {limit}, is beyond what it gives in any swing" for limit in trial.unreached)
    figures: dict[str, Any] = {"tried": tried}
    sampled = trial.is_sampled()
    if sampled:
        return remarked("pod", f"{says}; {sampled}", _ASK_FOR_ITS_SAMPLING, **figures)
    turned = trial.goes_with_frequency()
    if turned:
        return remarked("pod", f"{says}; {turned}", _ASK_FOR_ITS_SIGN, **figures)
    if trial.moved_on:
        figures["not_judged"] = "what events leave in its damping controller"
    return passed("pod", says, **figures)


class _Trial:
    """The comparisons, from the one that explains most to the one that explains least."""

    def __init__(self, bench: DampingBench) -> None:
        self._bench = bench
        self._size = 0.0
        self._usual: tuple[Effect, ...] = ()
        self.passed_over: list[OperatingAt] = []
        self.unreached: list[str] = []  # limits that no swing of a network's frequency reaches
        self.moved_on = False  # whether it came back from no events

    def faults(self) -> Iterator[DampingFault | None]:
        """Yield one answer for each comparison: a fault, or None where it is alike."""
        silent = self._find_size()
        yield silent
        if silent is not None:
            return
        yield find_unrest(self._bench, self._usual)
        yield find_growth(self._bench, self._usual, self._size)
        yield self._other_direction()
        yield self._smaller()
        yield from self._limits()
        yield self._larger()
        yield from self._elsewhere()
        yield from self._other_steps()
        yield self._later_start()
        yield self._after_rest()
        yield self._after_events()
        yield self._after_switching()
        yield find_windup(self._bench, self._usual, self._size)
        yield self._after_work(_DAMAGED)
        yield from self._lasting()

    def is_sampled(self) -> str:
        """Say which output stands still for most of the steps; "" if none does."""
        slow = [one for one in self._usual if one.sample_time]
        return "; ".join(
            f"the output of {one.title} moves once in {1e3 * one.sample_time:.3g} ms"
            for one in slow
        )

    def goes_with_frequency(self) -> str:
        """Say that POD-P asks for more power while the frequency is higher; "" if it does not."""
        for name, usual in zip(self._bench.names, self._usual, strict=True):
            swing = np.sin(2 * np.pi * self._bench.hertz * usual.time)
            size = float(np.linalg.norm(swing) * np.linalg.norm(usual.course))
            along = float(swing @ usual.course) / size
            if name == "pod_p" and along > _WITH:
                return f"{usual.title} asks for more power while the frequency is higher (correlation {along:.2f})"
        return ""

    def _find_size(self) -> DampingFault | None:
        """Choose the usual swing by what it brings; a controller that brings nothing in any is dead."""
        bench = self._bench
        known = [x for x in map(bench.declared_limit, bench.names) if x]
        wanted = min([_USUAL, *(_OF_LIMIT * limit for limit in known)])
        seen: tuple[Effect, ...] = ()
        for size in _SIZES:
            seen = bench.effects(FrequencySwing(size))
            least = min(effect.least_peak for effect in seen)
            if least > answer_size(size):
                self._size = size * min(10.0, wanted / max(effect.peak for effect in seen))
                self._usual = bench.effects(FrequencySwing(self._size))
                return self._silent_in_the_usual(size, seen)
        return self._reason_of_silence(min(seen, key=lambda effect: effect.least_peak))

    def _silent_in_the_usual(self, size: float, seen: tuple[Effect, ...]) -> DampingFault | None:
        """Look for a controller that answers the swing of `size` and not the smaller one that is chosen for it."""
        for larger, usual in zip(seen, self._usual, strict=True):
            if usual.least_peak <= _NOISE:
                says = (
                    f"{usual.title} answers a swing of {1e6 * size:.3g}e-6 pu of the frequency by "
                )
                says += f"{larger.peak:.3g} pu, and one of {1e6 * self._size:.3g}e-6 pu by nothing"
                return DampingFault("POD with a dead band", says)
        return None

    def _reason_of_silence(self, dead: Effect) -> DampingFault:
        """Look later and at other points for what a controller that brings nothing at first does there."""
        says = f"{dead.title} changes nothing in a swing of {100 * _SIZES[-1]:g} % of the frequency"
        for rest in _WAITS:
            if self._answers(dead, FrequencySwing(_SIZES[-1], rest=rest)):
                says += f" that begins with the run, and answers one after {rest:g} s at rest"
                return DampingFault("POD changes with time", says)
        for point in self._places():
            if self._answers(dead, FrequencySwing(_SIZES[-1], point=point)):
                says += f" at P_0 = {_POINT.P:g}, v_0 = {_POINT.v:g}, and answers one at P_0 = {point.P:g}, "
                says += f"v_0 = {point.v:g}"
                says += f", Q_0 = {point.Q:g}" if point.Q else ""
                says += f", theta_0 = {point.theta:g}" if point.theta else ""
                return DampingFault("POD of some points only", says)
        return DampingFault("POD without effect", f"{says} at {self._bench.hertz:.3g} Hz")

    def _answers(self, dead: Effect, swing: FrequencySwing) -> bool:
        """Return whether the controller that was silent answers another swing; not where the device does not run."""
        if swing.point is not None and cannot_import(self._bench.subject, swing.point):
            return False
        try:
            found = self._bench.effects(swing)
        except ComponentError:
            return False
        return any(
            effect.title == dead.title and effect.least_peak > answer_size(swing.size)
            for effect in found
        )

    def _other_direction(self) -> DampingFault | None:
        for usual, other in zip(
            self._usual, self._bench.effects(FrequencySwing(-self._size)), strict=True
        ):
            apart = usual.apart(other)
            if apart > _EVEN:
                says = f"{usual.title} answers a swing that begins with less frequency by "
                says += f"{100 * apart:.3g} % otherwise than one that begins with more"
                return DampingFault("POD of one side", says)
        return None

    def _smaller(self) -> DampingFault | None:
        for usual, other in zip(
            self._usual, self._bench.effects(FrequencySwing(_SMALL * self._size)), strict=True
        ):
            apart = usual.apart(other)
            if apart > _EVEN:
                part = ratio(usual, other)
                says = f"{usual.title} answers a swing of {1e6 * _SMALL * self._size:.3g}e-6 pu of the frequency by "
                says += f"{100 * part:.3g} % of what one of {1e6 * self._size:.3g}e-6 pu brings in proportion"
                return DampingFault("POD with a dead band" if part < 1 else "POD uneven", says)
        return None

    def _larger(self) -> DampingFault | None:
        for times in (_LARGE, _BEYOND):
            size = min(times * self._size, _LARGEST)
            for number, other in enumerate(self._bench.effects(FrequencySwing(size))):
                usual = self._usual[number]
                alike, name = likeness(usual, other), self._bench.names[number]
                fault = self._out_of_proportion(name, usual, other)
                if fault:
                    return self._by_its_cause(fault)
                least = _ALIKE_AT_LIMIT if self._is_limited(name, other) else _ALIKE
                if alike < least and (usual.shown or times == _LARGE):
                    says = (
                        f"{usual.title} answers a swing of {1e6 * size:.3g}e-6 pu of the frequency "
                    )
                    says += f"with another course (correlation {alike:.2f}) than a smaller one"
                    fault = DampingFault("POD reversed" if alike < 0.5 else "POD uneven", says)
                    return self._by_its_cause(fault)
        return None

    def _is_limited(self, name: str, effect: Effect) -> bool:
        limit = self._bench.declared_limit(name)
        return bool(limit) and effect.peak > _AT_LIMIT * float(limit or 0.0)

    def _out_of_proportion(self, name: str, usual: Effect, other: Effect) -> DampingFault | None:
        """Compare the answer to a larger swing: in proportion below a limit that is known, never smaller."""
        says = f"{usual.title} answers a swing of {1e6 * other.size:.3g}e-6 pu of the frequency by "
        limit = self._bench.declared_limit(name)
        below = limit and usual.peak * other.size / self._size < 0.9 * limit
        apart = usual.apart(other)
        if below and likeness(usual, other) > _ALIKE and apart > _PROPORTION:
            says += f"{100 * apart:.3g} % otherwise than in proportion to one of {1e6 * self._size:.3g}e-6 pu"
            return DampingFault("POD uneven", says)
        if usual.shown and other.peak < _LESS * usual.peak:
            says += f"{other.peak:.3g} pu, less than the {usual.peak:.3g} pu of a smaller one"
            return DampingFault("POD uneven", says)
        return None

    def _limits(self) -> Iterator[DampingFault | None]:
        """Compare the output that is shown with the limit that is declared, in a swing far beyond it."""
        for number, name in enumerate(self._bench.names):
            limit, usual = self._bench.declared_limit(name), self._usual[number]
            if not limit:
                continue
            if not usual.shown:
                if name == "pod_p":
                    yield self._by_its_cause(self._limit_of_power(number, limit))
                continue
            wanted = self._size * 4.0 * limit / max(usual.peak, 1e-9)
            size = min(wanted, self._bench.widest)
            course = self._bench.effects(FrequencySwing(size))[number].course
            peaks = (float(course.max()), float(-course.min()))
            peak = max(peaks, key=lambda peak: abs(peak / limit - 1))
            if peak < limit and wanted > size and not self._is_flat(number, size):
                self.unreached.append(f"the limit of {usual.title}, {limit:g} pu")
                continue
            yield self._by_its_cause(_far_from_limit(usual.title, peak, limit))

    def _is_flat(self, number: int, size: float) -> bool:
        """Look if a smaller swing brings the same: then something limits the output, and not what it is given."""
        sizes = (size, _PART_OF_SWING * size)
        most, less = (self._bench.effects(FrequencySwing(one))[number].course for one in sizes)
        ends = ((most.max(), less.max()), (most.min(), less.min()))
        return any(abs(one - other) < _FLAT * abs(one) for one, other in ends)

    def _limit_of_power(self, number: int, limit: float) -> DampingFault | None:
        """Judge a limit by the power, where two lasting deviations both reach what limits it."""
        usual, bench = self._usual[number], self._bench
        unit = self._size * limit / max(usual.peak, 1e-9)
        if _BEYOND_LIMIT * unit > bench.widest:
            return None
        for way in (1, -1):
            sizes = (way * _TO_LIMIT * unit, way * _BEYOND_LIMIT * unit)
            less, most = (bench.plateaus(size, _PUSHED)[number] for size in sizes)
            if most < _OF_POWER * limit and abs(most - less) < _FLAT * most:
                return _far_from_limit(usual.title, most, limit)
        return None

    def _places(self) -> Iterator[OperatingAt]:
        draw = self._bench.subject.random("pod, points")
        for v, P in _PLACES:
            yield OperatingAt(
                round(float(draw.uniform(*v)), 3), 0.0, round(float(draw.uniform(*P)), 3), 0.0
            )
        turned = self._bench.subject.random("pod, angles")
        for number, Q in enumerate(_REACTIVE):
            theta = (-1) ** number * round(float(turned.uniform(*_TURNED)), 3)
            yield OperatingAt(1.0, theta, 0.3, round(float(draw.uniform(*Q)), 3))

    def _elsewhere(self) -> Iterator[DampingFault | None]:
        for point in self._places():
            if cannot_import(self._bench.subject, point):
                self.passed_over.append(point)
                continue
            try:
                found = self._bench.effects(FrequencySwing(self._size, point=point))
            except ComponentError:
                self.passed_over.append(point)
                continue
            yield self._at(point, found)

    def _at(self, point: OperatingAt, found: tuple[Effect, ...]) -> DampingFault | None:
        where = f"at P_0 = {point.P:g}, v_0 = {point.v:g}"
        where += f", Q_0 = {point.Q:g}" if point.Q else ""
        where += f", theta_0 = {point.theta:g}" if point.theta else ""
        for usual, other in zip(self._usual, found, strict=True):
            part, alike = ratio(usual, other), likeness(usual, other)
            if _LEAST < part < _MOST and alike > _ALIKE:
                continue
            says = f"{usual.title} gives {100 * part:.3g} % of its answer {where} that it gives "
            says += f"at P_0 = {_POINT.P:g}, v_0 = {_POINT.v:g}, and its course has a correlation of {alike:.2f}"
            return DampingFault("POD of some points only", says)
        return None

    def _other_steps(self) -> Iterator[DampingFault | None]:
        h = self._bench.subject.step_size
        for times, words in ((2.0, "twice"), (0.5, "half of")):
            try:
                found = self._bench.effects(FrequencySwing(self._size, step_size=times * h))
            except ComponentError:
                continue
            yield _compare(
                self._usual,
                found,
                "POD follows the step",
                f"at {words} the communication step of {h:g} s",
                within=max(1.0, times) * h,
            )

    def _later_start(self) -> DampingFault | None:
        begin = float(round(self._bench.subject.random("pod, start").uniform(1e3, 1e5)))
        found = self._bench.effects(FrequencySwing(self._size, begin=begin))
        return _compare(
            self._usual, found, "POD changes with time", f"where the run begins at {begin:g} s"
        )

    def _after_rest(self) -> DampingFault | None:
        rests = self._bench.time_left(_RESTS + self._bench.lasts) - self._bench.lasts
        if rests <= 0:
            return None
        usual = self._bench.together(FrequencySwing(self._size))
        found = self._bench.together(FrequencySwing(self._size, rest=rests))
        return _compare(usual, found, "POD changes with time", f"after {rests:.3g} s at rest")

    def _after_events(self) -> DampingFault | None:
        """Look soon after dips, jumps and an overvoltage; what is only on its way back has more time."""
        fault = None
        for wait in (_SOON, _LATE):
            parts = self._bench.apart_after_events(self._size, wait)
            if parts is None:
                self.moved_on = True
                return None
            worst = int(np.argmax(parts))
            if parts[worst] < _DAMAGED:
                return None
            says = f"{self._usual[worst].title} answers by {100 * parts[worst]:.3g} % otherwise {wait:g} s after "
            fault = DampingFault(
                "POD changed by a disturbance", f"{says}a dip, a jump, an overvoltage and a dip"
            )
        return fault

    def _after_switching(self) -> DampingFault | None:
        variables = self._bench.subject.description.variables
        if any(variables[f"{name}.enabled"].variability != "tunable" for name in self._bench.names):
            return None
        parts = self._bench.apart_after_switching(self._size)
        where = "after it was switched off and on again twice"
        return self._changed(parts, "POD changed by its switch", where)

    def _after_work(self, least: float) -> DampingFault | None:
        strong = min(_BEYOND * self._size, _LARGEST)
        return find_tiredness(self._bench, self._usual, self._size, strong, least)

    def _by_its_cause(self, fault: DampingFault | None) -> DampingFault | None:
        """Return what its limit or its work leaves in it, if that shows in a strong swing; else the fault."""
        if fault is None:
            return None
        wound = find_windup(self._bench, self._usual, self._size)
        return wound or self._after_work(_TIRED) or fault

    def _changed(self, parts: list[float], fault: str, where: str) -> DampingFault | None:
        worst = int(np.argmax(parts))
        if parts[worst] < _DAMAGED:
            return None
        says = f"{self._usual[worst].title} answers by {100 * parts[worst]:.3g} % otherwise {where}"
        return DampingFault(fault, says)

    def _lasting(self) -> Iterator[DampingFault | None]:
        """Hold another frequency: a washout lets go of it."""
        for title, name, answers in self._bench.lasting(self._size):
            if answers[0] < 0.2 * self._usual[self._bench.names.index(name)].peak:
                yield None
                continue
            yield self._keeps(title, name, answers)

    def _keeps(self, title: str, name: str, answers: list[float]) -> DampingFault | None:
        """Compare the part of its answer that it keeps for some seconds with its washout's."""
        kept, between = abs(answers[-1]) / answers[0], LOOKS[-1] - LOOKS[0]
        T_W = self._bench.value_of(f"{name}.T_W")
        declared = exp(-between / T_W) if T_W else 1.0
        says = f"{title} keeps {100 * kept:.3g} % of its answer to a lasting deviation of the frequency "
        says += f"over {between:.3g} s"
        if kept > max(_HELD, declared + 0.02):
            return DampingFault("POD without washout", says)
        stays = self._keeps_for_long(name) if _seems_to_stay(answers) else None
        if stays is None and kept > declared + _SLOWER:
            says += f", and {name}.T_W = {T_W:g} s is declared, which lets it keep {100 * declared:.3g} %"
            return DampingFault("POD washout not as declared", says)
        return stays

    def _keeps_for_long(self, name: str) -> DampingFault | None:
        """Watch for longer: a slow washout lets go of it as well, a part without one does not."""
        if self._bench.time_left(LATE_LOOKS[-1]) < LATE_LOOKS[-1]:
            return None
        number, between = self._bench.names.index(name), LATE_LOOKS[-1] - LATE_LOOKS[0]
        title, _, answers = list(self._bench.lasting(self._size, LATE_LOOKS))[number]
        T_W = self._bench.value_of(f"{name}.T_W")
        most = max(_HELD, exp(-between / T_W) + 0.02) if T_W else _HELD
        if answers[0] < _LEFT * self._usual[number].peak or answers[1] <= most * answers[0]:
            return None
        says = f"{title} keeps {100 * answers[1] / answers[0]:.3g} % of its answer to a lasting deviation of the "
        says += f"frequency from {LATE_LOOKS[0]:g} to {LATE_LOOKS[1]:g} s, {answers[1]:.3g} pu"
        return DampingFault("POD without washout", says)


def _seems_to_stay(answers: list[float]) -> bool:
    """Continue the exponential through three answers: what it comes to rest at is much of the first."""
    first, second, third = answers
    bend = first + third - 2 * second
    if abs(bend) < _BENT * first:
        return True
    return (first * third - second**2) / bend > _STAYS * first


def _far_from_limit(title: str, peak: float, limit: float) -> DampingFault | None:
    if abs(peak / limit - 1) <= _LIMIT:
        return None
    word = "more" if peak > limit else "no more"
    says = f"{title} gives {word} than {peak:.4g} pu where {limit:g} pu is declared as its limit"
    return DampingFault("POD limit not as declared", says)


def _compare(
    usual: tuple[Effect, ...],
    found: tuple[Effect, ...],
    fault: str,
    where: str,
    within: float = 0.0,
) -> DampingFault | None:
    for one, other in zip(usual, found, strict=True):
        apart = one.apart(other, within)
        if apart > _SAME_TIME:
            return DampingFault(
                fault, f"{one.title} answers by {100 * apart:.3g} % otherwise {where}"
            )
    return None
