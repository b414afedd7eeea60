"""Choices of what a scenario is built of; a case file, a parameter file and ``--set`` write them among the values.

``<component>.native`` chooses the kind of FMU, ``<component>.exciter`` and the other `PARTS` what a generator is made
of, ``<component>.records`` what a plant of WECC's generic models is made of, ``units.alpha`` the converters' share of
the units. No FMU has such a variable. They are taken out where a layer of values is made, and the preparation reads
them before it knows the FMUs."""

import fnmatch
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestrator.cases.form.schema import Value

# key of the share that all converters have; ``units.alpha.<label>`` is that of one unit
ALPHA = "units.alpha"
MODELS = "models"  # key of the kind of all models, EMT or phasor; see `model_kinds`
_NATIVE = "native"

PARTS = ("machine", "exciter", "governor", "stabilizer", "oel", "uel")
"""Keys of a component's table, of ``[units]`` and columns of its file that choose the parts of a generator."""

RECORDS = "records"
"""Key of a component's table that names PSS/E's records of which a plant of WECC's generic models, or a static var
compensator or a DC line's rectifier, is made."""

CHOICES = (*PARTS, RECORDS)
"""Keys of a component's table that choose what its model is made of."""


def chosen_parts(source: object) -> dict[str, str]:
    """Return the parts that a table or a command's options choose, by their keys."""
    choices = {part: getattr(source, part, None) for part in CHOICES}
    return {part: name for part, name in choices.items() if name is not None}


STAND_IN = "static_generation"
"""The neutral device: the current of the operating point, which turns with the voltage, and no other dynamics."""

Place = Callable[[str], str]  # key → where it is written


@dataclass(frozen=True)
class NativeChoice:
    pattern: str  # name of a component, or a pattern such as ``*``
    given: Value
    place: str

    def fits(self, component: str) -> bool:
        return fnmatch.fnmatch(component, self.pattern)

    @property
    def native(self) -> bool:
        if not isinstance(self.given, bool):
            raise ValueError(f"native = {self.given!r}; it must be true or false")
        return self.given


@dataclass(frozen=True)
class PartChoice:
    pattern: str  # name of a component, or a pattern such as ``g*``
    part: str  # one of `CHOICES`
    given: Value
    place: str

    def fits(self, component: str, *, has_part: bool) -> bool:
        """Return whether the choice is for a component; a pattern leaves out those that have no such part."""
        return component == self.pattern or (has_part and fnmatch.fnmatch(component, self.pattern))

    @property
    def name(self) -> str:
        if not isinstance(self.given, str):
            raise ValueError(
                f"{self.part} = {self.given!r}; it must be the name of a part, in quotes"
            )
        return self.given


@dataclass(frozen=True)
class ShareChoice:
    label: str
    given: Value
    place: str

    @property
    def share(self) -> float:
        if isinstance(self.given, bool | str) or not 0 <= self.given <= 1:
            raise ValueError(f"alpha = {self.given!r}; it must be a number from 0 to 1")
        return float(self.given)


@dataclass(frozen=True)
class Layer:
    """The values that one source gives: a parameter file, the scenario, or the command line."""

    values: Mapping[str, Value]  # of the components' variables, by ``component.variable``
    natives: tuple[NativeChoice, ...]  # kinds of FMU, in the source's order
    parts: tuple[PartChoice, ...]  # parts of generators, in the source's order
    # converters' shares; the one for all units comes first, so that those for one unit override it.
    shares: tuple[ShareChoice, ...]
    place: Place
    given: Mapping[str, Value]


def layer_of(given: Mapping[str, Value], place: Place, *, has_units: bool) -> Layer:
    values: dict[str, Value] = {}
    natives: list[NativeChoice] = []
    parts: list[PartChoice] = []
    shares: list[ShareChoice] = []
    for key, value in given.items():
        pattern, _, variable = key.partition(".")
        if key == MODELS:
            continue  # chosen before the components are known
        if has_units and (key == ALPHA or key.startswith(f"{ALPHA}.")):
            shares.append(ShareChoice(key.removeprefix(ALPHA).removeprefix("."), value, place(key)))
        elif variable == _NATIVE:
            natives.append(NativeChoice(pattern, value, place(key)))
        elif variable in CHOICES:
            parts.append(PartChoice(pattern, variable, value, place(key)))
        else:
            values[key] = value
    shares.sort(key=lambda choice: choice.label != "")
    return Layer(values, tuple(natives), tuple(parts), tuple(shares), place, given)
