"""The relays of a run, and findings of what they did: who, when, and what the relay saw."""

from math import inf

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.start_values import is_connected
from orchestrator.simulation.watch.finding import TRIP, Finding
from orchestrator.systems.coupling.bus_relays import Relays, Shedding, Trip
from orchestrator.systems.coupling.events import LoadChange, UnitSwitching

_UNITS = {"voltage": "pu", "frequency": "Hz"}


def relays_in(prepared: PreparedScenario) -> Relays:
    """Return the relays of a scenario for one run, which know the units that are off or go off without them."""
    events = [event for event in prepared.events if isinstance(event, UnitSwitching)]
    orders = (order for relay in prepared.relays for order in relay.orders)
    plans, begun = prepared.system.components, dict[str, UnitSwitching]()
    for order in orders:
        if isinstance(order, UnitSwitching) and order.unit in plans:
            grid = plans[order.component]
            is_on = is_connected(grid, f"{order.unit}.connected")
            if not (is_on and is_connected(plans[order.unit], "connected")):
                begun[order.unit] = UnitSwitching(-inf, order.component, order.unit, False)
    return Relays(prepared.relays, prepared.step_size, [*begun.values(), *events])


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
