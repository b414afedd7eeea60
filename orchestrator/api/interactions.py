"""What may be asked of a study of interactions in Python."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

from orchestrator.api.executors import PointStudy
from orchestrator.api.values import binding_path
from orchestrator.api.values import path as path_of
from orchestrator.asked import Names, checked, require_known
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.interactions.request import GivenDevice, InteractionsRequest
from orchestrator.interactions.study import run_interactions
from orchestrator.interactions.view import Interactions


class WantedInteractions(TypedDict, total=False):
    """What may be asked of a study of interactions; `InteractionsRequest` says what each means.

    ``devices`` and ``bindings`` are files by the name of a device that is tried beside the case's, at ``places``.
    """

    threshold: float
    frequencies: tuple[float, float]
    stand_in: str
    swap: bool
    devices: Mapping[str, str | Path]
    bindings: Mapping[str, str | Path]
    places: Names
    black_box: bool


def request_of(wanted: WantedInteractions) -> InteractionsRequest:
    """A request of checked wishes.

    Raises
    ------
    InputError
        If one of the wishes is unknown, not of its kind or outside of its range; it is named.
    """
    require_known(wanted, WantedInteractions.__annotations__, "interactions")
    bindings, files = wanted.get("bindings", {}), wanted.get("devices", {})
    if lonely := [name for name in bindings if name not in files]:
        raise InputError(f"bindings: there is no device {lonely[0]!r}; the devices are: {', '.join(files) or 'none'}")
    given = {name: (path_of(file, "devices"), binding_path(bindings.get(name))) for name, file in files.items()}
    devices = tuple(GivenDevice(name, as_device(*of), of[1]) for name, of in given.items())
    request = InteractionsRequest(**checked(InteractionsRequest, wanted), devices=devices)
    return replace(request, swap=request.swap or bool(devices))


STUDY = PointStudy(run_interactions, Interactions, "orchestrator.interactions.worker")
