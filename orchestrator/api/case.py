"""Cases: loaded by name or path, their scenarios chosen, and the studies of a whole case."""

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from pathlib import Path
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, cast

from orchestrator.added import rooms, study_in
from orchestrator.api.methods import Asks, Shown, method
from orchestrator.api.progress import shown_progress, shown_stages
from orchestrator.api.scenario import Scenario, choose, question
from orchestrator.asked import flag, text_or_none
from orchestrator.asked import names as names_given
from orchestrator.asked import path as path_of
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.case import built_in_cases as names_of_cases
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import forced
from orchestrator.cases.given import keep, kept
from orchestrator.coordinated_design.command import STUDY as COORDINATED_DESIGN
from orchestrator.coordinated_design.one_point import design_controller
from orchestrator.errors import InputError
from orchestrator.interactions.command import STUDY as INTERACTIONS
from orchestrator.late import pd
from orchestrator.pod_design.design import DesignRequest
from orchestrator.pod_design.view import ControllerDesign
from orchestrator.points.points import nobody
from orchestrator.points.store import POINTS
from orchestrator.points.study import PointStudy, Study, StudyAtOnce, choose_executor
from orchestrator.report.notebook import page
from orchestrator.results.lock import held
from orchestrator.screening.command import STUDY as SCREENING
from orchestrator.siting.command import STUDY as SITING
from orchestrator.study.request import ScenarioRequest, ScenariosRequest
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


def load(case: str | Path | Mapping[str, Any], *, trust_fmus: bool = False) -> "Case":
    """Load a case.

    Parameters
    ----------
    case
        Name of a built-in case, path of a case file or an SSP archive, the text of a case file, or its tables. Of text
        and tables, paths are relative to ``directory`` in them, or to where the program runs.
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
    trusted = flag(trust_fmus, "trust_fmus")
    if isinstance(case, Mapping):
        return Case(load_case(kept({"directory": str(Path.cwd()), **case}, "case.toml", "case"), trust_fmus=trusted))
    if isinstance(case, str) and "\n" in case:
        head = "" if re.search(r"(?m)^directory\s*=", case) else f"directory = {json.dumps(str(Path.cwd()))}\n"
        return Case(load_case(keep(head + case, "case.toml"), trust_fmus=trusted))
    if not isinstance(case, str | Path) or not str(case):
        raise InputError(f"case = {case!r}; give a built-in case's name ({', '.join(names_of_cases())}) or a path")
    path_of(case, "case")
    return Case(load_case(case, trust_fmus=trusted))


def _scenario(case: "Case", request: ScenarioRequest) -> Scenario:
    known, name = ", ".join(case.scenarios), request.name
    text_or_none(name, "name", f"give the name of one scenario: {known}")
    if name is None and len(case.scenarios) != 1:
        raise InputError(f"{case.name}: the case has {len(case.scenarios)} scenarios; choose one of: {known}")
    file = forced(case.file, names_given(request.force, "force"))
    (chosen,) = choose(file, [name] if name else [], request)
    question([chosen.prepared], above=1)
    return chosen


def _chosen(case: "Case", request: ScenariosRequest) -> list[Scenario]:
    chosen = choose(case.file, request.names, request, cast("float | None", request.stop))
    question((scenario.prepared for scenario in chosen), above=1)
    return chosen


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

    def with_(self, **tables: Any) -> "Case":
        """The case with other tables, such as ``events``, ``solver`` or ``network``; this one stays as it is.

        Parameters
        ----------
        tables
            As in a case file. Tables in tables are joined, lists replaced, and what is None is removed.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> shorter = gfor.load("infinite_bus").with_(solver={"stop_time": "3 s"}, scenarios={"dip": None})
        >>> shorter.scenarios, shorter.scenario().prepared.stop_time
        (('load_step',), 3.0)
        """
        return load(
            {"directory": str(self.file.directory)} | _joined(tomllib.loads(self.file.text), tables),
            trust_fmus=self.file.trust_fmus,
        )

    scenario = method("Case.scenario", ScenarioRequest, _scenario)
    choose = method("Case.choose", ScenariosRequest, _chosen)
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


def _joined(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes: inner tables are joined, and what is None is removed."""
    found = {key: value for key, value in tables.items() if changes.get(key, value) is not None}
    for key, new in changes.items():
        if isinstance(new, Mapping):
            old = tables.get(key)
            found[key] = _joined(old if isinstance(old, Mapping) else {}, new)
        elif new is not None:
            found[key] = new
    return found
