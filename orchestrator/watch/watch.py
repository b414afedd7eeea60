"""All that is watched, put together."""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.recorder import Recorder
from orchestrator.errors import ComponentError, CosimError, NotFiniteError
from orchestrator.watch.finding import Finding
from orchestrator.watch.limits import active_limits, limit_signals
from orchestrator.watch.response import unsettled_response
from orchestrator.watch.seen import Seen, Watcher, look_every
from orchestrator.watch.settings import Settings
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
        needed = dict.fromkeys([*limit_signals(prepared.system), *angle_signals(prepared.system)])
        at_each_look = set(prepared.record) if every % prepared.record_every == 0 else set()
        self._watcher = Watcher([name for name in needed if name not in at_each_look], every)
        self.observers = (self.recorder, self._watcher)

    def findings(self, failure: CosimError | None = None) -> list[Finding]:
        """What was wrong, in the order of its beginning; after the run, also after one that failed."""
        seen = self._watcher.seen(self.recorder)
        found = chain(_failure(failure), _not_finite(seen), self._judged(seen) if len(seen.times) > 1 else ())
        return sorted(found, key=lambda finding: finding.time)

    def _judged(self, seen: Seen) -> list[Finding]:
        system, events = self._prepared.system, self._prepared.events
        settings = Settings(system, events, seen.times)
        end = float(seen.times[-1])
        happened = sorted(event.time for event in events if event.time < end)
        units = [name for name, plan in system.components.items() if "omega" in plan.description.outputs]
        lost = list(lost_synchronism(seen, system, settings))
        found = [
            *undisturbed_motion(seen, system, happened[0] if happened else end),
            *active_limits(seen, system, settings),
            *lost,
        ]
        if any(finding.figures["slips_at_the_end"] for finding in lost):
            return found  # everything swings with the slip
        return [*found, *unsettled_response(seen, system, happened[-1] if happened else 0.0, units)]


def _failure(error: CosimError | None) -> Sequence[Finding]:
    """A run that a component ended."""
    if not isinstance(error, ComponentError):
        return ()
    time = error.time or 0.0
    if isinstance(error, NotFiniteError):
        return (Finding("not_finite", time, error.component, error.variable, str(error)),)
    return (Finding("failure", time, error.component, "", str(error)),)


def _not_finite(seen: Seen) -> Sequence[Finding]:
    """Signals that nothing is coupled to, each told once."""
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
