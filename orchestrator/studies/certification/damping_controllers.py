"""The active damping controllers: they are set if the FMU has our variables, otherwise the applicant declares them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.devices.fmi.values import as_text
from orchestrator.studies.certification.request import CertificationRequest

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
    # letters of the controllers, active or not, that only the applicant declares
    declared: str = ""
    # letters of active controllers with a switch but without an output that shows their effect
    unseen: str = ""
    can_be_off: bool = False  # whether each active one has a switch that may be set

    def in_words(self) -> str:
        """The active controllers for a headline, with a note on each one that is not certain."""
        active = self.pod.removeprefix("none")
        if not active:
            return f"without POD{_AS_DECLARED if self.declared else ''}"
        groups: dict[str, list[str]] = {}
        for letter in active:
            note = f" ({UNSEEN})" if letter in self.unseen else ""
            note = _AS_DECLARED if letter in self.declared else note
            groups.setdefault(note, []).append(f"POD-{letter.upper()}")
        return "with " + " and ".join(
            f"{' and '.join(names)}{said}" for said, names in groups.items()
        )


def damping_controllers(
    description: FmuDescription, request: CertificationRequest
) -> DampingControllers:
    known, settings = (
        {letter: _state(description, request, letter) for letter in "pq"},
        dict[str, bool](),
    )
    hidden = "".join(letter for letter, value in known.items() if value is None)
    pod = request.pod
    if pod is None:
        pod, declared = "".join(letter for letter, value in known.items() if value) or "none", ""
        source = UNKNOWN if hidden and pod == "none" else READ
    else:
        declared = hidden
        for letter in "pq":
            name, on = variable(letter), letter in pod.removeprefix("none")
            _refuse_contradiction(description, request, name, on)
            if _is_switch(description.variables.get(name)):
                settings[name] = on
        source = DECLARED if hidden == "pq" else SET
        source += (
            f", except POD-{hidden.upper()}: {DECLARED}"
            if len(hidden) == 1 and pod != "none"
            else ""
        )
    active = pod.removeprefix("none")
    switched = [letter for letter in active if letter not in hidden]
    unseen = "".join(
        letter for letter in switched if f"delta_{letter}_pod" not in description.variables
    )
    names = " and ".join(f"POD-{letter.upper()}" for letter in unseen)
    source += f"; {UNSEEN} ({names})" if unseen else ""
    can_be_off = all(_is_switch(description.variables.get(variable(letter))) for letter in active)
    return DampingControllers(pod, source, settings, declared, unseen, can_be_off)


def variable(letter: str) -> str:
    return f"pod_{letter}.enabled"


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


def _refuse_contradiction(
    description: FmuDescription, request: CertificationRequest, name: str, on: bool
) -> None:
    said = {
        Option.SET: request.values.get(name),
        f"the binding {request.binding}": _bound(description, name),
    }
    for source, value in said.items():
        if value is not None and value is not on:
            raise InputError(
                Option.POD
                + f" {request.pod} needs {name} = {as_text(on)}, but {source} has {name} = "
                f"{as_text(value)}; leave one of them away, or make them agree"
            )
