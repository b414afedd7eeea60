"""The design of POD controllers over operating points and outages."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

import pandas as pd

from orchestrator.api.design import parameter_file_path, require_controllers
from orchestrator.api.executors import PointStudy
from orchestrator.asked import Names, checked, require_known
from orchestrator.cases.idle_values import DAMPING_CONTROLLERS
from orchestrator.coordinated_design.files import as_json, points_rows, ranking_rows, save
from orchestrator.coordinated_design.study import PointsDesign, PointsDesignRequest, design_over_points, values_of
from orchestrator.coordinated_design.words import verdict_sentence, what_it_rests_on
from orchestrator.errors import InputError
from orchestrator.report.notebook import page


class WantedOverPoints(TypedDict, total=False):
    """What may be asked of a design over operating points; `PointsDesignRequest` says what each means."""

    components: Names
    modes: Names
    damping: float | None
    gain_bounds: tuple[float, float]
    stages: int | None
    least_damping: float
    ranked: int


def request_of(controllers: Sequence[str], wanted: WantedOverPoints, **rest: Any) -> PointsDesignRequest:
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


class CoordinatedDesign:
    """POD controllers for many operating points and outages. `Case.design_over_points` makes it.

    Attributes
    ----------
    result
        Every figure on the way.
    """

    def __init__(self, result: PointsDesign) -> None:
        self.result = result

    @property
    def met(self) -> bool | None:
        """Whether the wanted damping is reached at every point; where none is wanted, whether the least one is better.

        None where points have no modes, and no other point says no.
        """
        return self.result.verdict.met

    @property
    def verdict(self) -> str:
        """The verdict in one sentence, with the point, the outage and the mode that limit."""
        return verdict_sentence(self.result.verdict)

    @property
    def parameters(self) -> dict[str, Any]:
        """The settings by ``component.variable``: the values of a scenario with these controllers."""
        return values_of(self.result.plan.groups, self.result.settings)

    def points(self) -> pd.DataFrame:
        """One row for each operating point with each outage: status, verdict, damping without and with it [%]."""
        return pd.DataFrame(points_rows(self.result.verdict))

    def ranking(self) -> pd.DataFrame:
        """One row for each converter, the best first: what a controller there alone would give."""
        return pd.DataFrame(ranking_rows(self.result))

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor design --points --json`` prints, as JSON's types."""
        return as_json(self.result)

    def save(self, path: str | Path, command: str | None = None) -> list[Path]:
        """Write the parameter file, and beside it JSON, a row for each point and a row for each converter.

        Parameters
        ----------
        path
            Path of the parameter file, which ``--parameters`` and `Case.scenario` take.
        command
            The command that the file names as its origin; by default the call in Python.

        Raises
        ------
        InputError
            If the path is none, or ends in ``.json``.
        ResultsError
            If a file cannot be written.
        """
        said = command or f"gfor.load({self.result.plan.case.name!r}).design_over_points(…) in Python"
        return save(self.result, parameter_file_path(path), said)

    def __repr__(self) -> str:
        return f"<CoordinatedDesign for {self.result.plan.case.name}: {self.verdict}>"

    def _repr_html_(self) -> str:
        lines = [
            self.verdict,
            what_it_rests_on(self.result),
            ", ".join(f"{k} = {v}" for k, v in self.parameters.items()),
        ]
        return page(f"Design over points of {self.result.plan.case.name}", lines, self.points())


STUDY = PointStudy(design_over_points, CoordinatedDesign, "orchestrator.coordinated_design.worker")
