"""Points of the network at which plants' controllers and compensators measure: connections and start values."""

from dataclasses import dataclass

from fmus.grid.network import Line
from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.form.remedies import without_models
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.core.errors import InputError

OF_VOLTAGE = ("held.v",)
"""Input of a compensator that holds another bus' voltage [pu]."""

INPUTS = ("plant.v", "plant.p", "plant.q")
"""Inputs of a plant that measures elsewhere: voltage [pu], active and reactive power [pu, 100 MVA]."""


@dataclass(frozen=True)
class FoundPoint:
    """A measured point in the network: a bus, and a line, None for the unit's own power; ``is_far``: the end of the
    line that is measured is the one that its power does not enter at."""

    bus: str
    line: str | None = None
    is_far: bool = False


def measured_sources(draft: Draft, name: str, own_bus: str) -> list[tuple[str, str]]:
    """Return the grid's outputs and the unit's inputs that they feed; none for a unit that measures at its terminal.

    What cannot be found in the network is noted."""
    point = draft.measured.get(name)
    if point is None or draft.grid is None:
        return []
    try:
        found = find_point(draft, point, own_bus)
    except InputError as error:
        draft.note(point.place, f"{name}: {error}")
        inputs = OF_VOLTAGE if point.of_voltage else INPUTS
        draft.found.refused_inputs.update(f"{name}.{variable}" for variable in inputs)
        return []
    if point.of_voltage:
        return [(f"{draft.grid}.{found.bus}.v", f"{name}.{OF_VOLTAGE[0]}")]
    if found.is_far:
        draft.system.components[name].parameters["plant.reversed"] = True
    of_power = found.line or name
    outputs = (f"{found.bus}.v", f"{of_power}.p", f"{of_power}.q")
    return [
        (f"{draft.grid}.{output}", f"{name}.{variable}")
        for output, variable in zip(outputs, INPUTS, strict=True)
    ]


def start_measured_points(draft: Draft, flow: PowerFlow) -> None:
    """Set the start values of all units that measure elsewhere."""
    if draft.network is None:
        return
    buses = {port.name: port.bus for port in draft.network.ports}
    for name, point in draft.measured.items():
        if name not in draft.system.components:
            continue
        plan = draft.system.components[name]
        found = find_point(draft, point, buses[name])
        if point.of_voltage:
            plan.parameters["held.v_0"] = abs(flow.voltages[found.bus])
            continue
        if found.line is None:
            power = flow.powers[name] * plan.number("S_n") / plan.number("S_base")
        else:
            power = power_into(found.line, flow)
        plan.parameters |= {
            "plant.v_0": abs(flow.voltages[found.bus]),
            "plant.p_0": power.real,
            "plant.q_0": power.imag,
        }


def power_into(name: str, flow: PowerFlow) -> complex:
    """Power that enters a line without its charging [pu, 100 MVA], as the grid's models give it."""
    (line,) = (line for line in flow.lines if line.name == name)
    v = flow.voltages[line.from_bus]
    into, _ = line.powers(v, flow.voltages[line.to_bus])
    return complex(into + 1j * line.charging[0] * abs(v) ** 2)


def find_point(draft: Draft, point: MeasuredPoint, own_bus: str) -> FoundPoint:
    """Return the place of a measured point in the network; an `InputError` where it is not there.

    ``own_bus``: of the controller."""
    assert draft.network is not None
    bus = bus_name(str(point.bus)) if point.bus else own_bus
    remedy = (
        f"correct it, or write {without_models([point.record])}, and the references are constant"
    )
    if point.of_voltage:
        remedy = "correct it, or write 0 for its own bus"
    if bus not in draft.network.buses:
        raise InputError(
            f"{point.record} measures at bus {point.bus}, which the network has not; {remedy}"
        )
    if not point.near:
        return FoundPoint(bus)
    line = line_of_numbers(draft, point.near, point.far, point.circuit)
    if line is None:
        raise InputError(
            f"{point.record} measures the branch {point.near}-{point.far}, circuit {point.circuit!r}, which is no line "
            f"or transformer of two windings of the network; {remedy}"
        )
    return FoundPoint(bus, line.name, is_far=line.from_bus != bus_name(str(point.near)))


def line_of_numbers(draft: Draft, near: int, far: int, circuit: str) -> Line | None:
    """Return the branch between buses of the file, by their numbers; None where there is none, or no sole one."""
    ends = {bus_name(str(number)) for number in (near, far)}
    names = draft.data.branch_names if draft.data else {}
    lines = draft.network.lines if draft.network else ()
    between = [line for line in lines if {line.from_bus, line.to_bus} == ends]
    of_circuit = [x for x in between if x.name in names and names[x.name].circuit == circuit]
    chosen = of_circuit or (between if len(between) == 1 else [])
    return chosen[0] if chosen else None
