"""Cases: loaded by name or path, their scenarios chosen, and the studies of a whole case."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, Unpack

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.progress import shown_progress, shown_stages
from orchestrator.api.scenario import Scenario, choose, question
from orchestrator.api.studies import (
    Wanted,
    WantedInteractions,
    WantedOverPoints,
    WantedPlaces,
    design_controller,
    design_request,
    interactions_request,
    points_design_request,
)
from orchestrator.api.sweep import plan
from orchestrator.api.values import Paths, Time, case_values, in_seconds, keep, kept, parameter_files
from orchestrator.asked import Names, checked, flag, require_known, text_or_none
from orchestrator.asked import names as names_given
from orchestrator.asked import path as path_of
from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.case import built_in_cases as names_of_cases
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import forced
from orchestrator.coordinated_design.study import plan_points_design
from orchestrator.coordinated_design.view import STUDY as COORDINATED_DESIGN
from orchestrator.coordinated_design.view import CoordinatedDesign
from orchestrator.coupling.schedule import ScheduleName
from orchestrator.errors import InputError
from orchestrator.interactions.study import plan_interactions
from orchestrator.interactions.view import STUDY as INTERACTIONS
from orchestrator.interactions.view import Interactions
from orchestrator.late import pd
from orchestrator.pod_design.view import ControllerDesign
from orchestrator.points.store import POINTS
from orchestrator.points.study import Plan, PointStudy, Result, Shown, choose_executor
from orchestrator.report.notebook import page
from orchestrator.results.lock import held
from orchestrator.screening.request import ScreeningRequest
from orchestrator.screening.study import plan_screening
from orchestrator.screening.view import STUDY as SCREENING
from orchestrator.screening.view import Screening
from orchestrator.siting.study import SiteRequest, find_sites
from orchestrator.siting.view import Siting
from orchestrator.sweep.view import STUDY as SWEEP
from orchestrator.sweep.view import ParameterSweep


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

    def sweep(
        self,
        vary: Mapping[str, Iterable[Any]] | Iterable[str],
        scenarios: Names = (),
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        frequencies: tuple[float, float] = ELECTROMECHANICAL_HZ,
        until: str | float | None = None,
        workers: int | None = 1,
        scheduler: str | None = None,
        tls: str | Path | None = None,
        folder: str | Path | None = None,
        progress: bool = False,
    ) -> ParameterSweep:
        """Modes over a grid of parameters, followed from point to point.

        Parameters
        ----------
        vary
            Values by ``component.parameter``, or texts as with ``--vary``: ``"grid.X_L=0.1:0.5:9"``. Modes are
            followed along the last one.
        scenarios
            Names; all of them where empty.
        values, step, parameters
            As for `scenario`.
        frequencies
            Modes from the first to the second are followed [Hz].
        until
            ``"unstable"``, or a damping such as ``"5 %"``: bisect how far the only range that is varied may go, such as
            ``"grid.X_L=0.1:2"``. The result is in ``limits``.
        workers
            Processes to compute in; one for each core where None.
        scheduler
            Address of a Dask cluster to compute on instead, such as ``tcp://host:8786``.
        tls
            Folder with ``ca.pem``, ``cert.pem`` and ``key.pem``, for a scheduler at ``tls://host:8786``.
        folder
            Keeps the points: a later sweep with this folder reads them instead of computing them again. Without a
            folder the points are forgotten.
        progress
            Show a bar.

        Raises
        ------
        InputError
            If a parameter, value, scenario, file or number of workers cannot be used.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> sweep = gfor.load("two_area").sweep({"grid.X_L": [0.1, 0.2]}, ["gfor"])
        >>> named = sweep.table().query("named")
        >>> named[["grid.X_L", "frequency_hz", "damping_percent"]].round(2)
           grid.X_L  frequency_hz  damping_percent
        0       0.1          0.58            10.59
        1       0.2          0.43            18.01
        """
        planned = partial(plan, self.file, vary, scenarios, values, step=step, parameters=parameters,
                          frequencies=frequencies, until=until)  # fmt: skip
        return _studied(SWEEP, planned, (workers, scheduler, tls), folder, "Points", shown=progress)

    def screen(
        self,
        points: Any = None,
        outages: str | Sequence[str] | None = None,
        scenario: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        frequencies: tuple[float, float] = ELECTROMECHANICAL_HZ,
        damping: float = 20,
        whole: bool = False,
        sharing: str | None = None,
        workers: int | None = 1,
        scheduler: str | None = None,
        tls: str | Path | None = None,
        folder: str | Path | None = None,
        progress: bool = False,
    ) -> Screening:
        """Critical modes of many operating points, each with its outages.

        Parameters
        ----------
        points
            CSV file or DataFrame, a row each: a column ``time`` or ``name``, and what differs from the case; or
            ``{"night": {"load": 0.6}}``. The case as it is by default.
        outages
            ``"n-1"``, ``"lines"``, ``"units"``, or names, also as one text with commas; none by default.
        scenario
            Its name; the first one where None.
        values, step, parameters
            As for `scenario`.
        frequencies
            Modes from the first to the second are critical [Hz] …
        damping
            … where they are damped less than this [%].
        whole
            Whether growing modes of all frequencies are counted at every point, rather than at one in 24.
        sharing
            Who feeds what an outage takes: ``"droop"`` (units by droop and rating), ``"rating"`` or ``"slack"``; as
            ``[power_flow]`` of the case says by default.
        workers, scheduler, tls, folder, progress
            As for `sweep`.

        Raises
        ------
        InputError
            If points, outages, scenario or values cannot be used; with file and line of what is wrong in the points.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> from pathlib import Path
        >>> lines = "time,grid.X_L", "00:00,0.1", "01:00,0.5"
        >>> _ = Path("day.csv").write_text(chr(10).join(lines))
        >>> screening = gfor.load("two_area").screen("day.csv", scenario="gfor")
        >>> screening.stable
        True
        >>> screening.modes()[["point", "frequency_hz", "damping_percent"]].round(2)
           point  frequency_hz  damping_percent
        0  00:00          0.58            10.57
        """
        request = ScreeningRequest(**checked(ScreeningRequest, {
            "points": None if points is None else kept(points, "points.csv", "points"), "outages": outages,
            "sharing": sharing, "frequencies": frequencies, "damping": damping, "whole": whole,
        }))  # fmt: skip
        planned = partial(
            plan_screening, self.file, request.points, request.outages, scenario, case_values(values),
            in_seconds(step, "step"), request.region, parameter_files(parameters), whole=request.whole,
            sharing=request.sharing,
        )  # fmt: skip
        return _studied(SCREENING, planned, (workers, scheduler, tls), folder, "Points", shown=progress)

    def site(
        self,
        device: str | Path = "pod_p",
        scenario: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        **wanted: Unpack[WantedPlaces],
    ) -> Siting:
        """Where to put a converter: how far support at each bus moves each poorly damped mode.

        Residues of the whole linear model between the frequency of a bus and P or Q injected there; the operating
        point stays. The best buses are confirmed: a converter at rest is put there as an FMU, its POD is tuned, and
        the coupled system's mode is compared.

        Parameters
        ----------
        device
            ``"pod_p"``, ``"pod_q"``, ``"droop"``, or the path of an FMU.
        scenario
            Its name; the first one where None.
        values, step, parameters
            As for `scenario`.
        wanted
            Any of: ``binding`` (of the FMU), ``frequencies`` [Hz] and ``below`` [%] (modes that are looked at; the
            least damped one where none is damped so little), ``outages`` (rank for these too: ``"n-1"``, ``"lines"``,
            ``"units"``, or names; the least of all counts), ``confirm`` (how many of the best buses), ``rating`` [MVA]
            of the converter that confirms, and largest ``gain`` of its POD [pu of its rating].

        Raises
        ------
        InputError
            If the case has no network, no oscillation is in the range, or the device cannot be used.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> places = gfor.load("two_area_rms").site("pod_p", scenario="gfor", confirm=1)
        >>> places.ranking, places.agrees
        (('bus_2', 'bus_3'), True)
        """
        require_known(wanted, WantedPlaces.__annotations__, "places")
        return Siting(find_sites(self.file, SiteRequest(
            **checked(SiteRequest, {"device": str(device), **wanted}), scenario=scenario,
            overrides=case_values(values), parameters=parameter_files(parameters), step_size=in_seconds(step, "step"),
        )))  # fmt: skip

    def interactions(
        self,
        scenario: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        workers: int | None = 1,
        folder: str | Path | None = None,
        progress: bool = False,
        **wanted: Unpack[WantedInteractions],
    ) -> Interactions:
        """Who takes part in which mode, and which vendors' converters do not agree.

        Parameters
        ----------
        scenario, values, step, parameters
            As for `scenario`.
        workers, folder, progress
            As for `sweep`.
        wanted
            Any of: ``threshold`` (a share of a mode), ``frequencies`` [Hz], ``stand_in`` (a model), ``swap`` (each
            device at each place), ``devices`` (files by name), ``bindings``, ``places``, ``black_box``.

        Raises
        ------
        InputError
            If a scenario, value or device cannot be used, or there are too many systems.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> found = gfor.load("infinite_bus").interactions("dip")
        >>> found.modes()[["frequency_hz", "share.gfor", "share.grid"]].round(2).iloc[0].tolist()
        [45.53, 0.4, 0.6]
        """
        of_case = (scenario, case_values(values), in_seconds(step, "step"), parameter_files(parameters))
        planned = partial(plan_interactions, self.file, interactions_request(wanted), *of_case)
        return _studied(INTERACTIONS, planned, (workers, None, None), folder, "Systems", shown=progress)

    def design(
        self,
        controller: str,
        scenario: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        progress: bool = False,
        **wanted: Unpack[Wanted],
    ) -> ControllerDesign:
        """Design a POD controller by eigenvalue sensitivity, and check it on the closed loop.

        Parameters
        ----------
        controller
            ``"pod_p"`` or ``"pod_q"``.
        scenario
            Its name; by default the one without this controller.
        values, step, parameters
            As for `scenario`.
        progress
            Show a line with the stage that the design has come to.
        wanted
            Any of: ``damping`` or ``damping_increment`` [%, points], ``component``, ``mode``, ``gain_bounds`` and
            ``delta_gain`` [pu], ``stages``, ``compensated_gain``, ``least_damping`` [%], ``refine``, ``margins`` (False
            saves most of the time).

        Raises
        ------
        InputError
            If scenario, component, mode or requirement cannot be found or make no sense.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> design = gfor.load("two_area").design("pod_p", margins=False)
        >>> design.met
        True
        >>> design.parameters["gfor.pod_p.K"]
        200.0
        """
        request = design_request(controller, wanted, scenario, overrides=case_values(values),
                            parameters=parameter_files(parameters), step_size=in_seconds(step, "step"))  # fmt: skip
        with shown_stages(shown=progress) as report:
            design = design_controller(self.file, request, report=report)
        question([design.result.prepared])
        return design

    def design_over_points(
        self,
        points: Any,
        controllers: Names = "pod_p",
        outages: str | None = None,
        scenario: str | None = None,
        values: Mapping[str, Any] | None = None,
        *,
        step: Time | None = None,
        parameters: Paths = (),
        workers: int | None = 1,
        scheduler: str | None = None,
        tls: str | Path | None = None,
        folder: str | Path | None = None,
        progress: bool = False,
        **wanted: Unpack[WantedOverPoints],
    ) -> CoordinatedDesign:
        """Design POD controllers with one setting for many operating points, each with its outages.

        Parameters
        ----------
        points, outages
            As for `screen`.
        controllers
            ``"pod_p"``, ``"pod_q"``, or both; each gets a setting of its own.
        scenario
            Its name; by default the one without these controllers.
        values, step, parameters
            As for `scenario`.
        workers, scheduler, tls, folder, progress
            As for `sweep`.
        wanted
            Any of: ``damping`` [%] (wanted everywhere; the best that there is by default), ``components``
            (names or patterns, each with a setting of its own), ``modes`` (the case's; all from 0.1 to 2 Hz by
            default), ``gain_bounds`` [pu], ``stages``, ``least_damping`` [%] (of other modes), ``ranked`` (for how many
            converters a controller alone is designed).

        Raises
        ------
        InputError
            If points, outages, scenario, components or modes cannot be used.
        AnalysisError
            If no point has modes.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> from pathlib import Path
        >>> lines = "name,grid.X_L", "short,0.05", "long,0.3"
        >>> _ = Path("two.csv").write_text(chr(10).join(lines))
        >>> design = gfor.load("two_area").design_over_points("two.csv", damping=15)
        >>> design.met
        True
        >>> bool(design.points()["damping_percent"].min() >= 15)
        True
        """
        request = points_design_request(names_given(controllers, "controllers"), wanted, scenario=scenario,
                             overrides=case_values(values), parameters=parameter_files(parameters),
                             step_size=in_seconds(step, "step"))  # fmt: skip
        planned = partial(plan_points_design, self.file, request, kept(points, "points.csv", "points"), outages)
        return _studied(COORDINATED_DESIGN, planned, (workers, scheduler, tls), folder, "Points", shown=progress)

    def __repr__(self) -> str:
        return f"<Case {self.name}: {', '.join(self.scenarios)}>"

    def _repr_html_(self) -> str:
        titles = [table.title or name for name, table in self.file.scenarios.items()]
        table = pd.DataFrame({"scenario": self.scenarios, "title": titles})
        return page(f"{self.name}: {self.file.table.title or self.name}", table=table)


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


def _studied(
    study: PointStudy[Plan, Result, Shown],
    plan: Callable[[], Plan],
    where: tuple[int | None, str | None, str | Path | None],
    folder: str | Path | None,
    title: str,
    *,
    shown: bool,
) -> Shown:
    """Plan a study and compute it; a folder that keeps its points is kept from other commands meanwhile."""
    workers, scheduler, tls = where
    executor = choose_executor(workers, scheduler, study.imports, tls)
    planned = plan()
    question(study.prepared(planned), above=1)
    kept = None if folder is None else _folder(folder)
    with shown_progress(title, shown=shown) as report, nullcontext() if kept is None else held(kept):
        return study.compute(planned, executor, kept, report)


def _folder(given: str | Path) -> Path:
    """The folder that keeps a sweep's points, made where missing."""
    place = path_of(given, "folder", "folder")
    try:
        (place / POINTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"folder = {str(place)!r}: points cannot be kept there: {error.strerror}; choose another"
        ) from error
    return place
