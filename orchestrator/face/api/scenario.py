"""One scenario of a case: its modes, its response in time, its linear model."""

from __future__ import annotations

import fnmatch
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self, cast

from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.given import Time, case_values, in_seconds
from orchestrator.cases.networks.load_models import as_powers, is_open
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.cases.scenario.short_circuit import BusStrength, ShortCircuit
from orchestrator.core.asked import Names, flag, frequency_range, number_between
from orchestrator.core.asked import names as names_given
from orchestrator.core.asked import path as path_of
from orchestrator.core.attributes import Unchanged
from orchestrator.core.errors import InputError, Problem
from orchestrator.core.late import pd, xr
from orchestrator.core.question_kinds import by_kind
from orchestrator.face.api.exploration import Exploration, explored
from orchestrator.face.api.linear import LinearSystem
from orchestrator.face.api.methods import in_turn, method
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.api.results import Modes, Run
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.output.report.notebook import page
from orchestrator.output.results.lock import hold_folder
from orchestrator.output.results.recording_reader import IN_MEMORY
from orchestrator.output.results.recording_writer import recorded_size, temporary_recording
from orchestrator.studies.modes.modes import ModesResult, compute_modes, running
from orchestrator.studies.modes.modes import modes_of as modes_at_point
from orchestrator.studies.modes.request import ModesRequest, Preparing, StepsRequest
from orchestrator.studies.modes.step_choice import Allowed, StepChoice, choose_step
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.runs.checkpoints import EVERY, Checkpoints, not_kept
from orchestrator.studies.runs.run_request import RunRequest
from orchestrator.studies.sensitivities.request import SensitivitiesRequest
from orchestrator.studies.sensitivities.view import Sensitivities
from orchestrator.systems.coupling.observers import Progress
from orchestrator.systems.coupling.schedule import ScheduleName


class RunEndedWarning(UserWarning):
    """A run ended before its time; what was recorded until then is in the result."""


class CheckpointWarning(UserWarning):
    """A run cannot be kept, or does not go on from where it was kept."""


class UnusualDataWarning(UserWarning):
    """Data that may well be a slip of a unit."""


def _modes(scenario: Scenario, request: ModesRequest) -> Modes:
    return Modes(modes_of(scenario, request))


def modes_of(scenario: Scenario, request: ModesRequest) -> ModesResult:
    """Steady state and modes."""
    request.check()
    prepared, seen, critical = scenario.prepared, request.frequencies, request.critical
    if not request.black_box:
        return compute_modes(prepared, seen, critical, directional=request.directional)
    from orchestrator.studies.black_box.coupled_modes import modes_with_boxes  # noqa: PLC0415 - a second to import

    with running(prepared) as master:
        return modes_with_boxes(prepared, master, seen, critical, report=request.report)


def _new(questions: Iterable[Problem], known: Collection[str]) -> tuple[Problem, ...]:
    return tuple(one for one in questions if str(one) not in known)


def _run(scenario: Scenario, request: RunRequest) -> Run:
    from orchestrator.studies.runs.run import run_scenario  # noqa: PLC0415 - only runs need it

    prepared, recording = scenario._until(cast("float | None", request.stop)), request.recording
    known = set(scenario.questions)
    question([replace(prepared, questions=_new(prepared.questions, known))], above=1)
    if request.checkpoints is not None and request.federates is not None:
        raise InputError(
            "a run with federates keeps no checkpoints; leave out federates or checkpoints"
        )
    with ExitStack() as stack:
        kept = request.checkpoints if isinstance(request.checkpoints, Checkpoints) else None
        if request.checkpoints is not None and kept is None:
            folder = path_of(request.checkpoints, "checkpoints", "folder")
            stack.enter_context(hold_folder(folder))
            kept = _checkpoints(
                prepared, folder, cast("float | None", request.checkpoint_every) or EVERY
            )
        if recording is None and recorded_size(prepared, csv=False) > IN_MEMORY:
            recording = temporary_recording(prepared) if kept is None else kept.recording(prepared)
        with shown_progress(scenario.title, shown=request.progress) as report:
            bars = [Progress(report)] if request.progress else []
            result = run_scenario(
                prepared,
                observers=[*bars, *request.observers],
                linear=request.linear,
                recording=recording,
                checkpoints=kept,
                federates=request.federates,
                threads=request.threads,
                boxes=_boxes("modes_with_boxes", request.black_box),
            )
        if kept is not None and kept is not request.checkpoints and result.failure is None:
            kept.clear()
    if result.failure is not None:
        warnings.warn(
            f"scenario {scenario.name!r}: {result.failure}", RunEndedWarning, stacklevel=3
        )
    return Run(result)


def sensitivities_of(scenario: Scenario, request: SensitivitiesRequest) -> Sensitivities:
    """The mode's derivatives by the parameters that are asked for."""
    from orchestrator.studies.sensitivities.sensitivities import find_sensitivities  # noqa: PLC0415 - as above

    return Sensitivities(find_sensitivities(scenario.prepared, scenario._prepared_with, request))


def steps_of(scenario: Scenario, request: StepsRequest) -> StepChoice:
    """Return what steps and schedules do to the critical modes."""
    allowed, steps = Allowed(*request.allowed), cast("Sequence[float]", request.steps)
    schedules = cast("Sequence[ScheduleName]", request.schedules)
    return choose_step(scenario.prepared, allowed, steps, schedules, request.frequencies)


_STUDIES = ("sweep", "screen", "site", "interactions", "design", "design_over_points", "choose")
"""What is asked of the case that a scenario is of."""


class Scenario(Unchanged):
    """A scenario that is ready to run. `Case.scenario` makes one.

    Attributes
    ----------
    prepared
        The components with their values, the schedule, the events.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> scenario = gfor.load("infinite_bus").scenario("dip", {"gfor.P_0": 0.5})
    >>> scenario.title
    'Voltage dip of 20 % for 150 ms'
    >>> scenario.values["gfor.P_0"]
    0.5
    """

    _own = frozenset({"prepared"})
    _instead = (
        "case.scenario(…) makes a scenario with other values, another step or another schedule"
    )
    _elsewhere: ClassVar[Mapping[str, str]] = {
        **{name: f"asked of the case: case.{name}(…)" for name in _STUDIES},
        "plot": "run().plot(…), or modes().plot()",
        "stable": "modes().stability.stable, or run().stable",
    }

    def __init__(self, prepared: PreparedScenario, file: CaseFile, asked: Preparing) -> None:
        self.prepared = prepared
        self._file, self._asked = file, asked
        self._bench: PointBench | None = None

    def with_loads_as_powers(self) -> Scenario | None:
        """The same scenario with loads of constant power; None where the case says how its loads follow the voltage."""
        network = self._file.table.network
        if network is None or not is_open(network):
            return None
        table = self._file.table.model_copy(update={"network": as_powers(network)})
        file = replace(self._file, table=table)
        return Scenario(self._anew(file), file, self._asked)

    def _anew(self, file: CaseFile, stop: float | None = None) -> PreparedScenario:
        asked = self._asked
        (one,) = file.prepare([self.name], asked.overrides, asked.step_size, stop, asked.files)
        return asked.scheduled(one)

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.prepared.name

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.prepared.title

    @property
    def values(self) -> Mapping[str, float | bool]:
        """Every value that the case, its parameter files or the caller set, by ``component.variable``."""
        return MappingProxyType(dict(self.prepared.values))

    def parameters(self) -> pd.DataFrame:
        """Every parameter of every component by ``component.variable``, as ``values`` and ``--set`` take it.

        Columns: its value here, unit, type, variability (``tunable`` or ``fixed``), bounds, and the FMU's own words.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> gfor.load("two_area").scenario("pod_p").parameters().loc["gfor.pod_p.K", "value"]
        200.0
        """
        return pd.DataFrame(rows_of_parameters(self.prepared), dtype=object).set_index("parameter")

    @property
    def questions(self) -> list[str]:
        """Data that are most unusual, each with its place."""
        return [str(question) for question in self.prepared.questions]

    modes = method("Scenario.modes", ModesRequest, _modes)

    run = method("Scenario.run", RunRequest, _run)

    @in_turn
    def modes_at(
        self,
        values: Mapping[str, Any] | None = None,
        frequencies: tuple[float, float] = ELECTROMECHANICAL_HZ,
    ) -> Modes:
        """The modes with other values, on FMUs that stay open: what an optimiser evaluates.

        The result is that of ``case.scenario(name, {...}).modes()`` to the last bit; what the values do not change is
        not computed again. The FMUs are closed with the ``with`` that the scenario stands in, or by `close`.

        Parameters
        ----------
        values
            By ``component.variable``; they join the scenario's own.
        frequencies
            Frequencies shown [Hz].

        Raises
        ------
        CaseError
            With every problem of the values.
        AnalysisError
            If no steady state is found, or the system cannot be linearised.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> with gfor.load("two_area").scenario("pod_p") as scenario:
        ...     for K in (100, 200):
        ...         mode = scenario.modes_at({"gfor.pod_p.K": K}).named["electromechanical"]
        ...         print(f"{K}: {mode.damping_percent:.1f} %")
        100: 22.7 %
        200: 22.5 %
        """
        changed, seen = case_values(values), frequency_range(frequencies)
        prepared = self._prepared_with(changed) if changed else self.prepared
        question([replace(prepared, questions=_new(prepared.questions, set(self.questions)))])
        if self._bench is None:
            self._bench = PointBench(remember=True)
        with self._bench.serving(in_service(prepared)) as master:
            return Modes(modes_at_point(prepared, master, seen))

    @in_turn
    def close(self) -> None:
        """Close the FMUs that `modes_at` keeps open; calling it again does nothing."""
        bench, self._bench = self._bench, None
        if bench is not None:
            bench.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_bench": None}  # no other process, and no copy, has these FMUs

    @in_turn
    def response(self, stop: Time | None = None) -> xr.Dataset:
        """The linear model's response to the scenario's events, over the time [s]; no FMU is stepped for it.

        Parameters
        ----------
        stop
            Time at which it ends [s]; the case's by default.

        Raises
        ------
        InputError
            If there is no event, or one that a linear model cannot follow, such as a fault.
        AnalysisError
            If no steady state is found, or the system cannot be linearised.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> response = gfor.load("two_area").scenario("pod_p").response(stop=5.0)
        >>> float(response["time"][-1])
        5.0
        """
        from orchestrator.studies.modes.linear import response_at_steady_state  # noqa: PLC0415 - only responses need it

        return response_at_steady_state(self._until(in_seconds(stop, "stop")))

    def _prepared_with(self, changed: Mapping[str, Any]) -> PreparedScenario:
        (prepared,) = self._file.prepare(
            [self.name], dict(changed), self._asked.step_size, None, self._asked.layers
        )
        return self._asked.scheduled(prepared)

    def _until(self, stop_time: float | None) -> PreparedScenario:
        """The scenario with another stop time [s]: events after it are left out, and it must fit the step."""
        if stop_time is None or stop_time == self.prepared.stop_time:
            return self.prepared
        prepared = self._anew(self._file, stop_time)
        changed = _differences(self.prepared, prepared)
        if changed:
            raise InputError(
                f"{self._file.path}: files of the case were changed since the scenario was made, which changes "
                f"{', '.join(changed[:3])}; load the case again"
            )
        return prepared

    sensitivities = method("Scenario.sensitivities", SensitivitiesRequest, sensitivities_of)

    steps = method("Scenario.steps", StepsRequest, steps_of)

    def strengths(
        self, converter_current: float = 0.0, rating: float | str | None = None
    ) -> list[BusStrength]:
        """Short-circuit power of every bus, with the short-circuit ratio of the converters there.

        Parameters
        ----------
        converter_current
            That a converter feeds into a short circuit [pu of its rating].
        rating
            Of a converter that every bus is judged for [MVA]; the converters' own at their buses by default.

        Raises
        ------
        InputError
            If the case has no power flow, or nothing feeds a short circuit.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> weakest = min(gfor.load("ieee39").scenario("base").strengths(), key=lambda bus: bus.s_sc_mva)
        >>> weakest.bus, round(weakest.s_sc_mva)
        ('bus_12', 2751)
        """
        rule = "a converter's current in pu of its rating, from 0 to 10: 1.1 is 110 %"
        current = number_between(converter_current, "pu", "converter_current", 0.0, 10.0, rule)
        rule = "a rating above 0 in MVA, such as 100 or '100 MVA'"
        rated = None if rating is None else number_between(rating, "MVA", "rating", 1e-6, 1e6, rule)
        return ShortCircuit.of(self.prepared).strengths(current, rated)

    @in_turn
    def linearize(
        self,
        inputs: Names = (),
        outputs: Names = (),
        *,
        continuous: bool = False,
        black_box: bool = False,
        report: Callable[[str], None] | None = None,
    ) -> LinearSystem:
        """The linear model A, B, C, D around the steady state, with names and the verdict on it.

        Parameters
        ----------
        inputs
            Tunable parameters and open inputs; by default what the scenario's events change, without what
            switches, such as a fault.
        outputs
            Observed outputs; by default what the case plots.
        continuous
            ẋ = A·x + B·u instead of the map over one communication step, which a simulation runs;
            `LinearSystem.to_control` gives the continuous model of either.
        black_box
            Identify the components that hide their states; of those there is the step map alone.
        report
            Called with a sentence before what takes long in a large system; such as ``print``.

        Raises
        ------
        InputError
            If there is no such variable, or an input is none that can be perturbed.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> scenario = gfor.load("infinite_bus").scenario("load_step")
        >>> model = scenario.linearize(["gfor.droop.delta_P_ref"], ["gfor.omega"], continuous=True)
        >>> model.B.shape == (len(model.states), 1)
        True
        """
        from orchestrator.studies.modes.linear import (  # noqa: PLC0415 - as above
            default_inputs,
            default_outputs,
            linear_model,
            tell_left_out,
        )

        left_out = () if inputs else tell_left_out(self.prepared)
        inputs = names_given(inputs, "inputs") or default_inputs(self.prepared)
        outputs = names_given(outputs, "outputs") or default_outputs(self.prepared)
        for argument, chosen in (("inputs", inputs), ("outputs", outputs)):
            twice = [name for name in chosen if list(chosen).count(name) > 1]
            if twice:
                raise InputError(f"{argument}: {twice[0]!r} stands in the list twice; give it once")
        if continuous and black_box:
            raise InputError("black_box identifies a step map; leave out continuous, or black_box")
        model, point, examined = linear_model(
            self.prepared,
            inputs,
            outputs,
            as_continuous=continuous,
            boxes=_boxes("linear_with_boxes", black_box),
            report=report,
        )
        return LinearSystem(
            **vars(model),
            operating_point=point,
            stability=examined.stability,
            warnings=(*left_out, *examined.warnings),
            continuous_form=None
            if continuous or black_box
            else partial(self.linearize, inputs, outputs, continuous=True),
        )

    def explore(self) -> Exploration:
        """The scenario in the explorer, beginning with these values: a notebook shows the page, with its sliders.

        Returns
        -------
        Exploration
            The page on a server of this machine, which ends with the program; ``address`` is for any browser.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> with gfor.load("infinite_bus").scenario("dip").explore() as page:
        ...     page.address.startswith("http://127.0.0.1:")
        True
        """
        given = {pattern for layer in self._asked.layers for pattern in layer.values}
        values = {
            name: value
            for name, value in self.values.items()
            if any(fnmatch.fnmatchcase(name, pattern) for pattern in given)
        }
        return explored(self.prepared, values, self._asked.step_size)

    def __repr__(self) -> str:
        return f"<Scenario {self.name} of {self.prepared.case.name}: {self.title}>"

    def _repr_html_(self) -> str:
        units = [self._unit(name) for name in self.values]
        columns = {"name": [*self.values], "value": [*self.values.values()], "unit": units}
        table = pd.DataFrame(columns, dtype=object)
        return page(f"{self.prepared.case.name}, {self.name}: {self.title}", self.questions, table)

    def _unit(self, name: str) -> str:
        component, _, variable = name.partition(".")
        plan = self.prepared.system.components.get(component)
        info = None if plan is None else plan.description.variables.get(variable)
        return "" if info is None else info.unit or "1"


def _boxes(name: str, wanted: bool) -> Any:
    """A function of `coupled_modes`, or None where no component is to be identified."""
    flag(wanted, "black_box")
    return (
        getattr(import_module("orchestrator.studies.black_box.coupled_modes"), name)
        if wanted
        else None
    )


def _differences(one: PreparedScenario, other: PreparedScenario) -> list[str]:
    """Values and FMUs, by name, in which two preparations of a scenario differ."""
    names = [
        name
        for name in {**one.values, **other.values}
        if one.values.get(name) != other.values.get(name)
    ]
    fmus = [
        {n: plan.description for n, plan in ready.system.components.items()}
        for ready in (one, other)
    ]
    made, found = ({n: (fmu.path, fmu.guid) for n, fmu in of.items()} for of in fmus)
    return [
        *names,
        *(f"the FMU of {name}" for name in {**made, **found} if made.get(name) != found.get(name)),
    ]


def _checkpoints(prepared: PreparedScenario, folder: Path, every: float) -> Checkpoints:
    def say(text: str) -> None:
        warnings.warn(text, CheckpointWarning, stacklevel=5)

    for name, reason in not_kept(prepared).items():
        say(
            f"scenario {prepared.name!r} cannot be resumed within its run, because of component {name!r}: {reason}"
        )
    return Checkpoints(prepared, folder, every, resume=True, say=say)


def choose(
    file: CaseFile, names: Names, asked: Preparing, stop: float | None = None
) -> list[Scenario]:
    """Choose scenarios of a case file, as `Case.choose` does.

    Parameters
    ----------
    file
        The case file.
    names
        Names of the scenarios.
    asked
        Values, parameter files, step and schedule with which they are prepared.
    stop
        End of their runs [s]; None for the case's own.
    """
    file = replace(file, sharing=cast("SharingRule | None", asked.sharing))
    prepared = file.prepare(
        names_given(names, "names"), asked.overrides, asked.step_size, stop, asked.files
    )
    return [Scenario(asked.scheduled(one), file, asked) for one in prepared]


def rows_of_parameters(prepared: PreparedScenario) -> list[dict[str, Any]]:
    """Return the rows of `Scenario.parameters`, for which nobody needs pandas."""
    return [
        {
            "parameter": f"{name}.{info.name}",
            "value": plan.value(info.name),
            "unit": info.unit or "1",
            "type": info.type,
            "variability": info.variability,
            "minimum": info.minimum,
            "maximum": info.maximum,
            "description": info.description,
        }
        for name, plan in prepared.system.components.items()
        for info in plan.description.variables.values()
        if info.causality == "parameter"
    ]


def question(scenarios: Iterable[PreparedScenario], above: int = 0) -> None:
    """Warn about data that are most unusual, each kind once, where the caller of the caller stands, or ``above`` it.

    `Scenario.questions` has all of them."""
    asked = {str(one): one for prepared in scenarios for one in prepared.questions}
    for text in by_kind(asked, "Scenario.questions").values():
        warnings.warn(f"question: {text}", UnusualDataWarning, stacklevel=3 + above)
