"""Cases: loaded by name or path, their scenarios chosen, and the studies of a whole case."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from pathlib import Path
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, cast

import pandas as pd

from orchestrator.added import rooms, study_in
from orchestrator.api.methods import Asks, Shown, method
from orchestrator.api.progress import shown_progress, shown_stages
from orchestrator.api.scenario import Scenario, choose, question
from orchestrator.asked import Names, flag, text_or_none
from orchestrator.asked import names as names_given
from orchestrator.asked import path as path_of
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.case import built_in_cases as names_of_cases
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import forced
from orchestrator.cases.given import Paths, Time
from orchestrator.coordinated_design.command import STUDY as COORDINATED_DESIGN
from orchestrator.coordinated_design.one_point import design_controller
from orchestrator.coupling.schedule import ScheduleName
from orchestrator.errors import InputError
from orchestrator.interactions.command import STUDY as INTERACTIONS
from orchestrator.pod_design.design import DesignRequest
from orchestrator.pod_design.view import ControllerDesign
from orchestrator.points.points import nobody
from orchestrator.points.store import POINTS
from orchestrator.points.study import PointStudy, Study, StudyAtOnce, choose_executor
from orchestrator.report.notebook import page
from orchestrator.results.lock import held
from orchestrator.screening.command import STUDY as SCREENING
from orchestrator.siting.command import STUDY as SITING
from orchestrator.sweep.command import STUDY as SWEEP


def built_in_cases() -> tuple[str, ...]:
    """Names of the built-in cases.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> [name for name in gfor.built_in_cases() if name.startswith("two_area")]
    ['two_area', 'two_area_rms']
    """
    return names_of_cases()


def load(case: str | Path, *, trust_fmus: bool = False) -> "Case":
    """Load a built-in case by name, or a case file or an SSP archive by path.

    Parameters
    ----------
    trust_fmus
        Whether FMUs of others may run in this process, where the file says ``isolated = false``; they can do there
        whatever you can. Without it such a file is refused.

    Raises
    ------
    InputError
        If there is neither, or the file cannot be read.
    CaseError
        If the file lacks what nothing can be checked without.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.load("infinite_bus").scenarios
    ('dip', 'load_step')
    """
    if not isinstance(case, str | Path) or not str(case):
        raise InputError(f"case = {case!r}; give a built-in case's name ({', '.join(names_of_cases())}) or a path")
    path_of(case, "case")
    return Case(load_case(case, trust_fmus=flag(trust_fmus, "trust_fmus")))


def _designed(file: CaseFile, request: DesignRequest) -> ControllerDesign:
    with shown_stages(shown=request.progress) as report:
        design = design_controller(file, request, report=report)
    question([design.result.prepared], above=2)
    return design


def of_study(name: str, study: Study[Asks, Shown]) -> Callable[Concatenate[Any, Asks], Shown]:
    """The method of a study."""
    return method(f"Case.{name}", study.request, lambda case, request: _computed(study, case.file, request))


class Case:
    """A case: its scenarios, and the studies that concern all of it. `load` makes one.

    Attributes
    ----------
    file
        The case file, read.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> case = gfor.load("two_area")
    >>> case.scenarios
    ('base', 'gfor', 'pod_p', 'pod_q', 'pod_pq')
    >>> case
    <Case two_area: base, gfor, pod_p, pod_q, pod_pq>
    """

    def __init__(self, file: CaseFile) -> None:
        self.file = file

    @property
    def name(self) -> str:
        """The case's name."""
        return self.file.name

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""
        return tuple(self.file.scenarios)

    def scenario(
        self,
        name: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        schedule: ScheduleName | None = None,
        tolerance: float | None = None,
        sharing: str | None = None,
        force: Names = (),
    ) -> Scenario:
        """One scenario, checked and ready to run; FMUs that are missing are built.

        Data that are most unusual give an `UnusualDataWarning`.

        Parameters
        ----------
        name
            Of the scenario; may be left out where the case has one only.
        values
            Values by ``component.variable``, as with ``--set``: numbers, truth values, or text such as ``"1350 MW"``.
            ``{"grid": {"X_L": 0.3}}`` means the same as ``{"grid.X_L": 0.3}``.
        step
            Communication step [s]; the case's by default.
        parameters
            Parameter files, as ``gfor design`` writes them; ``values`` go before them.
        schedule
            ``gauss-seidel``, ``jacobi``, ``midpoint`` or ``newton``; the case's by default.
        tolerance
            Steps of a run are as long as this error of a coupled output allows, of 1 or of its value, from 1e-8 to
            0.1; under ``newton`` unless the schedule is ``midpoint``. By default steps are fixed, or the case's.
        sharing
            How the other units feed what units fed that ``values`` take out of service, such as ``sg5.connected``:
            ``"droop"``, ``"rating"``, or ``"slack"``; as the case says by default, which is by droop. Where ``values``
            give powers (``P_0``) as well, nothing is shared.
        force
            References that swing, in the place of the case's events: ``"sg1 0.8 Hz 2 %"``, as ``gfor run --force``.

        Raises
        ------
        CaseError
            With every problem of the case and of the values.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> case = gfor.load("two_area")
        >>> case.scenario("pod_p", {"grid.X_L": 0.3}).values["grid.X_L"]
        0.3
        """
        text_or_none(name, "name", f"give the name of one scenario: {', '.join(self.scenarios)}")
        if name is None and len(self.scenarios) != 1:
            raise InputError(
                f"{self.name}: the case has {len(self.scenarios)} scenarios; choose one of: {', '.join(self.scenarios)}"
            )
        names = [name] if name else []
        (chosen,) = choose(
            forced(self.file, names_given(force, "force")), names, values, step=step, parameters=parameters,
            schedule=schedule, tolerance=tolerance, sharing=sharing,
        )  # fmt: skip
        question([chosen.prepared])
        return chosen

    def choose(
        self,
        names: Names = (),
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        stop: Time | None = None,
        parameters: Paths = (),
        schedule: ScheduleName | None = None,
        tolerance: float | None = None,
        sharing: str | None = None,
    ) -> list[Scenario]:
        """Several scenarios, or all; the mistakes of all are reported together.

        Parameters
        ----------
        names
            Of the scenarios; all of them where empty.
        values, step, parameters, schedule, tolerance, sharing
            As for `scenario`.
        stop
            Time at which runs end [s]; the case's by default.

        Raises
        ------
        CaseError
            With every problem of the case and of the values.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> [scenario.title for scenario in gfor.load("two_area").choose(["gfor", "pod_p"])]
        ['SG + GFOR', 'SG + GFOR POD-P']
        """
        chosen = choose(
            self.file, names, values, step=step, stop=stop, parameters=parameters, schedule=schedule,
            tolerance=tolerance, sharing=sharing,
        )  # fmt: skip
        question(scenario.prepared for scenario in chosen)
        return chosen

    sweep = of_study("sweep", SWEEP)
    screen = of_study("screen", SCREENING)
    site = of_study("site", SITING)
    interactions = of_study("interactions", INTERACTIONS)
    design = method("Case.design", DesignRequest, lambda case, request: _designed(case.file, request))
    design_over_points = of_study("design_over_points", COORDINATED_DESIGN)

    if not TYPE_CHECKING:  # a study that was added; a line as those above shows it to type checkers

        def __getattr__(self, name: str) -> Any:
            room = rooms().get(name)
            if room is None or name.startswith("_"):
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            return MethodType(of_study(name, study_in(room)), self)

    def __repr__(self) -> str:
        return f"<Case {self.name}: {', '.join(self.scenarios)}>"

    def _repr_html_(self) -> str:
        titles = [table.title or name for name, table in self.file.scenarios.items()]
        table = pd.DataFrame({"scenario": self.scenarios, "title": titles})
        return page(f"{self.name}: {self.file.table.title or self.name}", table=table)


def _computed(study: Study[..., Shown], file: CaseFile, request: Any) -> Shown:
    """Plan a study and compute it; a folder that keeps its points is kept from other commands meanwhile."""
    if isinstance(study, StudyAtOnce):
        return cast("Shown", study.compute(file, request, nobody))
    assert isinstance(study, PointStudy)
    cluster = (getattr(request, "scheduler", None), getattr(request, "tls", None))
    executor = choose_executor(request.workers, cluster[0], study.imports, cluster[1])
    planned = study.plan(file, request)
    question(study.prepared(planned), above=2)
    kept = None if request.folder is None else _folder(request.folder)
    title = study.counted.capitalize()
    with shown_progress(title, shown=request.progress) as report, nullcontext() if kept is None else held(kept):
        return cast("Shown", study.compute(planned, executor, kept, report))


def _folder(given: str | Path) -> Path:
    """The folder that keeps a study's points, made where missing."""
    place = path_of(given, "folder", "folder")
    try:
        (place / POINTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"folder = {str(place)!r}: points cannot be kept there: {error.strerror}; choose another"
        ) from error
    return place
