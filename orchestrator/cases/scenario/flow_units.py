"""The statement of every unit to the power flow: that it holds a voltage, or that it feeds a reactive power."""

from collections.abc import Iterator, Mapping

from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import FlowUnit
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_values import place_of, unit_of
from orchestrator.systems.coupling.system import ComponentPlan

_HELD = "holds its bus there, whatever reactive power that takes; give v_0, or give Q_0 and the voltage follows"


def flow_unit(name: str, bus: str, plan: ComponentPlan, *, connected: bool) -> FlowUnit:
    """A unit as the power flow sees it: one whose ``Q_0`` is set feeds that, any other holds its ``v_0``."""
    Q_0 = plan.number("Q_0") if "Q_0" in plan.parameters else None
    return FlowUnit(
        name,
        bus,
        S_n=plan.number("S_n"),
        P_0=plan.number("P_0"),
        v_0=plan.number("v_0"),
        connected=connected,
        Q_0=Q_0,
    )


def note_contradictions(draft: Draft, units: Mapping[str, str]) -> None:
    """Note what the power flow computes of a unit and the case sets nevertheless."""
    for name in units:
        given = draft.system.components[name].parameters
        if "theta_0" in given:
            place = _place(draft, name, "theta_0")
            draft.note(
                place,
                f"{name}: theta_0 cannot be set, because the power flow computes it; remove it",
            )
        if {"Q_0", "v_0"} <= {*given}:
            if name in draft.origins:
                remedy = "remove Q_0, because the units' table gives v_0"
            else:
                remedy = "remove v_0, and the unit feeds Q_0, or remove Q_0, and it holds v_0"
            draft.note(
                _place(draft, name, "Q_0"),
                f"{name}: Q_0 = {given['Q_0']:g} pu and v_0 = {given['v_0']:g} pu are both set, and the power flow "
                f"computes one from the other; {remedy}",
            )


def undecided_units(draft: Draft, units: Mapping[str, str], slack: str) -> Iterator[UnusualValue]:
    """Ask about grid-following units that say neither what voltage they hold nor what they feed; the slack's need not.

    They do not hold a voltage by themselves. What does, a machine or a grid-forming converter, holds 1 pu if nothing
    else is said."""
    for name, bus in units.items():
        plan = draft.system.components[name]
        follows = any(variable.startswith("pll.") for variable in plan.description.parameters)
        if not follows or bus == slack or {"v_0", "Q_0"} & {*plan.parameters}:
            continue
        if any(
            "v_0" in draft.system.components[other].parameters
            for other, at in units.items()
            if at == bus
        ):
            continue
        default = f"v_0 = {plan.number('v_0'):g} {unit_of(plan, 'v_0')}"
        text = f"neither v_0 nor Q_0 is given: its default, {default}, {_HELD}"
        place = place_of(draft, name, "v_0")
        yield UnusualValue(f"{name}.v_0", place, text, "neither v_0 nor Q_0")


def _place(draft: Draft, name: str, variable: str) -> str:
    return draft.places.get(f"{name}.{variable}", draft.place_of_component(name))
