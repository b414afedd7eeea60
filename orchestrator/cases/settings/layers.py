"""Sources of values besides the components' own tables: parameter files, the scenario, the command line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.draft import COMMAND_LINE, Draft
from orchestrator.cases.form.build_choices import Layer, Place, layer_of
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value


@dataclass(frozen=True)
class OptionValues(ParameterFile):
    """Values of ``--set`` as a layer of their own, which the values that a sweep varies override."""

    @classmethod
    def of(cls, values: Mapping[str, Value]) -> "OptionValues":
        return cls(Path(COMMAND_LINE), "", dict(values))

    def place(self, key: str) -> str:
        return COMMAND_LINE + f" {key}"


def joined_values(layers: Sequence[ParameterFile]) -> dict[str, Value]:
    """Values by ``component.variable``, those of the strongest layer that has the key; the weakest comes first."""
    return {key: value for layer in layers for key, value in layer.values.items()}


def value_layers(
    draft: Draft, parameters: Sequence[ParameterFile], overrides: Mapping[str, Value]
) -> list[Layer]:
    """All layers, weakest first: files of the scenario, the scenario, files of the command line, values of the command
    line."""
    has_units = draft.given.case.units is not None
    layers: list[Layer] = []

    def add(given: Mapping[str, Value], place: Place) -> None:
        layers.append(layer_of(given, place, has_units=has_units))

    for index, name in enumerate(draft.given.scenario.parameters):
        file = draft.given.parameter_files[name]
        if isinstance(file, str):
            draft.note(draft.given.place("scenarios", draft.given.name, "parameters", index), file)
        else:
            add(file.values, file.place)
    add(
        draft.given.scenario.set,
        lambda key: draft.given.place("scenarios", draft.given.name, "set", key),
    )
    for file in parameters:
        add(file.values, file.place)
    add(overrides, lambda key: COMMAND_LINE + f" {key}")
    return layers
