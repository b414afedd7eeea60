"""Relays that watch voltage or frequency of a bus in a run and order trips of units or buses, or shed loads.

None watches the impedance or the current of a line.

The relays look at their buses at regular times. A relay picks up when it sees its quantity beyond a limit, and forgets
that when it sees it within again. If it was beyond for the relay's delay, the relay trips: it orders its events, which
happen when the breaker has opened. Nothing takes an order back."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, pi
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.systems.coupling.events import Event, LineSwitching, LoadChange, UnitSwitching
from orchestrator.systems.coupling.observers import ObservedRun
from orchestrator.systems.coupling.relay_limits import Quantity, RelayLimits

LOOK_EVERY = 1e-3
"""Time between two looks of the relays [s], a small part of the shortest delay that a relay of a planner's file has."""

FREQUENCY_LAG = 0.04
"""Lag of the frequency of a bus behind the speed of its angle [s]: two cycles of 50 Hz, as a meter averages."""

LEAST_VOLTAGE = 0.05
"""Voltage [pu] below which the angle of a bus says nothing; its frequency stays what it was."""

RATED_FREQUENCY = 50.0  # [Hz], where no component has one of its own

_ROUND_OFF = 1e-6  # part of a step by which a sum of times may miss a communication point
_GONE = 1e-9  # share of a load that counts as none
_COLUMNS = 8
_PICKED_UP, _DECIDED, _SEEN, _ANGLE, _SLIP, _OPENED, _SCALE, _LONGEST = range(_COLUMNS)
"""Numbers of a relay in a run: times [s] at which it picked up, tripped, and had its events happen; what it saw when it
tripped; angle [rad] and frequency beside the rated one [Hz]; scale of its load after it shed; the longest time [s] that
it counted beyond its limits, −∞ where it was never beyond."""


@dataclass(frozen=True, slots=True)
class Shedding:
    """A share of a load that a stage of a relay takes off, as a part of the load that the run begins with."""

    component: str
    load: str
    share: float


@dataclass(frozen=True, slots=True)
class Relay:
    """One relay: the bus of a grid that it watches, its limits, and what it orders.

    ``record``: name of its record; ``of``: the unit, load or bus that it protects; ``component``: the grid.
    ``f_n``: rated frequency [Hz]."""

    record: str
    of: str
    component: str
    bus: str
    quantity: Quantity
    limits: RelayLimits
    orders: tuple[Event | Shedding, ...]
    f_n: float = RATED_FREQUENCY


@dataclass(frozen=True, slots=True)
class Trip:
    """Orders of a relay that were carried out.

    ``time``: when the breaker opened; ``picked_up``: since when the quantity was beyond a limit; ``decided``: when the
    relay tripped [s]; ``seen``: voltage [pu] or frequency [Hz] then."""

    relay: Relay
    time: float
    picked_up: float
    decided: float
    seen: float
    events: tuple[Event, ...]


@dataclass(frozen=True, slots=True)
class Nearness:
    """How near a relay came to a trip.

    ``longest``: the longest time that it counted beyond its limits [s]; ``decided``: whether it tripped, be its breaker
    open or not."""

    relay: Relay
    longest: float
    decided: bool

    @property
    def share(self) -> float:
        """Part of the relay's delay; 1 where it tripped."""
        return 1.0 if self.decided else self.longest / self.relay.limits.delay


class Relays:
    """All relays of a run: an observer that orders events.

    ``switchings``: of units by the run's own events; one at t = −∞ is of a unit that begins out of service. A relay of
    a unit that is off has nothing to trip."""

    def __init__(
        self,
        relays: Sequence[Relay],
        step_size: float,
        switchings: Sequence[UnitSwitching] = (),
    ) -> None:
        self.relays = tuple(relays)
        self._switchings = sorted(switchings, key=lambda event: event.time)
        self.every = max(1, round(LOOK_EVERY / step_size))
        self._least = _ROUND_OFF * step_size
        self._state = np.full((len(self.relays), _COLUMNS), inf)
        self._state[:, [_SEEN, _ANGLE, _SLIP, _SCALE]] = 0.0
        self._state[:, _LONGEST] = -inf
        self._looked: float | None = None  # time of the last look [s]
        limits = [relay.limits for relay in self.relays]
        self._low, self._high, self._delay = np.array(
            [(x.low, x.high, x.delay) for x in limits]
        ).T.reshape(3, -1)
        self._windows = np.array([x.window for x in limits])
        self._follows = np.array([relay.quantity == "frequency" for relay in self.relays])
        self._rated = np.array([relay.f_n for relay in self.relays])
        # begin and end [s] of each time beyond a limit, of relays with a window
        self._spans: dict[int, list[list[float]]] = {
            int(k): [] for k in np.flatnonzero(self._windows)
        }
        self._batches: list[tuple[RealBatch, Any]] = []

    @property
    def trips(self) -> list[Trip]:
        """Return what the relays did so far, in the order of time."""
        opened = self._state[:, _OPENED]
        found: list[Trip] = []
        for k in sorted(np.flatnonzero(np.isfinite(opened)).tolist(), key=opened.__getitem__):
            picked_up, decided, seen = self._state[k, [_PICKED_UP, _DECIDED, _SEEN]].tolist()
            events = self._events_of(k, found)
            if events:
                time = float(opened[k])
                found.append(Trip(self.relays[k], time, picked_up, decided, seen, events))
        return found

    @property
    def nearest(self) -> Nearness | None:
        """Return the relay that came nearest to a trip, or tripped, of those that have something to trip.

        None where none of them was beyond its limits."""
        trips, longest = self.trips, self._state[:, _LONGEST]
        decided = np.isfinite(self._state[:, _DECIDED])
        found = [
            Nearness(self.relays[k], float(longest[k]), bool(decided[k]))
            for k in np.flatnonzero(np.isfinite(longest)).tolist()
            if self._events_of(k, trips)
        ]
        return max(found, key=lambda one: one.share, default=None)

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        """Find the voltages of the buses, each of which is read once for all of its relays."""
        self._batches = []
        for name in dict.fromkeys(relay.component for relay in self.relays):
            of = [k for k, relay in enumerate(self.relays) if relay.component == name]
            buses = list(dict.fromkeys(self.relays[k].bus for k in of))
            wanted = [f"{bus}.{part}" for bus in buses for part in ("v_re", "v_im")]
            rows = np.array([(k, buses.index(self.relays[k].bus)) for k in of]).T
            self._batches.append((RealBatch(run.components[name], wanted), rows))

    def observe(self, run: ObservedRun) -> None:
        """Look at the buses; a second look at one communication point sees what an event changed there."""
        elapsed = 0.0 if self._looked is None else run.time - self._looked
        voltage = np.zeros((2, len(self.relays)))
        for batch, (relays, buses) in self._batches:
            voltage[:, relays] = batch.read().reshape(-1, 2).T[:, buses]
        value = np.hypot(*voltage)
        angle = np.arctan2(voltage[1], voltage[0])
        slip = _follow_angles(self._state, angle, elapsed, value > LEAST_VOLTAGE)
        self._judge(np.where(self._follows, self._rated + slip, value), run.time)
        self._looked = run.time

    def end(self, run: ObservedRun) -> None:
        """See `Observer.end`."""

    def _judge(self, seen: Numbers, time: float) -> None:
        """Let relays pick up, forget and trip by what they see now."""
        waits = self._state[:, _DECIDED] == inf
        beyond = ((seen < self._low) | (seen > self._high)) & waits
        forgets = self._windows == 0
        since = self._state[:, _PICKED_UP]
        since[waits & forgets & ~beyond] = inf
        since[beyond & forgets] = np.minimum(since[beyond & forgets], time)
        lasted = np.where(beyond & forgets, time - since, -inf)
        for k in np.flatnonzero(~forgets & waits).tolist():
            since[k], lasted[k] = self._within_window(k, time, is_beyond=bool(beyond[k]))
        self._state[:, _LONGEST] = np.maximum(self._state[:, _LONGEST], lasted)
        trips = beyond & (lasted >= self._delay - self._least)
        self._state[trips, _DECIDED] = time
        self._state[trips, _SEEN] = seen[trips]

    def _within_window(self, k: int, time: float, *, is_beyond: bool) -> tuple[float, float]:
        """Return since when a relay has been beyond its limits within its window, and for how long in all [s]."""
        spans, first = self._spans[k], time - self._windows[k]
        while spans and spans[0][1] <= first:
            del spans[0]
        is_open = bool(spans) and spans[-1][1] == self._looked
        if is_beyond and is_open:
            spans[-1][1] = time
        elif is_beyond:
            spans.append([time, time])
        elif is_open:
            spans[-1][1] = np.nextafter(spans[-1][1], -inf)  # closed: the next one begins anew
        if not spans:
            return inf, -inf
        lasted = sum(end - max(begin, first) for begin, end in spans)
        return max(spans[0][0], first), lasted

    def ordered(self, run: ObservedRun) -> list[Event]:
        """Return the events of the relays whose breakers open now."""
        found: list[Event] = []
        for k, relay in enumerate(self.relays):
            own = self._state[k]
            opens = own[_DECIDED] + relay.limits.opening - self._least
            if own[_OPENED] < inf or run.time < opens:
                continue
            before = self.trips
            for order in relay.orders:
                if isinstance(order, Shedding):
                    own[_SCALE] = _scale_after(order, before, run)
            own[_OPENED] = run.time
            found += self._events_of(k, before)
        return found

    def _events_of(self, k: int, before: Sequence[Trip]) -> tuple[Event, ...]:
        """Return the events of a relay without those of units that are off and of lines that are open already."""
        time, scale = self._state[k, [_OPENED, _SCALE]].tolist()
        off = {e.unit for trip in before for e in trip.events if isinstance(e, UnitSwitching)}
        on = {e.unit: e.connected for e in self._switchings if e.time <= time}
        off.update(unit for unit, connected in on.items() if not connected)
        opened = {e.line for trip in before for e in trip.events if isinstance(e, LineSwitching)}
        found: list[Event] = []
        for order in self.relays[k].orders:
            if isinstance(order, Shedding):
                found.append(LoadChange(time, order.component, order.load, scale))
            elif not _is_done(order, off, opened):
                found.append(replace(order, time=time))
        return tuple(found)

    def position(self) -> dict[str, Any]:
        """See `Resumable.position`."""
        spans = [(k, *span) for k, of in self._spans.items() for span in of]
        return {
            "relays": self._state.copy(),
            "looked": self._looked or 0.0,
            "spans": np.array(spans).reshape(-1, 3),
        }

    def resume(self, position: Mapping[str, Any]) -> None:
        """See `Resumable.resume`."""
        self._state[:] = position["relays"]
        self._looked = float(position["looked"])
        for k, begin, end in position["spans"].tolist():
            self._spans[int(k)].append([begin, end])


def _is_done(order: Event, off: Collection[str], opened: Collection[str]) -> bool:
    """Return whether a unit is off already, or a line open."""
    if isinstance(order, UnitSwitching):
        return order.unit in off
    return isinstance(order, LineSwitching) and order.line in opened


def _follow_angles(state: Any, angle: Numbers, elapsed: float, has_angle: Numbers) -> Numbers:
    """Move the filtered frequencies by what the angles moved in a time [s], and return them beside the rated one [Hz].

    The jump of an event takes no time. A frequency stays where ``has_angle`` is false: there the voltage
    is too low for an angle."""
    turned = (angle - state[:, _ANGLE] + pi) % (2 * pi) - pi
    state[:, _ANGLE] = angle
    slip = state[:, _SLIP]
    if elapsed > 0:
        kept = exp(-elapsed / FREQUENCY_LAG)
        moved = kept * slip + (1 - kept) * turned / (2 * pi * elapsed)
        slip[:] = np.where(has_angle, moved, slip)
    return np.asarray(slip)


def _scale_after(order: Shedding, before: Sequence[Trip], run: ObservedRun) -> float:
    """Return the scale of a load without a share of it, whatever else changed the load."""
    shed = sum(
        done.share
        for trip in before
        for done in trip.relay.orders
        if isinstance(done, Shedding) and done.load == order.load
    )
    (now,) = RealBatch(run.components[order.component], [f"{order.load}.scale"]).read().tolist()
    left = 1.0 - shed
    scale = now * (left - order.share) / left if left > _GONE else 0.0
    return float(scale) if scale > _GONE else 0.0
