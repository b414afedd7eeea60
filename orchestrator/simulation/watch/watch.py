"""The watch over a run: all checks together."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from types import MappingProxyType

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError, CosimError, NotFiniteError
from orchestrator.devices.binding.misfits import Misfit
from orchestrator.simulation.watch.confirmation import KnownModes
from orchestrator.simulation.watch.finding import (
    MISFIT,
    UNSTABLE,
    Finding,
    Kind,
    remedy_of,
    rounded_up,
)
from orchestrator.simulation.watch.interruptions import interruption_signals, interruptions
from orchestrator.simulation.watch.limits import above_declared, active_limits, limit_signals
from orchestrator.simulation.watch.own_trips import own_trip_signals, own_trips
from orchestrator.simulation.watch.relay_trips import finding_of
from orchestrator.simulation.watch.response import (
    enough_looks,
    judgements,
    resting_signals,
    unsettled_response,
)
from orchestrator.simulation.watch.run_away import run_away, speed_signals, still_moving_away
from orchestrator.simulation.watch.seen import Seen, Watcher, look_every, rescaled, unit
from orchestrator.simulation.watch.settings import Settings
from orchestrator.simulation.watch.stalls import stall_signals, stalls
from orchestrator.simulation.watch.stretches import Stretch, stretches
from orchestrator.simulation.watch.synchronism import angle_signals, lost_synchronism
from orchestrator.simulation.watch.undisturbed import (
    Unrest,
    among,
    disturbances,
    not_judged,
    undisturbed_motion,
)
from orchestrator.systems.coupling.bus_relays import Trip
from orchestrator.systems.coupling.coupled import LateStart
from orchestrator.systems.coupling.events import Event
from orchestrator.systems.coupling.filtered_recorder import FilteredRecorder
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.recording_blocks import RowSink
from orchestrator.systems.coupling.system import System

SETTLING = 2.0
"""Shortest stretch in which a swing that goes on is a fault [s]. In a shorter one it may be what an event excites in
the network, such as a current's offset, which takes up to a second to decay; growth is a fault in any."""

# shortest stretch of which a departure is told [s]: a fault that is cleared is shorter
SHORTEST_BETWEEN = 1.0

LEAST_DEPARTURE = 1e-3  # least motion that is reported, in parts of 1 or of the signal's start
LEAST_SHARE = 0.1  # the same as a part of all its motion

# A signal departs if it moves by this factor more in the last quarter than in each quarter before
MORE = 1.2
_FEWEST = 40  # least number of looks by which a departure is judged


def too_short(stretches: Sequence[Stretch]) -> list[Finding]:
    """One remark on stretches whose end shows a motion, or has too few looks to show any, and which are too short."""
    if not stretches:
        return []
    spans = " and ".join(
        f"between t = {s.begin:.4g} s and {'the end' if s.last else 'the event'} at t = {s.end:.4g} s"
        for s in stretches
    )
    last = stretches[-1]
    enough = rounded_up(last.begin + SETTLING) if last.last else None
    message = (
        f"whether the response settles is not judged {spans}: what an event excites may still decay after less than "
        f"{SETTLING:g} s; {remedy_of(enough)}"
    )
    until = None if last.last else last.end
    return [Finding("not_judged", stretches[0].begin, "", "", message, until, enough=enough)]


def still_departing(seen: Seen, system: System, stretches: Sequence[Stretch]) -> list[Finding]:
    """One remark on the first stretch at whose end a signal moves more than before, whatever its motion is.

    A growth that shows fewer than two periods, or none, has no frequency, so that no other check tells it."""
    for stretch in stretches:
        if not stretch.last and stretch.end - stretch.begin < SHORTEST_BETWEEN:
            continue
        shown = seen.until(stretch.end)
        rows = shown.times > stretch.begin
        if rows.sum() < _FEWEST:
            continue
        times = shown.times[rows]
        parts = {name: _departure(y[rows]) for name, y in resting_signals(shown, system).items()}
        name, most = max(parts.items(), key=lambda item: item[1], default=("", 0.0))
        if most <= 0:
            continue
        component, _, variable = name.partition(".")
        where = "the end" if stretch.last else f"the event at t = {stretch.end:.4g} s"
        message = (
            f"whether the response to t = {stretch.begin:.4g} s settles is not judged: from t = "
            f"{float(times[-(len(times) // 4)]):.4g} s to {where} {name} moves more than before, by {most:.3g} "
            f"{unit(name, system)}; let the run go on until it comes to rest, and look at it"
        )
        until = None if stretch.last else stretch.end
        return [Finding("not_judged", stretch.begin, component, variable, message, until)]
    return []


def _departure(signal: Numbers) -> float:
    """How far a signal moves in its last quarter, if that is more than in each quarter before; else 0.

    The first look is that before the event, and what moves at once is no departure."""
    *before, last = (float(np.ptp(part)) for part in np.array_split(signal, 4))
    large = last > max(
        LEAST_DEPARTURE * max(1.0, abs(float(signal[0]))), LEAST_SHARE * float(np.ptp(signal))
    )
    return last if large and last > MORE * max(before) else 0.0


class Watch:
    """Watches one run of a scenario.

    Coupled outputs are watched at every communication step: whether they are finite, their extremes and their turns.
    Recorded signals, limits and angles are watched at looks, some milliseconds apart."""

    def __init__(self, prepared: PreparedScenario, sink: RowSink | None = None) -> None:
        self._prepared = prepared
        every = look_every(prepared.step_size, prepared.record_every, prepared.stop_time)
        # what is on the disk need not be in memory
        keep = max(1, every // prepared.record_every) if sink is not None else 1
        kind = FilteredRecorder if prepared.record_filtered else Recorder
        self.recorder = kind(prepared.record, prepared.record_every, sink=sink, keep=keep)
        needed = dict.fromkeys(
            [
                *limit_signals(prepared.system),
                *angle_signals(prepared.system),
                *speed_signals(prepared.system),
                *own_trip_signals(prepared.system),
                *stall_signals(prepared.system),
                *interruption_signals(prepared.system),
            ]
        )
        self._looks_at_records = every % prepared.record_every == 0 and not prepared.record_filtered
        if self._looks_at_records:
            needed = dict.fromkeys(name for name in needed if name not in set(prepared.record))
        elif prepared.record_filtered:
            needed |= dict.fromkeys(prepared.record)
        self._watcher = Watcher(list(needed), every)
        self.observers = (self.recorder, self._watcher)

    def findings(
        self,
        failure: CosimError | None = None,
        late_starts: Mapping[str, LateStart] | None = None,
        misfits: Mapping[str, Sequence[Misfit]] = MappingProxyType({}),
        modes: Sequence[complex] = (),
        later: Sequence[complex] = (),
        trips: Sequence[Trip] = (),
    ) -> list[Finding]:
        """The findings, in the order of their beginning; available after the run, even after one that failed.

        ``misfits``: Of devices and their bindings, by component.
        ``modes``, ``later``: Eigenvalues of the linear model at the start, and of that which the events leave [rad/s];
        empty if not all are known.
        ``trips``: what relays did in the run."""
        events = [*self._prepared.events, *(event for trip in trips for event in trip.events)]
        seen = rescaled(
            self._watcher.seen(self.recorder if self._looks_at_records else None), misfits
        )
        whole = failure is None
        system = self._prepared.system
        told = (
            judge_run(seen, system, events, modes, later, whole=whole)
            if len(seen.times) > 1
            else ()
        )
        found = chain(
            _late(late_starts or {}),
            _failure(failure),
            _not_finite(seen),
            _misfits(misfits),
            map(finding_of, trips),
            told,
        )
        return sorted(found, key=lambda finding: finding.time)


def judge_run(
    seen: Seen,
    system: System,
    events: Sequence[Event],
    modes: Sequence[complex] = (),
    later: Sequence[complex] = (),
    *,
    whole: bool = True,
) -> list[Finding]:
    """All findings from the signals.

    ``whole``: Whether the run came to its end; of one that did not, nobody asks whether it settles."""
    settings = Settings(system, events, seen.times)
    end = float(seen.times[-1])
    happened = [time for time in settings.effective_times() if time < end]
    undisturbed = list(undisturbed_motion(seen, system, happened[0] if happened else end))
    lost = list(lost_synchronism(seen, system, settings))
    parts = stretches(seen, resting_signals(seen, system), happened or [0.0])
    if happened and happened[0] > 0:
        parts.insert(0, Stretch(0.0, happened[0]))
    found = [
        *own_trips(seen, system, settings),
        *stalls(seen, system, settings),
        *interruptions(seen, system),
        *undisturbed,
        *above_declared(seen, system),
        *active_limits(seen, system, settings),
        *lost,
        *run_away(seen, system, settings, parts, slipped=bool(lost)),
    ]
    if any(finding.figures["slips_at_the_end"] for finding in lost):
        return found  # all signals swing with the slip
    if happened and [finding.kind for finding in undisturbed] != ["undisturbed_motion"]:
        parts = [part for part in parts if part.begin >= happened[0]]
    units = [
        name for name, plan in system.components.items() if "omega" in plan.description.outputs
    ]
    at_a_limit = any(finding.kind == "active_limit" and finding.until is None for finding in found)
    modes, later = ((), ()) if at_a_limit else (modes, later)
    known = partial(_known, settings, modes, later, max(happened, default=0.0))
    responses = _Responses(seen, system, units, disturbances(system, events, end), settings, known)
    told = _first_of_each(chain.from_iterable(responses.findings_in(part) for part in parts))
    if happened and not enough_looks(seen, parts[-1]):
        responses.short.append(parts[-1])
    found = [*found, *told, *not_judged(responses.masked)]
    if whole and not any(finding.kind in UNSTABLE for finding in found):
        found += still_moving_away(seen, system, settings, parts[-1], found) if parts else []
        found += too_short(responses.short) or still_departing(seen, system, responses.clear)
    return found


def _known(
    settings: Settings,
    modes: Sequence[complex],
    later: Sequence[complex],
    last: float,
    begin: float,
) -> KnownModes:
    """Return what is known of the modes in a stretch by its begin; ``last`` is the time of the last event [s]."""
    as_before = settings.as_at_start(begin)
    return (
        KnownModes(later, True)
        if later and not as_before and begin >= last
        else KnownModes(modes, as_before)
    )


class _Responses:
    def __init__(
        self,
        seen: Seen,
        system: System,
        units: Sequence[str],
        disturbances: Sequence[Unrest],
        settings: Settings,
        known: Callable[[float], KnownModes],
    ) -> None:
        self._seen, self._system, self._units, self._disturbances = (
            seen,
            system,
            units,
            disturbances,
        )
        self._settings, self._known = settings, known
        self.masked: dict[Stretch, Sequence[Unrest]] = {}
        self.short: list[Stretch] = []
        self.clear: list[Stretch] = []

    def findings_in(self, part: Stretch) -> list[Finding]:
        """Findings in a stretch as a whole, or, if it shows no findings, between its unnoticed events."""
        pieces = list(part.parts())
        told = self._one(part, told=len(pieces) == 1)
        if part.breaks and not judgements(told):
            told = [f for piece in pieces for f in self._one(piece)] or told
        if (
            not told
            and not among(self._disturbances, part)
            and not self._settings.ends_fault(part.end)
        ):
            self.clear.append(part)
        return told

    def _one(self, part: Stretch, *, told: bool = True) -> list[Finding]:
        acting = among(self._disturbances, part)
        known = self._known(part.begin)
        found = unsettled_response(
            self._seen, self._system, part, self._units, known, noisy=bool(acting)
        )
        found = [finding for finding in found if not any(one.explains(finding) for one in acting)]
        if (
            acting
            and told
            and not found
            and unsettled_response(self._seen, self._system, part, self._units, known)
        ):
            self.masked[part] = acting
        if part.end - part.begin >= SETTLING * (1 - 1e-9):
            return found
        growing = [finding for finding in found if finding.kind == "growing_oscillation"]
        if told and growing != found and not self._settings.ends_fault(part.end):
            self.short.append(part)
        return growing


def _first_of_each(found: Iterable[Finding]) -> list[Finding]:
    """The first finding of each kind, with a note on further ones."""
    by_kind: dict[Kind, list[Finding]] = {}
    for finding in found:
        by_kind.setdefault(finding.kind, []).append(finding)
    return [
        replace(first, message=f"{first.message}; the same again from t = {again[0].time:.4g} s")
        if again
        else first
        for first, *again in by_kind.values()
    ]


def _late(starts: Mapping[str, LateStart]) -> Iterator[Finding]:
    """Components whose outputs were not there when their partners were initialised."""
    for component, late in starts.items():
        message = (
            f"{late.text}: the FMU of component {component!r} computes its outputs only as initialisation ends, so "
            "everything else starts from a wrong value, and what is found to move from the start follows from it; "
            "`gfor fmu check --only initial_outputs` shows it alone"
        )
        yield Finding("undisturbed_motion", 0.0, component, late.variable, message)


def _misfits(found: Mapping[str, Sequence[Misfit]]) -> Iterator[Finding]:
    for name, misfits in found.items():
        yield from (
            Finding(
                MISFIT,
                0.0,
                component=name,
                variable="",
                message=m.sentence(name),
                until=None,
                figures=m.figures,
            )
            for m in misfits
        )


def _failure(error: CosimError | None) -> Sequence[Finding]:
    if not isinstance(error, ComponentError):
        return ()
    time = error.time or 0.0
    if isinstance(error, NotFiniteError):
        return (Finding("not_finite", time, error.component, error.variable, str(error)),)
    return (Finding("failure", time, error.component, "", str(error)),)


def _not_finite(seen: Seen) -> Sequence[Finding]:
    """Findings on signals without connection that are not finite, each once."""
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
