"""Plants of several units: their controllers as components, the connections of these, and their start values."""

import cmath
from collections.abc import Collection, Iterator, Sequence

from fmus.wecc_renewable.dyr_records import CONTROLLER, CONTROLLER_RECORD
from orchestrator.cases.draft import Draft, UnitOrigin
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.form.schema import ComponentTable, UnitsTable
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.plant_controllers import (
    PlantController,
    plant_controllers,
    units_of_plants,
)
from orchestrator.cases.networks.psse.raw_network import unit_labels
from orchestrator.cases.scenario.measured_points import FoundPoint, find_point, power_into
from orchestrator.core.errors import InputError, Problem, QuestionTopic

_COMMON = (
    "converter_parameters"  # key of [units] with values of units, of which a controller takes none
)
_SIGNALS = ("delta_P", "delta_Q")
"""Outputs of a controller, and behind `_AT_UNIT` the inputs of its units."""

_AT_UNIT = "plant."
_POWERS = ("p", "q")
"""Inputs of a controller for the power into the measured branch."""


def take_plants(
    draft: Draft,
    table: UnitsTable,
    records: Sequence[DynamicRecord],
    ours: Collection[tuple[int, str]],
) -> frozenset[tuple[str, int]]:
    """Give the draft its plants of several units; return the places of their controllers' records.

    ``records``: without those that the case leaves out; ``ours``: machines that a converter of the case replaces."""
    data = draft.data
    if data is None or table.dyr_approximate:
        return frozenset()
    labels = unit_labels(data.machines)
    units = [u for u in units_of_plants(records) if u.machine in labels and u.machine not in ours]
    draft.units_of_plants = {f"gfor{labels[unit.machine]}": unit for unit in units}
    draft.plant_controllers = plant_controllers(records, [unit.plant for unit in units])
    return frozenset((x.record.file, x.record.line) for x in draft.plant_controllers)


def plant_components(draft: Draft) -> dict[str, ComponentTable]:
    """Return a component for each controller, with the line of the record that gives its parameters."""
    found = {}
    for one in draft.plant_controllers:
        values = dict(one.parameters)
        found[one.name] = ComponentTable(model=CONTROLLER_RECORD.part, parameters=values)
        lines = dict.fromkeys(values, one.record.line)
        draft.origins[one.name] = UnitOrigin(one.record.file, frozenset(values), _COMMON, lines)
    draft.known |= {*found}
    return found


def plant_sources(draft: Draft) -> Iterator[tuple[str, str, str]]:
    """Yield outputs, the inputs that they feed, and the place of the record that says so.

    A unit without its controller keeps its references, and is asked about; what cannot be found is noted."""
    there = {}
    for one in draft.plant_controllers:
        if one.name in draft.system.components and draft.grid is not None:
            there[one.record.bus] = one.name
            yield from ((*ends, one.record.place) for ends in _measured(draft, one))
    for name, unit in draft.units_of_plants.items():
        plan = draft.system.components.get(name)
        if plan is None or _AT_UNIT + _SIGNALS[0] not in plan.description.inputs:
            continue
        if unit.plant in there:
            for signal in _SIGNALS:
                source = f"{there[unit.plant]}.{signal}"
                yield source, f"{name}.{_AT_UNIT}{signal}", unit.record.place
            continue
        for signal in _SIGNALS:
            plan.inputs.setdefault(_AT_UNIT + signal, 0.0)
        text = (
            f"{name}: {unit.record.name} names bus {unit.plant}, of which no {CONTROLLER} is used; "
            "its references are constant"
        )
        topic = QuestionTopic("a unit without the controller of its plant", name)
        draft.found.questions.append(Problem(unit.record.place, text, topic=topic))


def _measured(draft: Draft, one: PlantController) -> Iterator[tuple[str, str]]:
    found = _place_of(draft, one)
    if found is None:
        inputs = draft.system.components[one.name].description.inputs
        draft.found.refused_inputs.update(f"{one.name}.{variable}" for variable in inputs)
        return
    for part in ("v_re", "v_im"):
        yield f"{draft.grid}.{found.bus}.{part}", f"{one.name}.{part}"
    plan = draft.system.components[one.name]
    if found.is_far:
        plan.parameters["reversed"] = True
    if found.line is not None:
        yield from ((f"{draft.grid}.{found.line}.{x}", f"{one.name}.{x}") for x in _POWERS)
        return
    for variable in _POWERS:
        plan.inputs.setdefault(variable, 0.0)
    if plan.number("RefFlag") != 1 or plan.number("Fflag"):
        text = (
            f"{one.name}: {CONTROLLER} names no branch, so that it measures no power, which its flags ask for "
            "(RefFlag other than 1, or Fflag); give BUS1, BUS2 and CKTID of a branch"
        )
        topic = QuestionTopic("a plant's controller without a branch", one.name)
        draft.found.questions.append(Problem(one.record.place, text, topic=topic))


def _place_of(draft: Draft, one: PlantController) -> FoundPoint | None:
    try:
        return find_point(draft, one.point, bus_name(str(one.record.bus)))
    except InputError as error:
        draft.note(one.point.place, f"{one.name}: {error}")
        return None


def start_plants(draft: Draft, flow: PowerFlow) -> None:
    """Set the start values of all controllers of several units, also of those of a case's own; what is given stays.

    Their connections tell where they measure."""
    fed = {str(wire.target): wire.source for wire in draft.system.connections}
    for name, plan in draft.system.components.items():
        if plan.description.model_name != CONTROLLER_RECORD.part:
            continue
        bus, line = (
            fed[end].variable.rpartition(".")[0]
            if end in fed and fed[end].component == draft.grid
            else ""
            for end in (f"{name}.v_re", f"{name}.p")
        )
        start: dict[str, float] = {}
        if bus in flow.voltages:
            v = flow.voltages[bus]
            start |= {"v_0": abs(v), "theta_0": cmath.phase(v)}
        if any(one.name == line for one in flow.lines):
            power = power_into(line, flow)
            start |= {"p_0": power.real, "q_0": power.imag}
        plan.parameters |= {k: x for k, x in start.items() if k not in plan.parameters}
