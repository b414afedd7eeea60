"""How long a run has to be for a verdict: the stop that is told where one is too short, or is not judged to its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, exp

from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import Mode
from orchestrator.simulation.watch.confirmation import PERIODS
from orchestrator.simulation.watch.finding import NOT_JUDGED, Finding
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.after_events import lasting_changes
from orchestrator.studies.runs.answer_of_modes import least_damped

UNDECIDED = 0.5
"""Damping after the events [%], of either sign, that decides nothing beside a run that is long enough: what the events
leave is computed from a power flow, which the run does not reach exactly."""

_NO_RUN_NEEDED = 4.0
"""Damping after the events [%] from which on no run need be long enough to show a growth."""

_PERIODS_OF_A_SLOW_GROWTH = 30
"""Periods in which a run shows whether a mode grows that hardly decays."""

_LONGER = 1.5
"""Part of the time since the last event that a run whose end is not judged goes on to at least."""

_DECAYED = 3.0
"""Time constants after which a mode leaves 5 %: what moves the response then is no swing that decays."""

_SLOWEST = 0.05
"""Decay [1/s] at least of a mode whose decay a run is told to wait for: a minute; a slower one is not awaited."""


def seen_from(modes: ModesResult, after: ModesResult | str | None) -> float:
    """Time from which on a growth shows [s], where the modes of what the events leave do not exclude it; else 0."""
    mode = least_damped(modes)
    if mode is None or not lasting_changes(modes.prepared):
        return 0.0
    left = after if isinstance(after, ModesResult) else None
    swing = None if left is None else deciding(left)
    damping = None if swing is None else swing.damping_percent
    judged = left is not None and left.stability.stable is not None
    if judged and (damping is None or damping >= _NO_RUN_NEEDED):
        return 0.0
    slow = damping is not None and abs(damping) < UNDECIDED
    return _after(modes, swing or mode, _PERIODS_OF_A_SLOW_GROWTH if slow else PERIODS)


def growth_shows_from(modes: ModesResult, swing: Mode) -> float:
    """Time from which on a run shows whether a mode grows that hardly decays [s]."""
    return _after(modes, swing, _PERIODS_OF_A_SLOW_GROWTH)


def deciding(after: ModesResult) -> Mode | None:
    """Return the least damped mode after the events, where it swings and nothing else grows.

    What is left has voltages and powers of a power flow, where an event leaves references and admittances as they were:
    a mode's damping was up to 3 points off in systems that were tuned for it."""
    least = least_damped(after)
    grows = after.stability.mode if after.stability.stable is False else least
    if least is None or grows is None or not least.is_oscillation:
        return None
    return least if grows.eigenvalue == least.eigenvalue else None


@dataclass(frozen=True)
class LongerRun:
    """The stop of a run whose end is judged, where that of this one is not.

    ``stop``: its time [s]; ``left``: what is left of the least damped mode then, in words; "" where another reason
    decides."""

    stop: float
    left: str = ""

    @property
    def in_words(self) -> str:
        until = f" until {self.left}" if self.left else ""
        return f"{Option.STOP} {self.stop:g} goes on{until}"


def longer_run(
    modes: ModesResult, after: ModesResult | str | None, findings: Sequence[Finding]
) -> LongerRun | None:
    """Return the run that gives a verdict where the end of one is not judged; None where no longer one helps.

    It is as long as each finding asks for, as the least damped mode needs to decay, and as a growth needs to show: a
    shorter one would be sent on again."""
    at_the_end = [one for one in findings if one.kind == NOT_JUDGED and _asks_for_more(one)]
    if not at_the_end:
        return None
    last = _last_event(modes)
    longer = ceil(last + _LONGER * (modes.prepared.stop_time - last))
    asked = max((one.enough or 0.0 for one in at_the_end), default=0.0)
    least = max(float(longer), asked, seen_from(modes, after))
    mode = deciding(after) if isinstance(after, ModesResult) else least_damped(modes)
    if mode is None or not mode.is_oscillation:
        return LongerRun(least)
    decayed = last + _DECAYED / max(-mode.eigenvalue.real, _SLOWEST)
    if ceil(decayed) <= least:
        return LongerRun(least)
    left = 100 * exp(mode.eigenvalue.real * (decayed - last))
    named = f"the least damped mode, {mode.frequency_hz:.3g} Hz with {mode.damping_percent:.2g} %"
    return LongerRun(ceil(decayed), f"{named}, leaves {left:.0f} % of its swing")


def with_one_stop(
    modes: ModesResult, after: ModesResult | str | None, findings: Sequence[Finding]
) -> list[Finding]:
    """Return the findings, of which those that ask for a longer run all name the stop that the verdict names."""
    longer = longer_run(modes, after, findings)
    return list(findings) if longer is None else [one.asking_for(longer.stop) for one in findings]


def _asks_for_more(finding: Finding) -> bool:
    """Tell whether a finding is of the end; a longer run shows nothing of stretches between events."""
    return finding.until is None or finding.enough is not None


def _last_event(modes: ModesResult) -> float:
    return max((event.time for event in modes.prepared.events), default=0.0)


def _after(modes: ModesResult, mode: Mode, periods: float) -> float:
    """Return the time that is so many periods of a mode after the last event [s], in whole tenths."""
    return ceil(10 * (_last_event(modes) + periods / mode.frequency_hz)) / 10
