"""The undisturbed state: before the first event the system must stand still."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import few
from orchestrator.simulation.watch.finding import Finding
from orchestrator.simulation.watch.limit import is_inner
from orchestrator.simulation.watch.oscillation import Oscillation, strongest_oscillation
from orchestrator.simulation.watch.seen import Seen, is_derivative, unit
from orchestrator.simulation.watch.stretches import Stretch
from orchestrator.systems.coupling.events import Event, Forcing, WireFault, WireRecovery
from orchestrator.systems.coupling.imperfections import Imperfection, Noise, Quantisation
from orchestrator.systems.coupling.system import System

_SAME = 0.05  # relative difference within which an oscillation has the frequency of a forcing
_SHOWN = 3  # largest number of connections that a remark names


@dataclass(frozen=True)
class Unrest:
    """Noise or quantisation on one connection, or a forcing of a variable, from ``begin`` to ``end`` [s]."""

    begin: float
    end: float
    connection: str
    kind: str
    frequency: float | None = None

    def explains(self, finding: Finding) -> bool:
        """Return whether a forcing makes an oscillation: it has its frequency, or a multiple of it."""
        if self.frequency is None or finding.kind not in (
            "sustained_oscillation",
            "growing_oscillation",
        ):
            return False
        order = finding.figures["frequency_hz"] / self.frequency
        return order > 0.5 and abs(order - round(order)) < _SAME


def disturbances(system: System, events: Sequence[Event], end: float) -> list[Unrest]:
    """When noise or quantisation is in force on each connection.

    ``events``: Those of the run; some begin or end an imperfection.
    ``end``: Of the run [s]."""
    found: list[Unrest] = []
    since: dict[tuple[str, str], float] = {}
    permanent = set[tuple[str, str]]()
    for plan in system.wires.values():
        for imperfection in plan.permanent.values():
            kind = _kind(imperfection)
            if kind:
                permanent.add((plan.name, kind))
                since[plan.name, kind] = 0.0
    for event in events:
        if isinstance(event, Forcing) and event.time < end:
            until = end if event.end is None else min(event.end, end)
            name = f"{event.component}.{event.variable}"
            found.append(Unrest(event.time, until, name, "forcing", event.frequency))
    for event in sorted(events, key=lambda e: e.time):
        if event.time >= end or not isinstance(event, WireFault | WireRecovery):
            continue
        key = (str(event.connection), _kind(event.imperfection, least=False))
        if not key[1]:
            continue
        acts = (
            key in permanent if isinstance(event, WireRecovery) else bool(_kind(event.imperfection))
        )
        if acts:
            since.setdefault(key, event.time)
        elif key in since:
            found.append(Unrest(since.pop(key), event.time, *key))
    return found + [Unrest(begin, end, *key) for key, begin in since.items()]


def _kind(imperfection: Imperfection, *, least: bool = True) -> str:
    """The disturbance's name; empty for what rests, and, with ``least``, for a disturbance of size 0."""
    match imperfection:
        case Noise(deviation=size):
            return "noise" if size > 0 or not least else ""
        case Quantisation(step=size):
            return "quantisation" if size > 0 or not least else ""
    return ""


def among(found: Iterable[Unrest], stretch: Stretch) -> list[Unrest]:
    return [d for d in found if d.begin < stretch.end and d.end > stretch.begin]


def not_judged(masked: Mapping[Stretch, Sequence[Unrest]]) -> list[Finding]:
    """One remark on all stretches whose motion the disturbances may explain."""
    if not masked:
        return []
    order = sorted(masked, key=lambda stretch: stretch.begin)
    spans: list[tuple[float, float]] = []
    for stretch in order:
        if spans and stretch.begin <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(stretch.end, spans[-1][1]))
        else:
            spans.append((stretch.begin, stretch.end))
    acting = [d for stretch in order for d in masked[stretch]]
    connections = list(dict.fromkeys(d.connection for d in acting))
    named = few(connections, _SHOWN)
    kinds = " and ".join(dict.fromkeys(d.kind for d in acting))
    when = " and ".join(f"between t = {begin:.4g} s and t = {end:.4g} s" for begin, end in spans)
    message = (
        f"growth and lasting oscillations are not judged {when}: {kinds} on {named} can explain the motion there; "
        "run without it to judge the response"
    )
    target = connections[0].rpartition(" -> ")[2]
    component, _, variable = target.partition(".")
    until = None if order[-1].last else spans[-1][1]
    return [Finding("not_judged", spans[0][0], component, variable, message, until)]


# smallest reported growth: distance of a signal from its start, as a part of 1 or of the start
LEAST_GROWTH = 1e-6
# least motion reported without growth, as from a start off the steady state, in the same unit
LEAST_MOTION = 1e-4
# A motion grows by itself if it had less than this part of its extent after half the time
_STEEP = 0.2
FEWEST_LOOKS = 3  # least number of looks over which a growth rises; a faster rise is a jump
# a growth is measured between these sizes, in parts of 1 or of the start
_ROUNDING = 1e-13  # above rounding
_LARGE = 0.03  # below what limits bend
_AGREE = 0.2  # largest relative difference between two measurements of a growth that agree


def undisturbed_motion(seen: Seen, system: System, until: float) -> Iterator[Finding]:
    """How the state moves before the first event, if it does.

    ``until``: time of the first event, or the end [s]."""
    count = int(np.searchsorted(seen.times, until * (1 + 1e-12), side="right"))
    motions = _motions(seen, system, count) if count >= FEWEST_LOOKS else {}
    if not motions:
        return
    most = max(motions, key=lambda name: motions[name][-1])
    size, steep = float(motions[most][-1]), _is_growth(motions[most])
    least = LEAST_GROWTH if steep else LEAST_MOTION
    if size < least:
        return
    begin = {name: int(np.argmax(m >= least)) for name, m in motions.items() if m[-1] >= least}
    first = min(begin, key=lambda name: (begin[name], -motions[name][begin[name]]))
    time = float(seen.times[begin[first]])
    who = (
        f"{first} moves first and most"
        if first == most
        else f"{first} moves first; {most} moves most"
    )
    sizes = f"{who}, by {size:.3g} of 1 or of its start until t = {until:.4g} s, before anything happens"
    component, _, variable = first.partition(".")
    if not steep:
        message = f"the undisturbed state does not stand still from t = {time:.4g} s: {sizes}"
        yield Finding(
            "undisturbed_motion",
            time,
            component=component,
            variable=variable,
            message=message,
            until=None,
            figures={"motion": size},
        )
        return
    growth = _growth(seen, motions)
    how = f"with {growth.frequency_hz:.4g} Hz" if growth.frequency_hz else "without oscillation"
    message = f"the undisturbed state grows at {growth.rate:+.4g} 1/s {how} from t = {time:.4g} s: {sizes}"
    figures = {"motion": size, "growth_rate": growth.rate, "frequency_hz": growth.frequency_hz}
    yield Finding(
        "growth",
        time,
        component=component,
        variable=variable,
        message=message,
        until=None,
        figures=figures,
    )


def _motions(seen: Seen, system: System, count: int) -> dict[str, Numbers]:
    """Largest distance of every signal except angles from its start up to each look, as a part of 1 or of the start.
    Shape (count,); it never falls."""
    found = {}
    for name, signal in {**seen.values, **seen.last}.items():
        if is_derivative(name) or is_inner(name, system) or unit(name, system) == "rad":
            continue
        low, high, start = seen.low.get(name, signal), seen.high.get(name, signal), signal[0]
        far = np.maximum(high[:count] - start, start - low[:count]) / max(1.0, abs(float(start)))
        if np.isfinite(far).all():
            found[name] = np.maximum.accumulate(far)
    return found


def _is_growth(motion: Numbers) -> bool:
    reached = int(np.argmax(motion >= 0.5 * motion[-1]))
    if reached == 0 or motion[reached // 2] > _STEEP * motion[reached]:
        return False
    return int(_rising(motion).sum()) >= FEWEST_LOOKS


def _rising(motion: Numbers) -> NDArray[np.bool_]:
    """Looks at which a growth exceeds rounding and is not yet limited."""
    floor = max(10 * motion[1], _ROUNDING)
    rising: NDArray[np.bool_] = (motion > floor) & (motion < min(0.3 * motion[-1], _LARGE))
    return rising


def _growth(seen: Seen, motions: Mapping[str, Numbers]) -> Oscillation:
    """Growth rate and frequency of the signal that shows the growth first; the frequency is 0 if the signal does not
    turn.

    The rate follows from the extent over every communication step, and the frequency from the turns. If the looks are
    close enough for the frequency, the matrix pencil gives both more exactly."""
    coupled = {
        name: m for name, m in motions.items() if name in seen.turns and _is_growth(m)
    } or motions
    size = min(_LARGE, 0.3 * max(float(m[-1]) for m in coupled.values()))
    row = min(int(np.argmax(m >= size)) for m in coupled.values() if m[-1] >= size)
    name = max(coupled, key=lambda n: coupled[n][row])
    rising = np.flatnonzero(_rising(coupled[name]))
    rows = slice(int(rising[0]), int(rising[-1]) + 1)
    times = seen.times[rows]
    rate = float(np.polyfit(times, np.log(coupled[name][rows]), 1)[0])
    late = slice((rows.start + rows.stop) // 2, rows.stop)
    turns = float(seen.turns[name][late].sum()) if name in seen.turns else 0.0
    frequency = turns / 2 / (seen.interval * (late.stop - late.start)) if turns > 1 else 0.0
    exact = strongest_oscillation(
        times, (seen.last if name in seen.last else seen.values)[name][rows]
    )
    if exact is not None and abs(exact.rate - rate) < _AGREE * rate:
        aliased = name in seen.turns and abs(
            exact.frequency_hz - frequency
        ) > _AGREE * frequency + 1 / np.ptp(times)
        if not aliased:
            return exact
    return Oscillation(frequency, rate, float(coupled[name][-1]))
