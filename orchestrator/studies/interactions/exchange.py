"""A case with other devices at its converters' places, at the same operating point."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from orchestrator.cases.case import Case
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.form.schema import (
    AnalysisTable,
    ComponentTable,
    EventTable,
    GridEventBase,
    Value,
)
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.studies.interactions.places import Place

# largest difference of a bus voltage [pu] between two systems at the same operating point
SAME_FLOW = 1e-6

_OF_PLACE = ("S_n", "P_0", "Q_0", "v_0", "theta_0", "f_n", "connected")
"""Values that belong to the place and not to the device: rating, start values, frequency, breaker."""


def stand_in_at(place: Place, model: str) -> ComponentTable:
    return ComponentTable(model=model, bus=place.table.bus, parameters=_of_place(place))


def vendors_device_at(place: Place, template: Place) -> ComponentTable:
    own = settings_of(template)
    return template.table.model_copy(
        update={
            "bus": place.table.bus,
            "parameters": own | _of_place(place, template.plan.description),
            "inputs": dict(template.plan.inputs),
        }
    )


def settings_of(place: Place) -> dict[str, Value]:
    return {name: value for name, value in place.plan.parameters.items() if name not in _OF_PLACE}


def file_at(
    place: Place, file: Path, binding: Path | None, values: Mapping[str, Value]
) -> ComponentTable:
    wrong = [name for name in values if name in _OF_PLACE]
    if wrong:
        raise InputError(
            f"{file}: {', '.join(wrong)} cannot be set, because it is the place's, not the device's"
        )
    return ComponentTable(
        fmu=str(file.absolute()),
        binding=None if binding is None else str(binding.absolute()),
        bus=place.table.bus,
        parameters={**values, **_of_place(place, bound_fmu(file, binding))},
    )


def _of_place(place: Place, device: FmuDescription | None = None) -> dict[str, Value]:
    """Return what the power flow reads of the device there: any device with these values gives the same power flow.

    Rated frequency and breaker are left out where the device, if it is not of the catalogue, does not have them."""
    plan = place.plan
    found: dict[str, Value] = {name: plan.number(name) for name in ("S_n", "P_0")}
    found |= (
        {"Q_0": plan.number("Q_0")} if "Q_0" in plan.parameters else {"v_0": plan.number("v_0")}
    )
    if place.table.bus is None:  # no power flow computes the rest
        found |= {name: plan.number(name) for name in ("Q_0", "v_0", "theta_0")}
    f_n = _rated_frequency(place)
    if f_n is not None:
        found["f_n"] = f_n
    if "connected" in plan.parameters:
        found["connected"] = bool(plan.parameters["connected"])
    return (
        found
        if device is None
        else {name: value for name, value in found.items() if name in device.variables}
    )


def _rated_frequency(place: Place) -> float | None:
    """Return the rated frequency of the device at a place [Hz]; None where it does not say."""
    description = place.plan.description
    if isinstance(description, BoundDescription):
        return description.port.f_n
    return place.plan.number("f_n") if "f_n" in description.variables else None


def exchanged_case(case: Case, exchanged: Mapping[str, ComponentTable]) -> Case:
    """The case with other devices; the same object where nothing is exchanged.

    What may name a variable of a device that is gone is left out: names of modes, plots, and events but those of the
    network, for which its FMU is made."""
    if not exchanged:
        return case
    table = case.table
    scenarios = {
        name: scenario
        if scenario.events is None
        else scenario.model_copy(update={"events": _grid_events(scenario.events)})
        for name, scenario in table.scenarios.items()
    }
    changed = table.model_copy(
        update={
            "analysis": AnalysisTable(),
            "plots": [],
            "reference": None,
            "events": _grid_events(table.events),
            "scenarios": scenarios,
            "solver": table.solver.model_copy(update={"record": ["*"]}),
        }
    )
    return replace(case, table=changed, exchanged=dict(exchanged))


def _grid_events(events: list[EventTable]) -> list[EventTable]:
    return [event for event in events if isinstance(event, GridEventBase)]


def require_same_flow(wanted: Mapping[str, complex], prepared: PreparedScenario) -> None:
    found = voltages_of(prepared.power_flow)
    apart = {bus: abs(found.get(bus, 0j) - voltage) for bus, voltage in wanted.items()}
    worst = max(apart, key=lambda bus: apart[bus], default=None)
    if worst is not None and not apart[worst] <= SAME_FLOW:
        raise InputError(
            f"with other devices the power flow is another one: the voltage of bus {worst!r} differs by "
            f"{apart[worst]:.3g} pu, where {SAME_FLOW:g} is allowed; a device must take S_n, P_0 and Q_0 or v_0 as "
            "they are given"
        )


def voltages_of(flow: PowerFlow | None) -> dict[str, complex]:
    return {} if flow is None else dict(flow.voltages)
