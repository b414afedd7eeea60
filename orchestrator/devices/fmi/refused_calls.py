"""Refusal of a call by a component, as the error that a user sees: the FMU's own words, or FMI's."""

from collections.abc import Callable

from orchestrator.core.errors import ComponentError, CosimError, EndedError
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.fmi3 import in_words_of_3

STATUS = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
# fmi2Status beyond OK and warning
DISCARD = 2
ERROR = 3
FATAL = 4
PENDING = 5

_SILENT = {
    DISCARD: "by FMI it has no answer to this call",
    ERROR: "by FMI it cannot go on from here",
    FATAL: "by FMI all its instances in this process are lost",
    PENDING: "by FMI it will answer later, which this master does not wait for",
}
"""What a status means where an FMU says nothing."""

IN_THE_LOG = "an error in the log"
"""The status of a call that was granted, while the FMU logs an error with it."""

_INITIALISING = frozenset(
    f"fmi{version}{step}InitializationMode" for version in (2, 3) for step in ("Enter", "Exit")
)
_REFUSING = frozenset(
    [
        IN_THE_LOG,
        *(f"fmi{version}{status}" for version in (2, 3) for status in ("Discard", "Error")),
    ]
)

Said = Callable[[int], list[str]]  # gives the distinct messages of at least a status, oldest first


def refusal(
    component: Component, said_by: Said, status: int, call: str, time: float | None
) -> CosimError:
    """The error for a call whose status is neither OK nor Warning.

    ``call``: by its name in FMI 2.0; the error has the name in the FMU's own version."""
    described = component.description
    name = in_its_words(described, STATUS[status] if status < len(STATUS) else f"status {status}")
    said = "; ".join(said_by(1) or said_by(0))
    if status == DISCARD and call == "fmi2DoStep" and time is not None:
        failed = bool(said_by(DISCARD))  # some say that they ended whenever a step failed
        ended, reached = component.progress_of_step()
        if ended and not failed:
            return EndedError(
                component.name, name, said, time, time if reached is None else reached
            )
        said = said or _partly(reached, time)
    said = said or f"it logs no text; {_SILENT.get(status, 'FMI knows no such status')}"
    return ComponentError(component.name, in_its_words(described, call), name, said, time)


def _partly(reached: float | None, time: float) -> str:
    """Return what FMI says of a step that an FMU discards without a word."""
    if reached is not None and reached > time:
        return f"it logs no text; by FMI it computed the step up to t = {reached:.6g} s only, and a shorter one may do"
    return "it logs no text; by FMI it did not compute the whole step, and a shorter one may do"


def in_its_words(description: FmuDescription, text: str) -> str:
    return in_words_of_3(text) if description.fmi_version == "3.0" else text


def refuses_to_start(error: ComponentError) -> bool:
    """Return whether a component refused its initialisation, which is neither another call nor the end of its process.

    The error's call and status are names of FMI, in its version 2.0 or 3.0."""
    return error.call in _INITIALISING and error.status in _REFUSING


def check_log(name: str, said_by: Said, call: str) -> None:
    errors = said_by(ERROR)
    if errors:
        raise ComponentError(name, call, IN_THE_LOG, "; ".join(errors))
