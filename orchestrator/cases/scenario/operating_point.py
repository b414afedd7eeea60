"""Operating point of a scenario: its power flow, and what is unusual about the solution."""

import math
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

from orchestrator.cases.draft import Draft
from orchestrator.cases.events.islands import likely_reference
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.remedies import KEEPING_LIMITS, with_slack
from orchestrator.cases.form.schema import UnitReconnectionTable
from orchestrator.cases.networks.controls import Control
from orchestrator.cases.questions.plausibility import question
from orchestrator.cases.scenario.dc_lines import check_dc_lines
from orchestrator.cases.scenario.feeding_loads import feeding_loads
from orchestrator.cases.scenario.flow_units import note_contradictions, undecided_units
from orchestrator.cases.scenario.measured_points import start_measured_points
from orchestrator.cases.scenario.plants_of_several import start_plants
from orchestrator.cases.scenario.start_values import (
    FollowingLoad,
    is_connected,
    start_from_power_flow,
)
from orchestrator.core.errors import ErrorKind, InputError, Problem, QuestionTopic, few

_USUAL_VOLTAGES = (0.8, 1.2)  # magnitudes [pu] of bus voltages that are not questioned
_CLOSE = 1e-3  # power [pu of the rating] by which a limit is not passed
_SHOWN = 5  # buses that a question names; the others are counted


def power_flow_of(draft: Draft) -> PowerFlow | None:
    """The power flow with the values that are set; None without a network, or with a problem, which is noted."""
    table = draft.given.case.power_flow
    if table is None or draft.network is None:
        return None
    units = {p.name: p.bus for p in draft.network.ports if p.name in draft.system.components}
    wanted = table.slack or (draft.data.slack if draft.data else None)
    if wanted is None:
        raw = draft.given.case.network.raw if draft.given.case.network else None
        where = f"no bus of {raw}, or of the part of it that is studied, is the reference (IDE = 3)"
        none = f"{where}, and " if raw is not None else ""
        text = f"{none}the key 'slack' is missing"
        ratings = {name: draft.system.components[name].number("S_n") for name in units}
        one = likely_reference(draft.network, ratings) if units else "sg1"
        remedy = f"name a unit or a bus with one that feeds what is left, such as {with_slack(one)}"
        draft.note(draft.given.place("power_flow"), f"{text}; {remedy}")
        return None
    slack = units.get(wanted, wanted)
    if slack not in units.values():
        known = close_names(wanted, dict.fromkeys(units.values()), f"units: {', '.join(units)}")
        text = f"{wanted!r} is neither a unit of this scenario nor a bus with one; {known}"
        if draft.data is not None and draft.data.slack == wanted:
            text = (
                f"the reference {wanted!r} of the network's source has no unit in this scenario, so nothing feeds "
                f"what is left: name a unit that is to feed it, such as {with_slack(next(iter(units), 'sg1'))}"
            )
        draft.note(draft.given.place("power_flow", "slack"), text)
        return None
    note_contradictions(draft, units)
    if draft.found.problems:
        return None
    intact = slack
    if draft.dispatch is not None:
        slack = _reference(draft, units, slack, table.grid)
    undecided = list(undecided_units(draft, units, slack))
    returning = {
        event.unit for event in draft.given.events if isinstance(event, UnitReconnectionTable)
    }
    try:
        flow = start_from_power_flow(
            draft.system,
            draft.network,
            table.grid,
            units,
            slack,
            _reactive_limits(draft),
            keep_limits=table.reactive_limits is True,
            returning=returning,
            dispatch=draft.dispatch,
            active=draft.active_limits,
            following=_following(draft),
            ratings=draft.base_ratings,
            controls=_moving(draft, table.grid),
        )
    except InputError as error:
        kind = ErrorKind.VALUES if error.kind is ErrorKind.INPUT else error.kind
        cause = str(error)
        if kind is ErrorKind.START:  # units at their limits
            cause += _cause(draft, 0.0)
        draft.note_of_scenario(draft.given.place("power_flow"), cause, kind)
        return None
    start_measured_points(draft, flow)
    start_plants(draft, flow)
    check_dc_lines(draft)
    question(draft, undecided)
    draft.found.questions += [*_limit_questions(draft, flow), *_voltage_questions(draft, flow)]
    # else what it fed before is shared
    draft.found.questions += _leftover(draft, flow) if slack == intact else []
    return flow


def _following(draft: Draft) -> dict[str, FollowingLoad]:
    """Loads that draw what is set at their voltage before an outage, and another power at another voltage."""
    if draft.data is None or draft.network is None or not draft.voltages_before:
        return {}
    buses = {load.name: load.bus for load in draft.network.loads}
    return {
        name: FollowingLoad(laws, abs(draft.voltages_before[buses[name]]))
        for name, laws in draft.data.flow_laws.items()
        if name in buses and name not in draft.loads_as_given
    }


def _moving(draft: Draft, grid: str) -> list[Control]:
    """Taps and shunts that move in the power flow of an outage; one whose position is given does not."""
    if draft.data is None or not draft.voltages_before:
        return []
    given = draft.given.from_outside
    return [
        control
        for control in draft.data.controls
        if not any(fnmatchcase(f"{grid}.{control.variable}", name) for name in given)
    ]


def _leftover(draft: Draft, flow: PowerFlow) -> Iterator[Problem]:
    """Powers that were asked of units at the slack bus, which feeds what is left, and limits that this exceeds."""
    for name in (unit for unit in flow.balancing if f"{unit}.P_0" in draft.given.from_outside):
        fed = f"{flow.slack} is the slack and feeds what is left, here P_0 = {flow.powers[name].real:.4g} pu"
        place, topic = (
            draft.places.get(f"{name}.P_0", ""),
            QuestionTopic("a power at the slack", name),
        )
        yield Problem(place, f"{name}.P_0 cannot act: {fed}", topic=topic)
    for name in flow.balancing:
        rating = draft.system.components[name].number("S_n")
        fed_mw, close = flow.powers[name].real * rating, _CLOSE * rating
        least, most = draft.active_limits.get(name, (-math.inf, math.inf))
        if not least - close <= fed_mw <= most + close:
            text = f"{name} is the slack and feeds {fed_mw:.4g} MW, beyond its limits, {least:g} to {most:g} MW"
            yield Problem(
                draft.places.get(f"{name}.P_0", ""),
                f"{text}; let other units feed more or less{_cause(draft, rating) if fed_mw < least else ''}",
            )
        elif fed_mw < -close and draft.system.components[name].kind == "machine":
            cause = _cause(draft, rating)
            text = f"{name} is the slack and takes {-fed_mw:.4g} MW, as a motor does{cause}"
            yield from [Problem(draft.place_of_component(name), text)] if cause else ()


def _cause(draft: Draft, rating: float) -> str:
    """Likely cause of too much power for a unit of a rating [MVA], to be added to a sentence; "" if none is seen."""
    grid = draft.system.components.get(draft.grid or "")
    fed = feeding_loads(draft.network, grid, rating)
    return f"; {fed}" if fed else ""


def _reference(draft: Draft, units: Mapping[str, str], slack: str, grid: str) -> str:
    """The slack bus, or, where an outage takes all its units, the bus of the largest unit that holds a voltage."""
    plans = draft.system.components
    left = [
        name
        for name in units
        if is_connected(plans[grid], f"{name}.connected")
        and is_connected(plans[name], "connected")
        and "Q_0" not in plans[name].parameters
    ]
    if not left or slack in (units[name] for name in left):
        return slack
    return units[max(left, key=lambda name: plans[name].number("S_n"))]


def _voltage_questions(draft: Draft, flow: PowerFlow) -> list[Problem]:
    """Ask about voltages with which no network is run."""
    low, high = _USUAL_VOLTAGES
    unusual = [
        f"{bus!r} {abs(v):.3f} pu" for bus, v in flow.voltages.items() if not low <= abs(v) <= high
    ]
    if not unusual:
        return []
    return [
        Problem(
            draft.given.place("power_flow"),
            f"the power flow gives voltages outside of {low:g} to {high:g} pu: "
            f"{few(unusual, _SHOWN)}; check loads, shunts and stray_B there",
        )
    ]


def _reactive_limits(draft: Draft) -> dict[str, tuple[float, float]]:
    """Limits of the source's generators, which the units' file overrides [Mvar]."""
    generation = draft.data.generation if draft.data else {}
    return {
        bus: (g.q_min_mvar, g.q_max_mvar) for bus, g in generation.items()
    } | draft.reactive_limits


def _limit_questions(draft: Draft, flow: PowerFlow) -> list[Problem]:
    kept = draft.given.case.power_flow.reactive_limits if draft.given.case.power_flow else None
    where = draft.given.place("power_flow", *(["reactive_limits"] if kept is not None else []))
    found = []
    if flow.at_limits:
        told = few([excess.text(kept=True) for excess in flow.at_limits], _SHOWN)
        found.append(Problem(where, f"limits of reactive power are reached: {told}"))
    if flow.beyond_limits and kept is not False:
        told = few([excess.text(kept=False) for excess in flow.beyond_limits], _SHOWN)
        remedy = (
            "the slack bus keeps no limit; take another slack"
            if kept
            else f"to keep the limits, write {KEEPING_LIMITS}; false there if the voltages are meant"
        )
        found.append(Problem(where, f"limits of reactive power are exceeded: {told}; {remedy}"))
    return found
