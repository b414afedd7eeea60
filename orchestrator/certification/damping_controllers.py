"""The active damping controllers: they are set if the FMU has our variables, otherwise the applicant declares them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.cases.schema import Value
from orchestrator.certification.request import CertificationRequest
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription, VariableInfo
from orchestrator.fmi.port import BoundDescription
from orchestrator.fmi.values import as_text

SET = "set in the FMU"
READ = "as the FMU's variables say"
DECLARED = "declared by the applicant; the FMU has no variable that shows it"
UNSEEN = "no output shows its effect"
UNKNOWN = "nothing was declared, and the FMU has no variable that shows it: taken for none"


_AS_DECLARED = " as declared by the applicant"


@dataclass(frozen=True)
class DampingControllers:
    pod: str
    source: str
    # values to be set for these controllers, by the FMU's variable.
    settings: Mapping[str, bool] = field(default_factory=dict)
    declared: str = ""  # letters of the controllers, active or not, that only the applicant declares
    unseen: str = ""  # letters of active controllers with a switch but without an output that shows their effect
    can_be_off: bool = False  # whether each active one has a switch that may be set

    def in_words(self) -> str:
        """The active controllers for a headline, with a note on each one that is not certain."""
        active = self.pod.removeprefix("none")
        if not active:
            return f"without POD{_AS_DECLARED if self.declared else ''}"
        groups: dict[str, list[str]] = {}
        for letter in active:
            said = _AS_DECLARED if letter in self.declared else f" ({UNSEEN})" if letter in self.unseen else ""
            groups.setdefault(said, []).append(f"POD-{letter.upper()}")
        return "with " + " and ".join(f"{' and '.join(names)}{said}" for said, names in groups.items())


def damping_controllers(description: FmuDescription, request: CertificationRequest) -> DampingControllers:
    """The damping controllers that a request sets or declares for an FMU."""
    known = {letter: _state(description, request, letter) for letter in "pq"}
    if request.pod is None:
        active = "".join(letter for letter, value in known.items() if value) or "none"
        unseen = _unseen(description, known, active)
        source = UNKNOWN if None in known.values() and active == "none" else _with_unseen(READ, unseen)
        return DampingControllers(active, source, unseen=unseen, can_be_off=_switched(description, active))
    wanted = {letter: letter in request.pod.removeprefix("none") for letter in "pq"}
    settings = {}
    for letter, on in wanted.items():
        name = variable(letter)
        _refuse_contradiction(description, request, name, on)
        if _is_switch(description.variables.get(name)):
            settings[name] = on
    source = SET if all(known[letter] is not None for letter in "pq") else _partly(known, request.pod)
    unseen = _unseen(description, known, request.pod)
    declared = "".join(letter for letter, value in known.items() if value is None)
    can_be_off = _switched(description, request.pod)
    return DampingControllers(request.pod, _with_unseen(source, unseen), settings, declared, unseen, can_be_off)


def variable(letter: str) -> str:
    return f"pod_{letter}.enabled"


def _switched(description: FmuDescription, pod: str) -> bool:
    return all(_is_switch(description.variables.get(variable(letter))) for letter in pod.removeprefix("none"))


def _unseen(description: FmuDescription, known: Mapping[str, bool | None], pod: str) -> str:
    switched = [letter for letter in pod.removeprefix("none") if known[letter] is not None]
    return "".join(letter for letter in switched if f"delta_{letter}_pod" not in description.variables)


def _with_unseen(source: str, unseen: str) -> str:
    names = " and ".join(f"POD-{letter.upper()}" for letter in unseen)
    return f"{source}; {UNSEEN} ({names})" if unseen else source


def _partly(known: Mapping[str, bool | None], pod: str) -> str:
    hidden = [f"POD-{letter.upper()}" for letter, value in known.items() if value is None]
    if len(hidden) == len(known):
        return DECLARED
    return f"{SET}, except {hidden[0]}: {DECLARED}" if pod != "none" else SET


def _state(description: FmuDescription, request: CertificationRequest, letter: str) -> bool | None:
    name = variable(letter)
    bound = _bound(description, name)
    if bound is not None:
        return bound
    info = description.variables.get(name)
    if not _is_switch(info):
        return None
    given = request.values.get(name)
    return bool(given) if given is not None else info is not None and info.start is True


def _is_switch(info: VariableInfo | None) -> bool:
    return info is not None and info.type == "Boolean" and info.causality in ("parameter", "input")


def _bound(description: FmuDescription, name: str) -> bool | None:
    """The value that the binding gives a switch; None if it gives no value."""
    if isinstance(description, BoundDescription):
        value: Value | None = description.port.settings.get(description.inner_names.get(name, name))
        return None if value is None else bool(value)
    return None


def _refuse_contradiction(description: FmuDescription, request: CertificationRequest, name: str, on: bool) -> None:
    said = {"--set": request.values.get(name), f"the binding {request.binding}": _bound(description, name)}
    for source, value in said.items():
        if value is not None and value is not on:
            raise InputError(
                f"--pod {request.pod} needs {name} = {as_text(on)}, but {source} has {name} = {as_text(value)}; "
                "leave one of them away, or make them agree"
            )
