"""All that is watched, put together."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.events import Event
from orchestrator.coupling.recorder import Recorder
from orchestrator.coupling.system import System
from orchestrator.errors import ComponentError, CosimError, NotFiniteError
from orchestrator.watch.finding import Finding, Kind
from orchestrator.watch.limits import active_limits, limit_signals
from orchestrator.watch.response import resting_signals, unsettled_response
from orchestrator.watch.run_away import run_away, speed_signals
from orchestrator.watch.seen import Seen, Watcher, look_every
from orchestrator.watch.settings import Settings
from orchestrator.watch.stretches import Stretch, stretches
from orchestrator.watch.synchronism import angle_signals, lost_synchronism
from orchestrator.watch.undisturbed import undisturbed_motion


class Watch:
    """Watches one run of a scenario.

    What is coupled is watched at every communication step: whether it is a number, its extremes, how often it turns.
    Everything else is watched at looks, some milliseconds apart: what is recorded, limits and angles.

    Attributes
    ----------
    observers
        To be given to the run, in this order.
    recorder
        The scenario's own.
    """

    def __init__(self, prepared: PreparedScenario) -> None:
        self._prepared = prepared
        self.recorder = Recorder(prepared.record, prepared.record_every)
        every = look_every(prepared.step_size, prepared.record_every, prepared.stop_time)
        needed = dict.fromkeys(
            [*limit_signals(prepared.system), *angle_signals(prepared.system), *speed_signals(prepared.system)]
        )
        at_each_look = set(prepared.record) if every % prepared.record_every == 0 else set()
        self._watcher = Watcher([name for name in needed if name not in at_each_look], every)
        self.observers = (self.recorder, self._watcher)

    def findings(self, failure: CosimError | None = None) -> list[Finding]:
        """What was wrong, in the order of its beginning; after the run, also after one that failed."""
        seen = self._watcher.seen(self.recorder)
        told = judged(seen, self._prepared.system, self._prepared.events) if len(seen.times) > 1 else ()
        found = chain(_failure(failure), _not_finite(seen), told)
        return sorted(found, key=lambda finding: finding.time)


def judged(seen: Seen, system: System, events: Sequence[Event]) -> list[Finding]:
    """All that the signals show."""
    settings = Settings(system, events, seen.times)
    end = float(seen.times[-1])
    happened = [time for time in settings.effective_times() if time < end]
    undisturbed = list(undisturbed_motion(seen, system, happened[0] if happened else end))
    lost = list(lost_synchronism(seen, system, settings))
    parts = stretches(seen, resting_signals(seen, system), happened or [0.0])
    if happened and happened[0] > 0:
        parts.insert(0, Stretch(0.0, happened[0]))
    found = [
        *undisturbed,
        *active_limits(seen, system, settings),
        *lost,
        *run_away(seen, system, settings, parts, slipped=bool(lost)),
    ]
    if any(finding.figures["slips_at_the_end"] for finding in lost):
        return found  # everything swings with the slip
    if happened and [finding.kind for finding in undisturbed] != ["undisturbed_motion"]:
        parts = [part for part in parts if part.begin >= happened[0]]
    units = [name for name, plan in system.components.items() if "omega" in plan.description.outputs]
    return [*found, *_first_of_each(_responses(seen, system, parts, units))]


def _responses(seen: Seen, system: System, parts: Sequence[Stretch], units: Sequence[str]) -> Iterator[Finding]:
    """What is found in each stretch as a whole, or else between its events that nobody notices."""
    for part in parts:
        whole = unsettled_response(seen, system, part, units)
        yield from whole
        if part.breaks and not whole:
            for piece in part.parts():
                yield from unsettled_response(seen, system, piece, units)


def _first_of_each(found: Iterable[Finding]) -> list[Finding]:
    """The first finding of each kind, which says that there are others."""
    by_kind: dict[Kind, list[Finding]] = {}
    for finding in found:
        by_kind.setdefault(finding.kind, []).append(finding)
    return [
        replace(first, message=f"{first.message}; the same again from t = {again[0].time:.4g} s") if again else first
        for first, *again in by_kind.values()
    ]


def _failure(error: CosimError | None) -> Sequence[Finding]:
    """A run that a component ended."""
    if not isinstance(error, ComponentError):
        return ()
    time = error.time or 0.0
    if isinstance(error, NotFiniteError):
        return (Finding("not_finite", time, error.component, error.variable, str(error)),)
    return (Finding("failure", time, error.component, "", str(error)),)


def _not_finite(seen: Seen) -> Sequence[Finding]:
    """Signals that nothing is coupled to, each once."""
    found = []
    for name, signal in seen.values.items():
        bad = np.flatnonzero(~np.isfinite(signal))
        if len(bad) and name not in seen.last:
            time, (component, _, variable) = float(seen.times[bad[0]]), name.partition(".")
            message = (
                f"{name} is no finite number ({signal[bad[0]]}) at t = {time:.6g} s, and so in "
                f"{len(bad)} of {len(signal)} looks"
            )
            found.append(Finding("not_finite", time, component, variable, message))
    return found
