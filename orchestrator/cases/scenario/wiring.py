"""Connections of a case: those written in the file, and those of every component that names its bus."""

from dataclasses import dataclass
from difflib import get_close_matches

from fmus.toolchain.catalogue import model_names
from orchestrator.cases.draft import Draft
from orchestrator.cases.scenario.dc_lines import dc_sources
from orchestrator.cases.scenario.measured_points import measured_sources
from orchestrator.cases.scenario.plants_of_several import plant_sources
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few
from orchestrator.core.options import Option
from orchestrator.devices.fmi.port_mapping import PHASOR_PORT


@dataclass(frozen=True)
class _Way:
    """Handling of a value by its connection; fields as in `System.connect`."""

    ignore_units: bool = False
    converted: tuple[float, float] | None = None


_PLAIN = _Way()


def connect(draft: Draft) -> None:
    for index, wire in enumerate(draft.given.case.connections):
        ends = {wire.source.partition(".")[0], wire.target.partition(".")[0]}
        if not ends & set(draft.given.scenario.remove):
            place = draft.given.place("connections", index)
            way = _Way(wire.ignore_units, wire.converted)
            _try_connect(draft, wire.source, wire.target, place, way)
    at_buses = [
        n
        for n, table in draft.tables.items()
        if table.bus is not None and n in draft.system.components
    ]
    _check_forms(draft, at_buses)
    taken = _taken_by_port(draft)
    for name in at_buses:
        _connect_to_bus(draft, name, draft.tables[name].bus or "", taken.get(name, []))
    if not draft.found.network_failed and draft.grid in draft.system.components:
        for source, target, place in (*plant_sources(draft), *dc_sources(draft)):
            _try_connect(draft, source, target, place)


def _taken_by_port(draft: Draft) -> dict[str, list[str]]:
    """Variables that the grid takes from each device: its current, or an emf with its admittance."""
    found: dict[str, list[str]] = {}
    if draft.grid in draft.system.components:
        for taken in draft.system.components[draft.grid].description.inputs:
            port, _, variable = taken.rpartition(".")
            found.setdefault(port, []).append(variable)
    return found


def _check_forms(draft: Draft, names: list[str]) -> None:
    """Refuse EMT models in a network of phasors, and question phasor models in a network of the other kind; once for
    each model, whatever the number of its components."""
    if (
        draft.found.network_failed
        or draft.network is None
        or draft.grid not in draft.system.components
    ):
        return
    taken = draft.system.components[draft.grid].description.inputs
    phasors: dict[str, list[str]] = {}
    for name in names:
        given = draft.system.components[name].description.outputs
        wanted = {v for v in PHASOR_PORT if f"{name}.{v}" in taken}
        if wanted - {*given}:
            draft.found.misfits[name] = draft.tables[name].model or draft.tables[name].file or ""
        elif not wanted and f"{name}.i_re" in taken and {*PHASOR_PORT} <= {*given}:
            phasors.setdefault(
                draft.tables[name].model or draft.tables[name].file or "", []
            ).append(name)
    for model in dict.fromkeys(draft.found.misfits.values()):
        others = [name for name, its in draft.found.misfits.items() if its == model]
        draft.note(
            _place_of_model(draft, others[0]),
            f"{few(others, 1)}: {model!r} is an EMT model, and the network {draft.grid!r} is one of phasors "
            f"({draft.tables[draft.grid].model}), to which a device gives an emf behind an admittance; "
            f"{_remedy(model)}",
        )
    for model, others in phasors.items():
        text = (
            f"{few(others, 1)}: {model!r} is a phasor model, and the network {draft.grid!r} is an EMT one "
            f"({draft.tables[draft.grid].model}): its current would follow the voltage at once; take "
            f"{model.removesuffix('_phasor')!r}, or model = 'phasor_grid' for the network and phasor models for all"
        )
        topic = QuestionTopic("a phasor model at an EMT network", others[0])
        draft.found.questions.append(Problem(_place_of_model(draft, others[0]), text, topic=topic))


def _remedy(model: str) -> str:
    phasor = f"{model}_phasor"
    if phasor in model_names():
        return f"take {phasor!r}, or model = 'grid' for the network and EMT models for all"
    if model in model_names():
        return "it has no phasor form: take another model, or model = 'grid' for the network and EMT models for all"
    needed = f"an FMU needs the outputs {', '.join(PHASOR_PORT)} for that"
    return (
        f"{needed}, or give the network the model 'grid', a case with `models` by "
        + Option.SET
        + " models=emt"
    )


def _place_of_model(draft: Draft, name: str) -> str:
    origin = draft.origins.get(name)
    if origin is None:
        return draft.given.place("components", name, "model" if draft.tables[name].model else "fmu")
    return draft.given.place("units", origin.common.removesuffix("_parameters"))


def check_inputs(draft: Draft) -> None:
    """Every input needs a source, and only one."""
    for wire in draft.system.connections:
        if wire.target.variable in draft.system.components[wire.target.component].inputs:
            text = f"{wire.target} is given a constant, but {wire.source} feeds it; remove the one or the other"
            draft.note(draft.given.place("components", wire.target.component, "inputs"), text)
    for endpoint in draft.system.unconnected_inputs():
        if str(endpoint) in draft.found.refused_inputs:
            continue
        if draft.found.network_failed and (
            draft.tables[endpoint.component].bus or endpoint.component == draft.grid
        ):
            continue
        if (
            endpoint.component == draft.grid
            and endpoint.variable.rpartition(".")[0] in draft.found.misfits
        ):
            continue
        text = (
            f"nothing feeds the input {endpoint}; connect it, or give it a constant under 'inputs'"
        )
        draft.note_of_scenario(draft.given.place("components", endpoint.component), text)


def _connect_to_bus(draft: Draft, name: str, bus: str, taken: list[str]) -> None:
    where = draft.given.place("components", name, "bus")
    if draft.found.network_failed:
        return
    if draft.grid is None or draft.network is None:
        draft.note(
            where,
            "a bus needs a [power_flow] table whose grid is a model with a network; or use [[connections]]",
        )
        return
    if not any(port.name == name and port.bus == bus for port in draft.network.ports):
        known = ", ".join(f"{port.name} at {port.bus}" for port in draft.network.ports)
        draft.note(where, f"the network has no port {name!r} at bus {bus!r}; it has: {known}")
        return
    if draft.grid in draft.system.components:
        for part in ("re", "im"):
            _try_connect(draft, f"{draft.grid}.{bus}.v_{part}", f"{name}.v_{part}", where)
        for variable in taken if name not in draft.found.misfits else ():
            _try_connect(draft, f"{name}.{variable}", f"{draft.grid}.{name}.{variable}", where)
        for output, variable in measured_sources(draft, name, bus):
            _try_connect(draft, output, variable, where)


def _try_connect(draft: Draft, source: str, target: str, where: str, way: _Way = _PLAIN) -> None:
    ends = source.partition(".")[0], target.partition(".")[0]
    if any(end in draft.known and end not in draft.system.components for end in ends):
        return  # the problem of this end is noted already
    try:
        draft.system.connect(source, target, ignore_units=way.ignore_units, converted=way.converted)
    except InputError as error:
        draft.note(where, str(error))
        draft.found.refused_inputs.add(_meant_input(draft, target))


def _meant_input(draft: Draft, target: str) -> str:
    """The input at which a refused connection was to end; the likeliest one if there is none of that name."""
    name, _, variable = target.partition(".")
    plan = draft.system.components.get(name)
    inputs = () if plan is None else plan.description.inputs
    if variable in inputs:
        return target
    near = get_close_matches(variable, inputs, n=1) or inputs
    return f"{name}.{near[0]}" if len(near) == 1 else target
