"""Where values come from beside the components' own tables: parameter files, the scenario, the command line."""

from collections.abc import Mapping, Sequence

from orchestrator.cases.draft import COMMAND_LINE, Draft, Layer
from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.schema import Value
from orchestrator.errors import InputError


def value_layers(draft: Draft, parameters: Sequence[ParameterFile], overrides: Mapping[str, Value]) -> list[Layer]:
    """All layers, weakest first: the scenario's files, the scenario, files and then values of the command line."""
    layers: list[Layer] = []
    for index, name in enumerate(draft.scenario.parameters):
        try:
            layers.append(_of_file(read_parameter_file(draft.directory / name)))
        except InputError as error:
            draft.note(draft.place("scenarios", draft.name, "parameters", index), str(error))
    layers.append(Layer(draft.scenario.set, lambda key: draft.place("scenarios", draft.name, "set", key)))
    layers += map(_of_file, parameters)
    layers.append(Layer(overrides, lambda key: f"{COMMAND_LINE} {key}"))
    return layers


def _of_file(file: ParameterFile) -> Layer:
    return Layer(file.values, file.place)
