"""The design of a POD controller."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

import pandas as pd

from orchestrator.api.values import path as path_of
from orchestrator.asked import checked, require_known, text_or_none
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.idle_values import DAMPING_CONTROLLERS
from orchestrator.cases.parameter_files import parameter_file_text
from orchestrator.coordinated_design.one_point import search_settings
from orchestrator.errors import InputError
from orchestrator.pod_design.design import DesignRequest, PodDesign, StageReport, design_pod
from orchestrator.pod_design.files import design_json, parameters_of, provenance
from orchestrator.points.store import PointStore
from orchestrator.report.notebook import page
from orchestrator.safe_files import write_text


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


class ControllerDesign:
    """A POD controller, and the closed loop with it. `Case.design` makes it.

    Attributes
    ----------
    result
        Every figure on the way.
    """

    def __init__(self, result: PodDesign) -> None:
        self.result = result

    @property
    def met(self) -> bool:
        """Whether the closed loop has the required damping, and leaves the other modes alone."""
        return self.result.met

    @property
    def parameters(self) -> dict[str, bool | float | str]:
        """The setting by ``component.variable``: the values of a scenario with this controller."""
        return parameters_of(self.result)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be borne in mind of the design."""
        return self.result.warnings

    def table(self) -> pd.DataFrame:
        """The mode before and after: eigenvalue [1/s, rad/s] and damping ratio, beside the required one."""
        r = self.result
        rows = {
            "without the controller": (r.initial, None),
            "predicted": (r.predicted, r.required_damping),
            "with it": (r.achieved, r.required_damping),
        }
        return pd.DataFrame(
            {
                "real": {name: value.real for name, (value, _) in rows.items()},
                "imag": {name: value.imag for name, (value, _) in rows.items()},
                "damping_percent": {name: -100 * value.real / abs(value) for name, (value, _) in rows.items()},
                "required_percent": {name: None if z is None else 100 * z for name, (_, z) in rows.items()},
            }
        )

    def as_json(self, parameter_file: str | Path | None = None) -> dict[str, Any]:
        """The same as ``gfor design --json`` prints, as JSON's types.

        Parameters
        ----------
        parameter_file
            Path of the parameter file, which the command names at the end; left out where None.
        """
        named = {} if parameter_file is None else {"parameter_file": str(parameter_file)}
        return design_json(self.result) | named

    def save(self, path: str | Path, command: str | None = None) -> Path:
        """Write the parameter file, which ``--parameters`` and `Case.scenario` take, and its JSON for ``gfor report``.

        Parameters
        ----------
        path
            Path of the parameter file; the JSON gets the same path with the suffix ``.json``.
        command
            The command that the file names as its origin; by default the call in Python.

        Raises
        ------
        InputError
            If the path is none, or ends in ``.json``: the JSON would take the parameter file's place.
        ResultsError
            If a file cannot be written.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> case = gfor.load("two_area")
        >>> file = case.design("pod_p", margins=False).save("pod_p.toml")
        >>> case.scenario("gfor", parameters=[file]).values["gfor.pod_p.K"]
        200.0
        """
        if command is None:
            command = f"gfor.load({self.result.case!r}).design({self.result.request.controller!r}, …) in Python"
        file = parameter_file_path(path)
        text = parameter_file_text(self.parameters, provenance(self.result, command))
        content = json.dumps(self.as_json(file), indent=1, ensure_ascii=False)
        write_text(file, text)
        write_text(file.with_suffix(".json"), content + "\n")
        return file

    def __repr__(self) -> str:
        said = "met" if self.met else "not met"
        return f"<ControllerDesign {self.result.request.controller} for {self.result.case}: requirement {said}>"

    def _repr_html_(self) -> str:
        setting = [f"{name} = {value}" for name, value in self.parameters.items()]
        lines = [self.result.stability.sentence(), *(f"warning: {text}" for text in self.warnings), ", ".join(setting)]
        return page(repr(self).strip("<>"), lines, self.table())


def request_of(controller: str, wanted: Wanted, scenario: str | None, **rest: Any) -> DesignRequest:
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


def parameter_file_path(given: str | Path, argument: str = "path") -> Path:
    """The path of a parameter file, beside which the design's JSON finds a place of its own.

    Raises
    ------
    InputError
        If it is none, or ends in ``.json``.
    """
    path = path_of(given, argument)
    if path.suffix.lower() == ".json":
        raise InputError(
            f"{argument} = {str(path)!r}; the parameter file is TOML, and the design's JSON is written beside it: "
            f"name it {path.with_suffix('.toml').name}"
        )
    return path
