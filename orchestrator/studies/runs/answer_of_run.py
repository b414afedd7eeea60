"""The answer of a run: what it showed, beside the eigenvalues before its events and after them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from orchestrator.core.errors import RunInterruptedError, few
from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import Mode
from orchestrator.simulation.watch.finding import (
    EXCURSION,
    INTERRUPTION,
    LIMIT,
    STALL,
    TRIP,
    Finding,
    Kind,
)
from orchestrator.simulation.watch.own_trips import OWN_TRIPS
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.after_events import same_mode
from orchestrator.studies.runs.answer import ScenarioAnswer
from orchestrator.studies.runs.answer_of_modes import of_modes, swing_of, with_misfits
from orchestrator.studies.runs.long_enough import (
    UNDECIDED,
    deciding,
    growth_shows_from,
    longer_run,
    seen_from,
)
from orchestrator.studies.runs.run import RunResult
from orchestrator.studies.runs.settling import has_settled
from orchestrator.systems.coupling.events import Forcing

_TRIPS_NAMED = 2  # trips of relays that an answer names; the others are counted

KINDS = {
    "growth": "grows",
    "growing_oscillation": "an oscillation grows",
    "sustained_oscillation": "oscillates on",
    "run_away": "runs away",
    "loss_of_synchronism": "loses synchronism",
    "not_finite": "values are no numbers",
    "failure": "fails",
}
"""In words, the findings that no stable system gives."""


def of_run(result: RunResult) -> ScenarioAnswer:
    """Return the answer of a run by what it showed, and by the eigenvalues before its events and after them."""
    answer = _with_trips(_with_limits(_of_run(result), result), result)
    but = _lost(result) if answer.good else ""
    return replace(answer, but=but, quiet_relays=_of_quiet_relays(result))


def _with_limits(answer: ScenarioAnswer, result: RunResult) -> ScenarioAnswer:
    """Return the answer with the limits that begin to act and still do at the end, which the modes do not have."""
    if answer.good is False or answer.mode is None:
        return answer
    acting: dict[str, list[str]] = {}
    for one in result.findings:
        to_the_end = one.kind == LIMIT and one.represented and one.until is None
        if to_the_end and one.time > 0:
            acting.setdefault(one.what, []).append(one.component)
    if not acting:
        return answer
    told = [f"the {what} of {few(names, _TRIPS_NAMED)}" for what, names in acting.items()]
    acts = "acts" if len(told) == 1 and len(next(iter(acting.values()))) == 1 else "act"
    remark = f"{few(told, 1)} {acts} at the end, and modes are those without it"
    return replace(answer, remark="; ".join(filter(None, [remark, answer.remark])))


def _with_trips(answer: ScenarioAnswer, result: RunResult) -> ScenarioAnswer:
    """Return the answer with who was tripped, stalled, interrupted or far off, before all else that it remarks."""
    by_relays = [f"{trip.relay.of} at {trip.time:.4g} s" for trip in result.trips]
    inside = [one for one in _of_kind(result, TRIP) if one.variable in OWN_TRIPS]
    told = [
        f"{who} {few(list(dict.fromkeys(names)), _TRIPS_NAMED)}"
        for who, names in (
            ("relays trip", by_relays),
            ("own trips of", _who_and_when(inside)),
            ("motors that stall:", _who_and_when(_of_kind(result, STALL))),
            ("a speed leaves its band and comes back:", _who_and_when(_of_kind(result, EXCURSION))),
            (
                "DC lines that are blocked or bypassed:",
                _who_and_when(_of_kind(result, INTERRUPTION)),
            ),
        )
        if names
    ]
    if not told:
        return answer
    return replace(answer, remark="; ".join(filter(None, [*told, answer.remark])))


def _lost(result: RunResult) -> str:
    """Tell of motors that stall and DC lines that are off at the end, which no verdict counts; "" elsewhere.

    A DC line that is blocked in a fault and comes back is as its control is meant."""
    motors = [one.component for one in _of_kind(result, STALL)]
    interrupted = [one for one in _of_kind(result, INTERRUPTION) if one.until is None]
    lines = list(dict.fromkeys(one.component for one in interrupted))
    told = []
    if motors:
        told.append(f"{motors[0]} stalls" if len(motors) == 1 else f"{len(motors)} motors stall")
    if lines:
        several = f"{len(lines)} DC lines are off at the end"
        told.append(several if lines[1:] else f"the DC line of {lines[0]} is off at the end")
    return " and ".join(told)


def _of_quiet_relays(result: RunResult) -> str:
    """Tell that no relay trips, and which came nearest, or that a code has nobody to trip; "" elsewhere."""
    prepared = result.modes.prepared
    if not prepared.relays:
        code = prepared.case.table.protection
        return f"{code} trips nobody: no converter is there that it protects" if code else ""
    if result.trips:
        return ""
    nearest = result.nearest
    if nearest is None:
        return "no relay trips, none is beyond its limits"
    who = f"{nearest.relay.record} of {nearest.relay.of}"
    if nearest.decided:
        return f"no relay trips by the end, but {who} would after it: its breaker is opening"
    delay = nearest.relay.limits.delay
    return f"no relay trips (nearest: {who}, {nearest.longest:.3g} of {delay:.3g} s)"


def _of_kind(result: RunResult, kind: Kind) -> list[Finding]:
    return [one for one in result.findings if one.kind == kind]


def _who_and_when(findings: Sequence[Finding]) -> list[str]:
    return [f"{one.component} at {one.time:.4g} s" for one in findings]


def _of_run(result: RunResult) -> ScenarioAnswer:
    answer = _by_response(result)
    after = result.after
    if not isinstance(after, ModesResult):
        return answer
    left, swing = of_modes(after), deciding(after)
    if swing is not None and _is_undecided(result, answer, swing):
        if answer.good:
            told = (
                f"{swing.damping_percent:+.2f} % after the events, by a power flow, decides nothing"
            )
            answer = replace(answer, remark=f"{answer.remark}; {told}")
        return _with_after(answer, result.modes, after, swing)
    if left.good is False and answer.good is not False:
        remark = f"the system that the events leave: {left.remark}"
        answer = replace(answer, good=False, verdict="UNSTABLE", remark=remark)
    return _with_after(answer, result.modes, after, left.mode)


def _is_undecided(result: RunResult, answer: ScenarioAnswer, swing: Mode) -> bool:
    """Tell whether the mode after the events decides nothing: near zero, or growing where a long run shows none."""
    damping = swing.damping_percent
    if damping >= UNDECIDED:
        return False
    return damping > -UNDECIDED or _settles(result, answer, swing)


def _with_after(
    answer: ScenarioAnswer, before: ModesResult, after: ModesResult, least: Mode | None
) -> ScenarioAnswer:
    """The answer with the least damped mode after the events, beside what became of the one before them."""
    if least is None:
        return answer
    became = None if answer.mode is None else same_mode(before, answer.mode, after)
    return replace(answer, after=least, after_swing=swing_of(after, least), became=became)


# -- what the run itself showed -------------------------------------------------------------------


@dataclass(frozen=True)
class _Response:
    """A run, and the answer of the eigenvalues before its events."""

    result: RunResult
    by_modes: ScenarioAnswer

    @cached_property
    def end(self) -> float:
        """Time at which the run stops [s]."""
        return self.result.modes.prepared.stop_time

    @cached_property
    def later(self) -> str:
        """Times of the events that the run does not reach, in words."""
        return ", ".join(f"{time:g} s" for time in self.result.modes.prepared.not_reached)

    def answer(self, good: bool | None, verdict: str, remark: str) -> ScenarioAnswer:
        return ScenarioAnswer(self.by_modes.subject, good, verdict, self.by_modes.mode, remark)

    def not_known(self, remark: str) -> ScenarioAnswer:
        return self.answer(None, "not known", remark)


def _by_response(result: RunResult) -> ScenarioAnswer:
    shown = _Response(result, of_modes(result.modes))
    answers = (rule(shown) for rule in _RULES)
    return next(answer for answer in answers if answer is not None)


def _of_an_interruption(shown: _Response) -> ScenarioAnswer | None:
    failure = shown.result.failure
    if not isinstance(failure, RunInterruptedError):
        return None
    return shown.answer(None, "interrupted", str(failure))


def _of_what_grew(shown: _Response) -> ScenarioAnswer | None:
    if not shown.result.went_unstable:
        return None
    worst = shown.result.went_unstable[0]
    what = f"{worst.component}: {KINDS[worst.kind]} from {worst.time:.4g} s"
    return shown.answer(False, "UNSTABLE", with_misfits(shown.result.modes, what))


def _of_a_failure(shown: _Response) -> ScenarioAnswer | None:
    if shown.result.failure is None:
        return None
    return shown.answer(False, "failed", str(shown.result.failure))


def _of_modes_that_grow(shown: _Response) -> ScenarioAnswer | None:
    return shown.by_modes if shown.by_modes.good is False else None


def _of_a_missing_limit(shown: _Response) -> ScenarioAnswer | None:
    missing = shown.result.missing_limits
    if not missing:
        return None
    names = ", ".join(dict.fromkeys(finding.component for finding in missing))
    table = shown.result.modes.prepared.case.table
    both = table.models and table.emt.step_size
    how = (Option.SET + " models=emt") if both else "EMT models, whose names lack `_phasor`"
    return shown.not_known(
        f"the current limit of {names} would act, which the model lacks: repeat with " + how
    )


def _of_an_early_stop(shown: _Response) -> ScenarioAnswer | None:
    if not shown.result.before_its_events:
        return None
    return shown.not_known(
        f"the run ends at {shown.end:g} s, before its events (t = {shown.later}): "
        "without " + Option.STOP + " it reaches them"
    )


def _of_a_response_not_judged(shown: _Response) -> ScenarioAnswer | None:
    if shown.result.stable_in_simulation is not None:
        return None
    result = shown.result
    longer = longer_run(result.modes, result.after, result.findings)
    further = "" if longer is None else f"; {longer.in_words}"
    return shown.not_known(f"not judged throughout; the findings say where and why{further}")


def _of_modes_not_known(shown: _Response) -> ScenarioAnswer | None:
    return shown.by_modes if shown.by_modes.good is None else None


def _of_no_event(shown: _Response) -> ScenarioAnswer | None:
    if shown.result.modes.prepared.events:
        return None
    remark = "; ".join(filter(None, ("no event disturbs it", shown.by_modes.remark)))
    return replace(shown.by_modes, remark=remark)


def _of_a_forcing(shown: _Response) -> ScenarioAnswer | None:
    events = (e for e in shown.result.modes.prepared.events if isinstance(e, Forcing))
    names = dict.fromkeys(
        f"{e.component}.{e.variable}" for e in events if (e.end or shown.end) >= shown.end
    )
    if not names:
        return None
    return shown.not_known(
        f"keeps synchronism until {shown.end:g} s; {', '.join(names)}: forced until then, so settling is not judged"
    )


def _of_a_short_run(shown: _Response) -> ScenarioAnswer | None:
    wanted = seen_from(shown.result.modes, shown.result.after)
    if wanted <= shown.end:
        return None
    return shown.not_known(
        "the run is too short to show whether what the events leave settles: "
        + Option.STOP
        + f" {wanted:g}"
    )


def _of_settling(shown: _Response) -> ScenarioAnswer:
    rest = f", before the events at {shown.later}" if shown.later else ""
    rest += f"; {shown.by_modes.remark}" if shown.by_modes.remark else ""
    mode = shown.by_modes.mode
    periods = [1 / mode.frequency_hz] if mode is not None and mode.is_oscillation else []
    settled = has_settled(shown.result, *periods)
    word = "; has not settled" if settled is False else " and settles"
    return shown.answer(True, "stable", f"keeps synchronism{word} by {shown.end:g} s{rest}")


_RULES: tuple[Callable[[_Response], ScenarioAnswer | None], ...] = (
    _of_an_interruption,
    _of_what_grew,
    _of_a_failure,
    _of_modes_that_grow,
    _of_a_missing_limit,
    _of_an_early_stop,
    _of_a_response_not_judged,
    _of_modes_not_known,
    _of_no_event,
    _of_a_forcing,
    _of_a_short_run,
    _of_settling,
)
"""What decides the answer of a run, the first that applies: what it showed comes before what the eigenvalues say, and
what leaves an answer open before a good one."""


def _settles(result: RunResult, answer: ScenarioAnswer, swing: Mode) -> bool:
    """Tell whether a run that is long enough to show a growth of the mode shows none."""
    seen = growth_shows_from(result.modes, swing)
    return bool(answer.good) and result.modes.prepared.stop_time >= seen
