"""What may be asked of a study in Python, as its request."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

from orchestrator.api.values import binding_path
from orchestrator.asked import Names, checked, require_known, text_or_none
from orchestrator.asked import path as path_of
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.idle_values import DAMPING_CONTROLLERS
from orchestrator.coordinated_design.one_point import search_settings
from orchestrator.coordinated_design.study import PointsDesignRequest
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.interactions.request import GivenDevice, InteractionsRequest
from orchestrator.pod_design.design import DesignRequest, StageReport, design_pod
from orchestrator.pod_design.view import ControllerDesign
from orchestrator.points.store import PointStore


class WantedInteractions(TypedDict, total=False):
    """What may be asked of a study of interactions; `InteractionsRequest` says what each means.

    ``devices`` and ``bindings`` are files by the name of a device that is tried beside the case's, at ``places``."""

    threshold: float
    frequencies: tuple[float, float]
    stand_in: str
    swap: bool
    devices: Mapping[str, str | Path]
    bindings: Mapping[str, str | Path]
    places: Names
    black_box: bool


def interactions_request(wanted: WantedInteractions) -> InteractionsRequest:
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


class Wanted(TypedDict, total=False):
    """What may be asked of a design beside controller and scenario; `DesignRequest` says what each means."""

    component: str
    mode: str
    damping: float
    damping_increment: float
    delta_gain: float
    gain_bounds: tuple[float, float]
    stages: int
    compensated_gain: bool
    least_damping: float
    refine: bool
    margins: bool


def design_request(controller: str, wanted: Wanted, scenario: str | None, **rest: Any) -> DesignRequest:
    """A request of checked wishes; dampings are in percent.

    Parameters
    ----------
    controller
        ``pod_p`` or ``pod_q``.
    wanted
        As `Case.design`; a name that it does not have is refused.
    scenario
        Its name; where None, the one in which all PODs are there and off.
    rest
        Other fields of the request.
    """
    require_controllers([controller])
    require_known(wanted, Wanted.__annotations__, "a design")
    if "damping" in wanted and "damping_increment" in wanted:
        raise InputError("damping and damping_increment both say what is required; give one of them")
    text_or_none(scenario, "scenario", "a design is made for one scenario: give its name, or leave it out")
    return DesignRequest(controller, scenario=scenario, **checked(DesignRequest, wanted), **rest)


def require_controllers(controllers: Sequence[str]) -> None:
    """Refuse a controller that there is not."""
    for controller in controllers:
        if controller not in DAMPING_CONTROLLERS:
            raise InputError(f"there is no controller {controller!r}; there are: {', '.join(DAMPING_CONTROLLERS)}")


def design_controller(
    file: CaseFile, request: DesignRequest, *, report: StageReport = lambda text: None, store: PointStore | None = None
) -> ControllerDesign:
    """As `Case.design`; ``store`` keeps figures on the way."""
    return ControllerDesign(design_pod(file, request, report, store, search_settings))


class WantedOverPoints(TypedDict, total=False):
    """What may be asked of a design over operating points; `PointsDesignRequest` says what each means."""

    components: Names
    modes: Names
    damping: float | None
    gain_bounds: tuple[float, float]
    stages: int | None
    least_damping: float
    ranked: int


def points_design_request(controllers: Sequence[str], wanted: WantedOverPoints, **rest: Any) -> PointsDesignRequest:
    """A request of checked wishes.

    Parameters
    ----------
    controllers
        ``pod_p``, ``pod_q``, or both.
    wanted
        What is asked for.
    rest
        Other fields of the request.

    Raises
    ------
    InputError
        If one of the wishes is unknown, not of its kind or outside of its range; it is named.
    """
    require_controllers(controllers)
    if not controllers:
        raise InputError(f"controllers is empty; name one or both of {', '.join(DAMPING_CONTROLLERS)}")
    require_known(wanted, WantedOverPoints.__annotations__, "a design over points")
    return PointsDesignRequest(tuple(controllers), **checked(PointsDesignRequest, wanted), **rest)


class WantedPlaces(TypedDict, total=False):
    """What may be asked of the places of a device; `SiteRequest` says what each means."""

    binding: str | Path | None
    below: float
    frequencies: tuple[float, float]
    outages: Names | None
    confirm: int
    rating: float
    gain: float
