"""∂λ/∂p of one mode by the parameters of all FMUs.

Two ways lead to the total derivative, in which the operating point moves with the parameter. A tunable parameter that
leaves the running system where it stands is changed in its running FMU, and this FMU alone is linearised again. With
any other one the case is started anew, from the power flow on, as `gfor modes --set` starts it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.cases.questions.idle_values import why_idle
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Numbers
from orchestrator.core.asked import names as names_of
from orchestrator.core.errors import AnalysisError, CaseError, CosimError, InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.linear.doubts.coupled_response import foreign_components
from orchestrator.linear.doubts.linearity import eigenvalue_shifts
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, continuous, where_given
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.continuation import Eigenpair, pair_at, pairs_near
from orchestrator.linear.spectra.modes import Mode, mode_in_words
from orchestrator.output.report.short_texts import first_few
from orchestrator.simulation.watch.limits import limits_that_act
from orchestrator.studies.modes.modes import ModesResult, changed, modes_from
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.sensitivities.derivative import Derivative, Shift, differentiate
from orchestrator.studies.sensitivities.parameters import SHARE, Parameter, parameters_of
from orchestrator.studies.sensitivities.request import SensitivitiesRequest
from orchestrator.systems.coupling.master import Master

CRITICAL = "critical"  # stands for the least damped mode of the range
_STAYS = 1e-13
"""A component stays where it is if no state and no output changes by more than this part of max(1, |value|), which is
rounding, after a step with a parameter changed by `_TRIED`."""

_TRIED = 2e-2

_DOUBLE = 1e-3
"""Two eigenvalues nearer than this part of |λ| count as a double one: no derivative of either alone exists, and a
defective pair is split this far by the perturbation's rounding."""

# the step map's mode and the continuous model's differ by less than this part of |λ|; see
# `resolution`
_SAME = 0.1
_FAR = 0.1  # step map and continuous model disagree on a derivative from this part on

_NO_STEADY_STATE = (
    "with another value the system has no steady state at rated frequency; "
    + Option.HELD
    + " gives the effect at the held operating point"
)

Again = Callable[[Mapping[str, float]], PreparedScenario]
"""Prepares the scenario with other values by ``component.variable``."""


@dataclass(frozen=True)
class Sensitivity:
    parameter: Parameter
    eigenvalue: complex
    # ∂λ/∂p [rad/s per unit of the parameter] of the step map; None where there is none, for ``reason``
    derivative: complex | None
    # the same of the model without a communication step; None where a component gives no derivatives
    continuous: complex | None
    # ``stays`` or ``moves`` with the parameter; ``held`` where the derivative leaves it where it is
    operating_point: str
    doubts: tuple[str, ...] = ()  # why the figure may be wrong; empty if it is trusted
    reason: str = (
        ""  # why there is no derivative, or why it is 0: what the parameter acts through is off
    )

    @property
    def frequency_per_unit(self) -> float | None:
        return None if self.derivative is None else self.derivative.imag / (2 * np.pi)

    @property
    def damping_per_unit(self) -> float | None:
        """∂ζ/∂p [points of damping per unit of the parameter]; a point is 1 % of critical damping."""
        return (
            None
            if self.derivative is None
            else 100 * damping_change(self.eigenvalue, self.derivative)
        )

    @property
    def frequency_per_percent(self) -> float | None:
        """[Hz] for one percent of the parameter; None where it is 0."""
        return self._for_a_percent(self.frequency_per_unit)

    @property
    def damping_per_percent(self) -> float | None:
        """[points] for one percent of the parameter; None where it is 0."""
        return self._for_a_percent(self.damping_per_unit)

    @property
    def points(self) -> float | None:
        """[points] for the parameter's usual step, to first order; see `Parameter.step`."""
        per_unit = self.damping_per_unit
        return None if per_unit is None else per_unit * self.parameter.step

    @property
    def effect(self) -> float:
        """|Δλ| [rad/s] for one percent of the parameter, of 1 unit where it is 0."""
        return (
            0.0 if self.derivative is None else SHARE * self.parameter.scale * abs(self.derivative)
        )

    def _for_a_percent(self, figure: float | None) -> float | None:
        return (
            None
            if figure is None or not self.parameter.value
            else SHARE * abs(self.parameter.value) * figure
        )


@dataclass(frozen=True)
class SensitivityResult:
    modes: ModesResult
    mode: Mode
    rows: tuple[Sensitivity, ...]
    held: bool
    warnings: tuple[str, ...]


def damping_change(eigenvalue: complex, change: complex) -> float:
    """dζ for a small change of λ, with ζ = −σ/|λ|."""
    size = abs(eigenvalue)
    return float(
        (eigenvalue.real * eigenvalue.imag * change.imag - eigenvalue.imag**2 * change.real)
        / size**3
    )


def find_sensitivities(
    prepared: PreparedScenario, again: Again, request: SensitivitiesRequest
) -> SensitivityResult:
    mode, held, directional = request.mode, request.held, request.directional
    patterns, report = names_of(request.parameters, "parameters"), request.report
    if held and request.fixed:
        raise InputError(
            Option.HELD
            + " holds the operating point, which a fixed parameter moves; give one of them"
        )
    with PointBench(remember=True) as bench:
        master = bench.master(prepared)
        point = find_operating_point(master)
        blocks = Blocks(master, derivatives=True, directional=directional)
        found = modes_from(prepared, master, point, blocks, request.frequencies)
        chosen = _chosen(found, mode)
        parameters = parameters_of(master, patterns, fixed=request.fixed)
        at = _Mode(
            found.model,
            where_given(lambda: continuous(blocks)) if blocks.serves_continuous else None,
            chosen,
        )
        rows: dict[Parameter, Sensitivity] = {}
        anew: list[Parameter] = []
        # Components whose FMU may take a tunable parameter up at its start alone: no effect is seen while it runs.
        files = {
            name for name, table in prepared.case.table.components.items() if table.file is not None
        }
        unknown = files | set(foreign_components(master))
        acting = limits_that_act(master)
        for parameter in parameters:
            if held and not parameter.tunable:
                rows[parameter] = _none(
                    parameter,
                    chosen,
                    "held",
                    ("a fixed parameter moves the start: leave " + Option.HELD + " out"),
                )
            elif held or (parameter.tunable and _stays(master, parameter, blocks.period)):
                row = _row(
                    parameter,
                    chosen,
                    "held" if held else "stays",
                    _in_running(master, blocks, at, parameter),
                )
                if row.derivative == 0 and not held and parameter.component in unknown:
                    anew.append(parameter)
                else:
                    rows[parameter] = row
            else:
                anew.append(parameter)
            report(len(rows), len(parameters))
        for parameter in anew:
            rows[parameter] = _row(
                parameter,
                chosen,
                "moves",
                _started_anew(again, at, parameter, directional=directional, bench=bench),
            )
            report(len(rows), len(parameters))
    unknown_name = next(
        (text for text in found.unnamed.values() if mode is None and not found.named), None
    )
    about_mode: tuple[str, ...] = (
        (f"{unknown_name}; the mode here is the least damped one",) if unknown_name else ()
    )
    about_mode += _not_least(found, chosen) if mode is None else ()
    if patterns:
        about_mode += _idle(prepared, rows)
    warnings = _neighbour(found.model, chosen)
    ordered = [_with_switch(prepared, row) for row in sorted(rows.values(), key=_place)]
    if warnings:
        ordered = [
            replace(x, doubts=(*x.doubts, "double eigenvalue")) if x.derivative else x
            for x in ordered
        ]
    doubted = (_limited(row, acting) for row in ordered)
    return SensitivityResult(found, chosen, tuple(doubted), held, (*about_mode, *warnings))


def _place(row: Sensitivity) -> tuple[bool, bool, bool, float, float, str]:
    """Order rows by what moves damping most for the same percentage.

    A value of 0 has no percentage, and stands behind, by what its usual step moves; then comes what moves nothing, and
    what has no derivative."""
    per_percent = row.damping_per_percent
    points = row.points if per_percent is None else per_percent
    return (
        row.derivative is None,
        not row.derivative,
        per_percent is None,
        -abs(points or 0.0),
        -row.effect,
        row.parameter.name,
    )


def _not_least(found: ModesResult, chosen: Mode) -> tuple[str, ...]:
    """Return that another mode is damped less than the one that was taken for its name, as the explorer takes it."""
    least = _chosen(found, CRITICAL)
    if least is chosen:
        return ()
    return (
        "the mode here is the first one that the case names; damped less is "
        f"{mode_in_words(least.eigenvalue, least.by_component.items())}: "
        + Option.MODE
        + f" {CRITICAL} takes that one, as `gfor explore` does",
    )


def _idle(prepared: PreparedScenario, rows: Mapping[Parameter, Sensitivity]) -> tuple[str, ...]:
    """Return what was asked for by name and cannot act, with the reason."""
    names: dict[str, list[str]] = {}
    for parameter, row in rows.items():
        why = (
            ""
            if row.derivative
            else why_idle(prepared.system, parameter.component, parameter.variable)
        )
        names.setdefault(why, []).append(parameter.name)
    return tuple(
        f"{first_few(found, str)} cannot act: {why}" for why, found in names.items() if why
    )


def _with_switch(prepared: PreparedScenario, row: Sensitivity) -> Sensitivity:
    """A row of 0 that says what is off, if that is why its parameter moves nothing."""
    if row.derivative != 0:
        return row
    why = why_idle(prepared.system, row.parameter.component, row.parameter.variable)
    return replace(row, reason=f"cannot act: {why}") if why else row


def _chosen(found: ModesResult, name: str | None) -> Mode:
    if name is None and found.electromechanical is not None:
        return found.electromechanical
    if name not in (None, CRITICAL):
        if name in found.named:
            return found.named[name]
        known = ", ".join([*found.named, CRITICAL])
        if name in found.unnamed:
            raise InputError(Option.MODE + f" {name}: {found.unnamed[name]}; there are: {known}")
        raise InputError(
            Option.MODE
            + f" {name}: scenario {found.prepared.name!r} has no mode of this name; it has: "
            f"{known}"
        )
    swinging = [mode for mode in found.modes if mode.is_oscillation]
    if not swinging:
        raise InputError(
            f"scenario {found.prepared.name!r} has no oscillation in the range; give "
            "another " + Option.RANGE
        )
    return swinging[0]


class _Mode:
    """A mode in the step map and in the continuous model, whose shift a changed model gives."""

    def __init__(self, model: LinearModel, system: LinearModel | None, mode: Mode) -> None:
        self._model, self._system = model, system
        left, right = (
            np.array([vector[name] for name in model.names]) for vector in (mode.left, mode.shape)
        )
        self._pair = Eigenpair(mode.eigenvalue, left, right)
        exact = None if system is None else pair_at(system, mode.eigenvalue)
        same = exact is not None and abs(exact.eigenvalue - mode.eigenvalue) < _SAME * abs(
            mode.eigenvalue
        )
        self._exact = exact if same else None

    def shift(self, blocks: Blocks, master: Master) -> Shift:
        varied = model_of(master, blocks)
        if varied.names != self._model.names:
            raise AnalysisError(
                "with another value the outputs depend on other inputs, which changes the states"
            )
        system = None
        if self._system is not None and self._exact is not None:
            system = _shift(self._system, continuous(blocks), self._exact)
        edges = frozenset(name for name, c in blocks.components.items() if c.doubtful)
        return Shift(_shift(self._model, varied, self._pair), system, edges)


def _shift(model: LinearModel, varied: LinearModel, pair: Eigenpair) -> complex:
    sides = (np.asarray(side)[:, None] for side in (pair.left, pair.right))
    (shift,) = eigenvalue_shifts(model, varied, np.array([pair.eigenvalue]), *sides)
    return complex(shift)


def _stays(master: Master, parameter: Parameter, period: int) -> bool:
    """Tell if the system is where it was, with another value of a parameter: its component now and a step later, or all
    of it a period [communication steps] later where sampled controllers make the steps differ."""
    change = _TRIED * parameter.scale

    def answer() -> Numbers:
        return _answer(master, parameter.component) if period == 1 else _after(master, period)

    before = answer()
    for value in (
        parameter.value + sign * change for sign in (1, -1) if parameter.allows(sign * change)
    ):
        try:
            with changed(master, {parameter.name: value}, {parameter.name: parameter.value}):
                after = answer()
        except CosimError:  # it will not have the value while it runs; perhaps at a start
            return False
        if np.any(np.abs(after - before) > _STAYS * np.maximum(1.0, np.abs(before))):
            return False
    return True


def _after(master: Master, steps: int) -> Numbers:
    """All states some steps later; the system is put back."""
    state = CoupledState(master)
    with state.put_back():
        master.advance(steps)
        return state.read()


def _answer(master: Master, name: str) -> Numbers:
    """Outputs now, and states after a step; the component is put back."""
    exchange = master.exchanges[name]
    component = exchange.component
    outputs = RealBatch(component, exchange.outputs.names).read().copy()
    saved = component.save_state()
    try:
        component.step(master.time, master.clock.step_size)
        return np.concatenate([outputs, RealBatch(component, component.description.states).read()])
    finally:
        component.restore_state(saved)
        component.free_state(saved)


def _in_running(
    master: Master, blocks: Blocks, at: _Mode, parameter: Parameter
) -> Callable[[float], Shift]:
    def shift(value: float) -> Shift:
        with changed(master, {parameter.name: value}, {parameter.name: parameter.value}):
            return at.shift(blocks.with_component(master, parameter.component), master)

    return shift


def _started_anew(
    again: Again, at: _Mode, parameter: Parameter, *, directional: bool, bench: PointBench
) -> Callable[[float], Shift]:
    def shift(value: float) -> Shift:
        with bench.serving(again({parameter.name: value})) as master:
            return at.shift(_started(master, directional=directional), master)

    return shift


def _started(master: Master, *, directional: bool) -> Blocks:
    """The linear models of a system with another value, in its own steady state."""
    try:
        find_operating_point(master)
    except AnalysisError as error:
        raise AnalysisError(_NO_STEADY_STATE) from error
    return Blocks(master, derivatives=True, directional=directional)


def _row(
    parameter: Parameter, mode: Mode, operating_point: str, shift_at: Callable[[float], Shift]
) -> Sensitivity:
    try:
        derivative = differentiate(parameter, shift_at, mode.eigenvalue)
    except CaseError as error:
        return _none(
            parameter, mode, operating_point, "; ".join(str(problem) for problem in error.problems)
        )
    except CosimError as error:
        return _none(parameter, mode, operating_point, str(error))
    if derivative is None:
        return _none(
            parameter, mode, operating_point, "its declared bounds leave no room for a change"
        )
    return Sensitivity(
        parameter,
        mode.eigenvalue,
        derivative.step,
        derivative.continuous,
        operating_point,
        (*derivative.doubts, *_between_models(derivative, parameter, mode)),
    )


def _none(parameter: Parameter, mode: Mode, operating_point: str, reason: str) -> Sensitivity:
    return Sensitivity(
        parameter,
        mode.eigenvalue,
        derivative=None,
        continuous=None,
        operating_point=operating_point,
        doubts=(),
        reason=reason,
    )


def _between_models(derivative: Derivative, parameter: Parameter, mode: Mode) -> tuple[str, ...]:
    step, exact = derivative.step, derivative.continuous
    if exact is None:
        return ()
    floor = 1e-4 * abs(mode.eigenvalue) / (SHARE * parameter.scale)
    if abs(step - exact) <= _FAR * max(abs(step), abs(exact)) + floor:
        return ()
    return (
        f"without a communication step it is {abs(exact):.3g}, with it {abs(step):.3g} rad/s a unit",
    )


def _neighbour(model: LinearModel, mode: Mode) -> tuple[str, ...]:
    """A warning where another eigenvalue is so near that no derivative of one alone exists."""
    distances = sorted(
        abs(pair.eigenvalue - mode.eigenvalue) for pair in pairs_near(model, mode.eigenvalue)
    )
    if len(distances) < 2 or distances[1] > _DOUBLE * abs(mode.eigenvalue):
        return ()
    return (
        f"another mode is {distances[1]:.2g} rad/s away, which is a double eigenvalue within the perturbation's "
        "accuracy: a parameter may split the two, and a derivative of one of them alone does not exist",
    )


def _limited(row: Sensitivity, acting: Mapping[str, Sequence[str]]) -> Sensitivity:
    """A row that says which limits of its component act: beyond them the parameter may have another effect."""
    limits = acting.get(row.parameter.component, ())
    if not limits or row.derivative is None:
        return row
    return replace(
        row, doubts=(*row.doubts, *(f"a limit acts in this component: {name}" for name in limits))
    )
