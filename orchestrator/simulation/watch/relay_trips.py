"""Findings of what relays did in a run: who, when, and what the relay saw."""

from orchestrator.simulation.watch.finding import TRIP, Finding
from orchestrator.systems.coupling.events import LoadChange
from orchestrator.systems.coupling.relays import Shedding, Trip

_UNITS = {"voltage": "pu", "frequency": "Hz"}


def finding_of(trip: Trip) -> Finding:
    """Return the finding of one trip, with its times [s] and what the relay saw [pu or Hz]."""
    relay, limits = trip.relay, trip.relay.limits
    unit = _UNITS[relay.quantity]
    side = f"below {limits.low:g}" if trip.seen < limits.low else f"above {limits.high:g}"
    what = f"{relay.of} trips"
    shares = [order.share for order in relay.orders if isinstance(order, Shedding)]
    if shares:
        scale = next(event.scale for event in trip.events if isinstance(event, LoadChange))
        what = f"{100 * sum(shares):.3g} % of {relay.of} is shed, which leaves {100 * scale:.3g} %,"
    message = (
        f"{what} at t = {trip.time:.6g} s by {relay.record}: the {relay.quantity} of {relay.bus} is {side} {unit} from "
        f"t = {trip.picked_up:.6g} s, {trip.seen:.4g} {unit} at t = {trip.decided:.6g} s"
    )
    figures = {"picked_up": trip.picked_up, "decided": trip.decided, "seen": trip.seen}
    return Finding(TRIP, trip.time, relay.of, relay.quantity, message, figures=figures)
