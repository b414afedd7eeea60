"""Disturbances that never rest: where noise, quantisation or a forcing is in force, and what is then judged no more."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.coupling.events import Event, Forcing, WireFault, WireRecovery
from orchestrator.coupling.imperfections import Imperfection, Noise, Quantisation
from orchestrator.coupling.system import System
from orchestrator.watch.finding import Finding
from orchestrator.watch.stretches import Stretch

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
        """Whether a forcing makes an oscillation: it has its frequency, or a multiple of it."""
        if self.frequency is None or finding.kind not in ("sustained_oscillation", "growing_oscillation"):
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
            if kind := _kind(imperfection):
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
        acts = key in permanent if isinstance(event, WireRecovery) else bool(_kind(event.imperfection))
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
    named = ", ".join(connections[:_SHOWN])
    if len(connections) > _SHOWN:
        named += f" and {len(connections) - _SHOWN} more"
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
