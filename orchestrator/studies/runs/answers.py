"""The answer to what a study was run for, one line a scenario: verdict, the mode in question, one remark."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

from rich.table import Table
from rich.text import Text

from orchestrator.core.errors import RunInterruptedError
from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import Cause
from orchestrator.output.report.tables import COLOURS, first_few, make_table, short
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.simulation.watch.confirmation import PERIODS
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.after_events import lasting_changes, same_mode
from orchestrator.studies.runs.run import RunResult
from orchestrator.systems.coupling.events import Forcing

_LONGEST = 120  # of a remark [characters]; the whole text stands among the details
# damping after events [%]: up to here it decides nothing, from here on no run need show it
_NEAR, _FAR = 0.5, 4.0
_MANY = 30  # periods in which a run shows whether a mode grows that hardly decays

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


_SMALLEST = 1e-4  # share of a mode from which on a component is named in files


@dataclass(frozen=True)
class ScenarioAnswer:
    subject: str
    good: bool | None  # whether that is good; None where it is not known
    verdict: str
    mode: Mode | None  # the least damped mode of the range
    remark: str
    # the least damped mode where the events leave something switched, and who swings in it
    after: Mode | None = None
    after_swing: str = ""
    # ``mode`` where the events leave something switched; None where no mode is clearly the same
    became: Mode | None = None

    def as_json(self) -> dict[str, Any]:
        mode = self.mode
        frequency = None if mode is None else mode.frequency_hz
        percent = None if mode is None else mode.damping_percent
        found = {
            "stable": self.good,
            "verdict": self.verdict,
            "frequency_hz": frequency,
            "damping_percent": percent,
            "components": _shares(mode),
            "remark": self.remark,
        }
        if self.after is None:
            return found
        after = eigenvalue_json(self.after.eigenvalue, self.after.damping_percent)
        became = self.became
        same = (
            None if became is None else eigenvalue_json(became.eigenvalue, became.damping_percent)
        )
        whole = {**after, "components": _shares(self.after), "same_mode": same}
        return found | {"after_events": whole}

    @property
    def another_after(self) -> Mode | None:
        """The least damped mode after the events, where it is not, or not clearly, the one before them."""
        return None if self.after is self.became else self.after


def _shares(mode: Mode | None) -> dict[str, float]:
    if mode is None:
        return {}
    return {name: share for name, share in mode.by_component.items() if share >= _SMALLEST}


def of_modes(result: ModesResult) -> ScenarioAnswer:
    verdict, mode = (
        result.stability,
        min(result.modes, key=lambda m: m.damping_percent, default=None),
    )
    swing = "" if mode is None else _swing(result, mode)
    remark = swing
    if verdict.stable is None:
        remark = swing if result.misfits else verdict.reason
    elif verdict.stable is False and verdict.mode is not None:
        low, high = (0.0, 0.0) if result.hidden is None else result.hidden.frequency_range
        hertz = verdict.mode.frequency_hz
        where = (
            ""
            if low <= hertz <= high
            else f" at {hertz:.4g} Hz"
            if hertz
            else " without oscillation"
        )
        by = f": {verdict.mode.participation[0][0]}" if where and verdict.mode.participation else ""
        because = "" if verdict.cause is not Cause.COUPLING else "; cause: the coupling"
        remark = f"grows at {verdict.mode.eigenvalue.real:+.3g} 1/s{where}{by}{because}"
        if swing and not where:
            remark += f"; {swing}"
        elif mode is not None and mode.eigenvalue.real > 0:
            remark += f"; the mode at {mode.frequency_hz:.3f} Hz grows as well: {swing}"
    told = [remark] if remark else []
    told += [
        f"{name}: {m.frequency_hz:.3f} Hz, {m.damping_percent:.2f} %"
        for name, m in _named_elsewhere(result, mode)
    ]
    told += [f"which mode is {name!r} is not known" for name in result.unnamed]
    remark = _with_misfits(result, "; ".join(told))
    return ScenarioAnswer(result.prepared.subject, verdict.stable, verdict.verdict, mode, remark)


def _named_elsewhere(result: ModesResult, least: Mode | None) -> list[tuple[str, Mode]]:
    """The only mode that the case looks for, where another one is damped less."""
    looked_for = (
        list(result.named.items()) if len(result.prepared.case.table.analysis.modes) == 1 else []
    )
    return [(name, mode) for name, mode in looked_for if mode is not least]


def of_run(result: RunResult) -> ScenarioAnswer:
    """By what the run showed, and by the eigenvalues before its events and after them."""
    answer = _by_response(result)
    if not isinstance(after := result.after, ModesResult):
        return answer
    left, swing = of_modes(after), _deciding(after)
    if (
        swing
        and swing.damping_percent < _NEAR
        and (swing.damping_percent > -_NEAR or _settles(result, answer, swing))
    ):
        told = f"{answer.remark}; {swing.damping_percent:+.2f} % after the events, by a power flow, decides nothing"
        remark = told if answer.good else answer.remark
        return _with_after(replace(answer, remark=remark), result.modes, after, swing)
    if left.good is False and answer.good is not False:
        remark = short(f"the system that the events leave: {left.remark}", _LONGEST)
        answer = replace(answer, good=False, verdict="UNSTABLE", remark=remark)
    return _with_after(answer, result.modes, after, left.mode)


def _with_after(
    answer: ScenarioAnswer, before: ModesResult, after: ModesResult, least: Mode | None
) -> ScenarioAnswer:
    """The answer with the least damped mode after the events, beside what became of the one before them."""
    if least is None:
        return answer
    became = None if answer.mode is None else same_mode(before, answer.mode, after)
    return replace(answer, after=least, after_swing=_swing(after, least), became=became)


def _by_response(result: RunResult) -> ScenarioAnswer:
    by_modes = of_modes(result.modes)
    title, mode = by_modes.subject, by_modes.mode
    if isinstance(result.failure, RunInterruptedError):
        return ScenarioAnswer(
            title, None, "interrupted", mode, short(str(result.failure), _LONGEST)
        )
    if result.went_unstable:
        worst = result.went_unstable[0]
        what = f"{worst.component}: {KINDS[worst.kind]} from {worst.time:.4g} s"
        return ScenarioAnswer(title, False, "UNSTABLE", mode, _with_misfits(result.modes, what))
    if result.failure is not None:
        return ScenarioAnswer(title, False, "failed", mode, short(str(result.failure), _LONGEST))
    if by_modes.good is False:
        return by_modes
    missing = result.missing_limits
    if missing:
        names = ", ".join(dict.fromkeys(finding.component for finding in missing))
        table = result.modes.prepared.case.table
        how = (
            "--set models=emt"
            if table.models and table.emt.step_size
            else "EMT models, whose names lack `_phasor`"
        )
        remark = f"the current limit of {names} would act, which the model lacks: repeat with {how}"
        return ScenarioAnswer(title, None, "not known", mode, short(remark, _LONGEST))
    end = result.modes.prepared.stop_time
    later = ", ".join(f"{time:g} s" for time in result.modes.prepared.not_reached)
    if result.before_its_events:
        remark = f"the run ends at {end:g} s, before its events (t = {later}): without --stop it reaches them"
        return ScenarioAnswer(title, None, "not known", mode, short(remark, _LONGEST))
    if result.stable_in_simulation is None:
        return ScenarioAnswer(
            title, None, "not known", mode, "not judged throughout; the findings say where and why"
        )
    if by_modes.good is None:
        return by_modes
    if not result.modes.prepared.events:
        return replace(
            by_modes, remark="; ".join(filter(None, ("no event disturbs it", by_modes.remark)))
        )
    forced = [
        e for e in result.modes.prepared.events if isinstance(e, Forcing) and (e.end or end) >= end
    ]
    if forced:
        names = ", ".join(dict.fromkeys(f"{e.component}.{e.variable}" for e in forced))
        remark = f"keeps synchronism until {end:g} s; {names}: forced until then, so settling is not judged"
        return ScenarioAnswer(title, None, "not known", mode, short(remark, _LONGEST))
    wanted = _seen_from(result, mode)
    if wanted > end:
        remark = (
            f"the run is too short to show whether what the events leave settles: --stop {wanted:g}"
        )
        return ScenarioAnswer(title, None, "not known", mode, short(remark, _LONGEST))
    rest = f", before the events at {later}" if later else ""
    rest += f"; {by_modes.remark}" if by_modes.remark else ""
    said = f"keeps synchronism and settles until {end:g} s{rest}"
    return ScenarioAnswer(title, True, "stable", mode, short(said, _LONGEST))


def _seen_from(result: RunResult, mode: Mode | None) -> float:
    """Time from which on a growth shows [s], where the modes of what the events leave do not exclude it; else 0."""
    after = result.after if isinstance(result.after, ModesResult) else None
    swing = _deciding(after) if after else None
    judged = after is not None and after.stability.stable is not None
    open_ = not judged or (swing is not None and swing.damping_percent < _FAR)
    if mode is None or not open_ or not lasting_changes(result.modes.prepared):
        return 0.0
    return _after(
        result, swing or mode, _MANY if swing and abs(swing.damping_percent) < _NEAR else PERIODS
    )


def _after(result: RunResult, mode: Mode, periods: float) -> float:
    """So many periods of a mode after the last event [s]."""
    return (
        ceil(
            10
            * (
                max(event.time for event in result.modes.prepared.events)
                + periods / mode.frequency_hz
            )
        )
        / 10
    )


def _settles(result: RunResult, answer: ScenarioAnswer, swing: Mode) -> bool:
    """Return whether a run that is long enough to show a growth of the mode shows none."""
    return bool(answer.good) and result.modes.prepared.stop_time >= _after(result, swing, _MANY)


def _deciding(after: ModesResult) -> Mode | None:
    """The least damped mode after the events, where nothing else grows.

    What is left has voltages and powers of a power flow, where an event leaves references and admittances as they were:
    a mode's damping was up to 3 points off in systems that were tuned for it."""
    least = min(after.modes, key=lambda mode: mode.damping_percent, default=None)
    grows = after.stability.mode if after.stability.stable is False else least
    if (
        least is None
        or grows is None
        or grows.eigenvalue != least.eigenvalue
        or not least.is_oscillation
    ):
        return None
    return least


def _with_misfits(result: ModesResult, remark: str) -> str:
    faults = [
        f"{name}: {', '.join(m.fault for m in found)}" for name, found in result.misfits.items()
    ]
    return short("; ".join([*faults, remark] if remark else faults), _LONGEST)


def answers_table(answers: Sequence[ScenarioAnswer], frequency_range: tuple[float, float]) -> Table:
    low, high = frequency_range
    table = make_table("", "Scenario", "Verdict", "f [Hz]", "Damping [%]", left=2)
    table.title = None
    when = ", before → after the events" if any(answer.became for answer in answers) else ""
    table.add_column(
        f"Least damped mode from {low:g} to {high:g} Hz{when}: who swings; remark", overflow="fold"
    )
    for answer in answers:
        word = Text(answer.verdict, style=f"bold {COLOURS[answer.good]}")
        figures = _figures([mode for mode in (answer.mode, answer.became) if mode])
        table.add_row(answer.subject, word, *figures, answer.remark)
        if another := answer.another_after:
            which = "another mode" if answer.became else "not clearly the same mode"
            who = f": {answer.after_swing}" if answer.after_swing else ""
            remark = f"least damped after the events, {which}{who}"
            table.add_row("", "", *_figures([another]), short(remark, _LONGEST))
    return table


def _figures(modes: Sequence[Mode]) -> tuple[str, str]:
    """Frequency and damping of one mode, before and after the events."""
    hertz = " → ".join(f"{mode.frequency_hz:.3f}" for mode in modes)
    percent = " → ".join(f"{mode.damping_percent:.2f}" for mode in modes)
    return hertz or "–", percent or "–"


def outside(results: Sequence[ModesResult]) -> str:
    """How many modes lie outside of the range, which are mostly the network's own; "" where it is not known."""
    counts = sorted({r.hidden.count for r in results if r.hidden is not None})
    if not counts or counts == [0]:
        return ""
    number = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    swings = max(
        (r.hidden for r in results if r.hidden is not None),
        key=lambda hidden: len(hidden.electromechanical),
    )
    wide = (
        f", of which machines swing in {len(swings.electromechanical)}"
        if swings.electromechanical
        else ""
    )
    return f"Outside of the range: {number} oscillatory modes{wide}; --details tells of them."


def _swing(result: ModesResult, mode: Mode) -> str:
    said = mode.swing_groups(result.swing).words(lambda side: first_few(side, str))
    return said or ", ".join(state for state, _ in mode.participation[:2])


@dataclass(frozen=True)
class EarlyEnd:
    """Where a study ended before its time, and what is not there because of that."""

    scenario: str
    interrupted: bool
    kept: bool = True
    not_begun: Mapping[str, str] = field(default_factory=dict)

    @property
    def word(self) -> str:
        return "interrupted" if self.interrupted else "failed"

    @property
    def place(self) -> str:
        """Where it ended, and what never began."""
        rest = f"; never begun: {', '.join(self.not_begun.values())}" if self.not_begun else ""
        return f"in {self.scenario}{'' if self.kept else ', of which nothing is kept'}{rest}"

    def as_json(self) -> dict[str, Any]:
        return {"word": self.word, "place": self.place, "not_begun": list(self.not_begun)}
