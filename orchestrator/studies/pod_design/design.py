"""Design of POD-P or POD-Q by eigenvalue sensitivity, from linearisations of the coupled system (the paper's method).

The sensitivities are finite differences between two real linearisations, and the result is checked on the closed loop.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, MISSING, dataclass, field, replace
from typing import Any

from orchestrator.cases.case import Case
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.asked import DAMPING, FLAG, GAIN, GAIN_BOUNDS, NAME, STAGES, request_field
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.core.options import Option
from orchestrator.core.threads import one_thread
from orchestrator.linear.doubts.examination import Examination
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.steady_state import OperatingPoint, find_operating_point
from orchestrator.linear.spectra.continuation import pair_at
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, Mode, damping_ratio
from orchestrator.linear.spectra.stability import Stability
from orchestrator.studies.modes.modes import identified, running
from orchestrator.studies.modes.naming import named_modes
from orchestrator.studies.pod_design import lead_lag as leads
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting, figures_of
from orchestrator.studies.pod_design.growth import Growth, growth_of
from orchestrator.studies.pod_design.guard import Naming, Surroundings, breach, surroundings
from orchestrator.studies.pod_design.margins import LARGER_GAIN, VARIATION, Margins, compute_margins
from orchestrator.studies.pod_design.refinement import Judgement, Refinement, refine, sweep
from orchestrator.studies.pod_design.target import (
    CRITICAL,
    Target,
    check_range,
    find_target,
    mode_name,
    naming_critical,
    require_controllers,
)
from orchestrator.studies.points.request import ANYTHING, OfCase, of_scenario, of_values
from orchestrator.studies.points.store import PointStore

StageReport = Callable[[str], None]

_OFF = PodSetting(0.0, leads.NO_COMPENSATION)
_WRONG_WAY = 60.0
"""Angle of the sensitivity [°] below which a POD of the other sign needs less lead or lag: two usual stages turn the
rest, 120°."""
# a requirement counts as met if the damping ratio falls short of it by less: 0.05 points
_MET = 5e-4


@dataclass(frozen=True)
class DesignRequest(OfCase):
    """Design a POD controller by eigenvalue sensitivity, and check it on the closed loop.

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

    controller: str = request_field(ANYTHING, MISSING, '``"pod_p"`` or ``"pod_q"``', option=None)
    scenario: str | None = of_scenario("its name; by default the one without this controller")
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    component: str | None = request_field(
        NAME, None, "the converter, or a pattern for several with one setting"
    )
    mode: str | None = request_field(
        NAME,
        None,
        "the case's mode to damp (default: its first; the least damped swing where it names none)",
    )
    damping: float | None = request_field(DAMPING, None, "required damping, such as 20")
    damping_increment: float | None = request_field(
        DAMPING,
        None,
        "required increase of the damping in points (default: 10)",
        "POINTS",
        python="required increase of the damping, in points and in the place of ``damping``",
    )
    delta_gain: float = request_field(
        GAIN, 50.0, "gain of the finite-difference sensitivity [pu] (default: 50)"
    )
    gain_bounds: tuple[float, float] | None = request_field(
        GAIN_BOUNDS,
        None,
        "bounds of the gain [pu] (default: 200:400, and 0:400 in a search or with --points)",
    )
    stages: int | None = request_field(
        STAGES, None, "lead/lag stages (default: the component's own)"
    )
    compensated_gain: bool = request_field(
        FLAG, False, "compute the gain from the sensitivity with the lead/lag in place", option=None
    )
    least_damping: float = request_field(
        DAMPING,
        0.05,
        "damping below which no other mode may be pushed (default: 5)",
        option="--min-damping",
    )
    refine: bool = request_field(
        FLAG, False, "search gain and lead/lag on the closed loop (without bounds: where needed)"
    )
    margins: bool = request_field(
        FLAG, True, "compute the margins, which take longest", option=None
    )
    progress: bool = request_field(
        FLAG, False, "show a line with the stage that the design has come to", option=None
    )

    def bounds(self, *, search: bool) -> tuple[float, float]:
        return self.gain_bounds or (0.0 if search else 200.0, 400.0)

    @property
    def increment(self) -> float:
        return 0.10 if self.damping_increment is None else self.damping_increment


SearchOnLinearModels = Callable[
    [CaseDefinition, DesignRequest, Target, str, PodLoop, float], Sequence[tuple[str, PodSetting]]
]
"""From case, request, target, the mode's name, the running system and the mode's frequency [rad/s]: the best settings
with where they come from."""


@dataclass(frozen=True)
class GainSensitivities:
    """Mode [rad/s] and eigenvalue sensitivity [rad/s per pu] at the gain ΔK, without and with the lead/lag."""

    mode: complex
    value: complex
    compensated: complex


@dataclass(frozen=True)
class PodDesign:
    """A design with every figure on the way.

    ``filters``, ``gain``, ``designed``: By the paper's equations, and the closed loop with them."""

    request: DesignRequest
    case: str
    target: Target
    prepared: PreparedScenario
    mode_name: str
    # initial, required_damping, predicted: λ_0 [rad/s], ζ_d, λ_d [rad/s].
    initial: complex
    required_damping: float
    predicted: complex
    sensitivities: GainSensitivities
    filters: leads.LeadLag
    gain_non_compensated: float
    gain_compensated: float
    gain: float
    designed: Placed
    refinement: Refinement | None
    # smallest gain with the design's lead/lag that has the required damping, else that with most; None where refined
    other_gain: Placed | None
    # the closed loop with the final setting: the refined setting, or without refinement ``other_gain`` where it is
    # better, else ``designed``
    final: Placed
    before: Surroundings
    after: Surroundings
    # the setting of the first sensitivity, ΔK without lead/lag, where it has more damping with less gain; else None
    less_gain: Placed | None
    # the prohibited effect of the final setting on other modes; empty if there is no such effect
    broken: str | None
    margins: Margins | None
    # what `LARGER_GAIN` does to other modes, as ``broken``; None where it does not, or without margins
    spoilt: str | None
    # examined_before, examined: verdict over the whole spectrum without the controller and with the final setting.
    examined_before: Examination
    examined: Examination

    @property
    def unbounded_gain(self) -> float:
        return self.gain_compensated if self.request.compensated_gain else self.gain_non_compensated

    @property
    def stability_before(self) -> Stability:
        return self.examined_before.stability

    @property
    def stability(self) -> Stability:
        return self.examined.stability

    @property
    def warnings(self) -> tuple[str, ...]:
        of_both = [*self.examined_before.warnings, *self.examined.warnings]
        return tuple(dict.fromkeys([*self.target.remarks, *of_both]))

    @property
    def other_sign(self) -> str:
        """Advice to take controllers of the other sign, where that leaves the lead/lag less to turn; "" elsewhere."""
        angle = leads.angle_deg(self.sensitivities.value)
        return _other_sign(angle, self.target, self.prepared, self.request.controller)

    @property
    def met(self) -> bool:
        """Return whether the closed loop has the required damping, and leaves the other modes alone."""
        return self.damping_met and self.broken is None

    @property
    def damping_met(self) -> bool:
        return self.achieved_damping >= self.required_damping - _MET

    @property
    def thin_margin(self) -> float | None:
        """The target's damping ratio with a gain that is larger by `VARIATION`, where the requirement is met and that
        is too little; None where it holds there, or that is not known."""
        there = self.margins.variations.get(LARGER_GAIN) if self.margins else None
        return (
            there
            if self.met and there is not None and there < self.required_damping - _MET
            else None
        )

    @property
    def achieved(self) -> complex:
        """The mode [rad/s] that counts with the final setting; see `Surroundings.counting`."""
        return self.after.counting(self.final.eigenvalue)

    @property
    def worst_other(self) -> Mode | None:
        return self.after.worst_beside(self.final.eigenvalue)

    @property
    def achieved_damping(self) -> float:
        return damping_ratio(self.achieved)

    @property
    def gain_is_swept(self) -> bool:
        """Return whether the final gain is a better one than the equations', with their lead/lag."""
        return self.refinement is None and self.final is not self.designed

    @property
    def active_bound(self) -> str | None:
        """``lower`` or ``upper`` where the design's gain was brought to a bound."""
        if self.gain == self.unbounded_gain:
            return None
        return "lower" if self.gain > self.unbounded_gain else "upper"


def design_pod(
    case: Case,
    request: DesignRequest,
    report: StageReport,
    store: PointStore | None,
    search: SearchOnLinearModels,
) -> PodDesign:
    """Design a controller and check it on the closed loop.

    ``store``: keeps figures on the way as soon as they are there; those that are there already are not computed again.
    ``search``: gives a refinement settings to try."""
    require_controllers([request.controller])
    if request.damping is not None and request.damping_increment is not None:
        raise InputError(
            Option.DAMPING
            + " and "
            + Option.DAMPING_INCREMENT
            + " both say what is required; give one of them"
        )
    report("preparing the case")
    target = find_target(
        case,
        request.controller,
        scenario=request.scenario,
        pattern=request.component,
        stages=request.stages,
        overrides=request.overrides,
        parameters=request.files,
    )
    own: dict[str, Value] = {}
    for name in target.components:
        own[f"{name}.{request.controller}.enabled"] = False
        if target.neutral is None:
            own[f"{name}.{request.controller}.N_S"] = float(target.stages)
    overrides = {key: value for key, value in request.overrides.items() if key not in own} | own
    name = mode_name(case, request.mode)
    (prepared,) = case.prepare([target.scenario], overrides, request.step_size, None, request.files)
    for value, option in (
        (request.delta_gain, Option.DELTA_GAIN),
        (request.bounds(search=True)[1], Option.GAIN_BOUNDS),
    ):
        check_range(
            prepared.system.components, target.components, f"{request.controller}.K", value, option
        )
    # no last digit depends on the number of threads, and two would wait for each other on many small matrices
    with one_thread(), running(prepared) as master:
        report("operating point")
        point = find_operating_point(master)
        loop = PodLoop(
            master,
            target.components,
            request.controller,
            figures_of(prepared, store),
            neutral=target.neutral,
        )
        report("modes without the controller")
        examined = loop.examine(_OFF)
        said = (one.sentence for one in point.held)
        examined = replace(examined, warnings=(*said, *examined.warnings))
        with _with_stability(examined.stability):
            model = loop.model(_OFF)
            before = surroundings(model, loop.spectrum(_OFF), None, _no_name)
            modes = [mode for mode in before.others if mode.is_oscillation]
            named = _target_mode(prepared, point, model, modes, name)
            before = replace(before, named=named.mode)
            if before.named is None:
                low, high = ELECTROMECHANICAL_HZ
                raise InputError(
                    f"scenario {target.scenario!r} shows no mode {name!r} between {low:g} and {high:g} Hz; "
                    f"modes there: {', '.join(f'{m.frequency_hz:.3f} Hz' for m in before.others) or 'none'}"
                )
            off = Placed(_OFF, pair_at(model, before.named.eigenvalue))
            start = _Start(
                case.name,
                request,
                target=target,
                prepared=named.prepared,
                mode_name=name,
                off=off,
                before=before.without(before.named),
                naming=named.naming,
                examined=examined,
                search=search,
            )
            return _design(start, loop, report)


@dataclass(frozen=True)
class _Named:
    """The mode with the target's name, None if there is none; what gives the name to a mode of other settings, and the
    scenario with the rule for it."""

    prepared: PreparedScenario
    mode: Mode | None
    naming: Naming


def _target_mode(
    prepared: PreparedScenario,
    point: OperatingPoint,
    model: LinearModel,
    modes: Sequence[Mode],
    name: str,
) -> _Named:
    """Find the target among modes, least damped first.

    Raises `InputError` if none fits its name alone."""
    case = prepared.case
    if name == CRITICAL and modes:
        case = replace(case, table=naming_critical(case.table, modes))

    def naming(other: LinearModel, found: list[Mode]) -> Mode | None:
        # with a gain of any size, a tie counts as a change
        fitting = named_modes(case, other, found).fits.get(name)
        return None if fitting is None else fitting[0]

    if name == CRITICAL:
        least = next(iter(modes), None)
        its_own = naming(model, list(modes)) is least  # or its rule fits another one better
        return _Named(replace(prepared, case=case), least, naming if its_own else _no_name)
    names = identified(prepared, point, model, modes).naming
    if name not in names.named and name in names.reasons:
        raise InputError(f"scenario {prepared.name!r}: {names.reasons[name]}")
    return _Named(prepared, names.named.get(name), naming)


def _no_name(model: LinearModel, modes: list[Mode]) -> Mode | None:
    """Name no mode: what is followed is the target alone."""
    return None


@contextmanager
def _with_stability(stability: Stability) -> Iterator[None]:
    """Add to an error that ends a design that the system is unstable without the controller, if it is."""
    try:
        yield
    except (InputError, AnalysisError) as error:
        if stability.stable is not False:
            raise
        raise type(error)(
            f"{error}\nWithout the controller the system is {stability.sentence()}"
        ) from error


@dataclass(frozen=True)
class _Start:
    case: str
    request: DesignRequest
    target: Target
    prepared: PreparedScenario
    mode_name: str
    off: Placed
    before: Surroundings
    naming: Naming
    examined: Examination
    search: SearchOnLinearModels


def _design(start: _Start, loop: PodLoop, report: StageReport) -> PodDesign:
    request, off, before = start.request, start.off, start.before
    initial = off.eigenvalue
    required = _required(request, initial)
    predicted = leads.predicted_mode(required, initial)
    report("sensitivity of the mode")
    equations = _solve_equations(start, loop, predicted)
    report("closed loop with the design")
    designed = loop.place(off, equations.gain, equations.filters)
    judge = _Judge(start, loop)
    choice = _choose(judge, designed, equations.filters, required, report)
    final = choice.final
    examined = loop.examine(final.setting)
    growth = growth_of(
        loop,
        final.setting,
        examined.stability,
        request.bounds(search=choice.refinement is not None),
    )
    margins = spoilt = None
    if request.margins and final.setting.gain and examined.stability.stable is not False:
        margins = compute_margins(loop, off, final, request.least_damping, report)
        with suppress(AnalysisError):  # the mode cannot be followed
            more = loop.place(off, (1 + VARIATION) * final.setting.gain, final.setting.filters)
            spoilt = judge.breach_in(judge.around(more))
    return PodDesign(
        request=request,
        case=start.case,
        target=start.target,
        prepared=start.prepared,
        mode_name=start.mode_name,
        initial=initial,
        required_damping=required,
        predicted=predicted,
        sensitivities=equations.sensitivities,
        filters=equations.filters,
        gain_non_compensated=equations.gain_non_compensated,
        gain_compensated=equations.gain_compensated,
        gain=equations.gain,
        designed=designed,
        refinement=choice.refinement,
        other_gain=choice.other_gain,
        final=final,
        less_gain=None if choice.refinement else _less_gain(judge, final),
        before=before,
        after=choice.after,
        broken=choice.broken or _unstable(examined.stability, growth),
        margins=margins,
        spoilt=spoilt,
        examined_before=start.examined,
        examined=examined,
    )


@dataclass(frozen=True)
class _Equations:
    """Lead/lag and gain by the paper's equations, from the sensitivity of the mode; gains as `PodDesign` has them."""

    sensitivities: GainSensitivities
    filters: leads.LeadLag
    gain_non_compensated: float
    gain_compensated: float
    gain: float


def _solve_equations(start: _Start, loop: PodLoop, predicted: complex) -> _Equations:
    request, off, initial = start.request, start.off, start.off.eigenvalue
    bare = loop.place(off, request.delta_gain)
    S = leads.sensitivity(bare.eigenvalue, initial, request.delta_gain)
    angle = leads.angle_deg(S)
    try:
        filters = leads.lead_lag(angle, initial.imag, start.target.stages)
    except AnalysisError as error:
        typed = _other_sign(angle, start.target, start.prepared, request.controller)
        raise AnalysisError(f"{error}{typed and f'. Or {typed}'}") from error
    turned = loop.place(off, request.delta_gain, filters)
    S_turned = leads.sensitivity(turned.eigenvalue, initial, request.delta_gain)
    non_compensated = leads.required_gain(predicted, initial, abs(S))
    compensated = leads.required_gain(predicted, initial, abs(S_turned))
    unbounded = compensated if request.compensated_gain else non_compensated
    return _Equations(
        GainSensitivities(bare.eigenvalue, S, S_turned),
        filters,
        non_compensated,
        compensated,
        gain=leads.bounded(unbounded, request.bounds(search=False)),
    )


@dataclass(frozen=True)
class _Judge:
    """Judges settings on the closed loop, each of them once."""

    start: _Start
    loop: PodLoop
    judged: dict[PodSetting, Judgement] = field(default_factory=dict)

    def around(self, placed: Placed) -> Surroundings:
        """The other modes of the closed loop with a setting."""
        model, spectrum = self.loop.model(placed.setting), self.loop.spectrum(placed.setting)
        return surroundings(model, spectrum, placed.eigenvalue, self.start.naming)

    def breach_in(self, after: Surroundings) -> str | None:
        return breach(self.start.before, after, self.start.request.least_damping)

    def judgement(self, placed: Placed) -> Judgement:
        if placed.setting not in self.judged:
            after = self.around(placed)
            damping = damping_ratio(after.counting(placed.eigenvalue))
            least = min(
                [damping_ratio(placed.eigenvalue), *(mode.damping_ratio for mode in after.others)]
            )
            self.judged[placed.setting] = Judgement(damping, self.breach_in(after), least)
        return self.judged[placed.setting]


@dataclass(frozen=True)
class _Choice:
    """The final setting with the closed loop around it, and the searches that led to it, as `PodDesign` has them."""

    final: Placed
    after: Surroundings
    broken: str | None
    refinement: Refinement | None = None
    other_gain: Placed | None = None


def _choose(
    judge: _Judge,
    designed: Placed,
    filters: leads.LeadLag,
    required: float,
    report: StageReport,
) -> _Choice:
    """The design by the equations, or a better setting where it falls short and one may be searched."""
    request = judge.start.request
    after = judge.around(designed)
    short = damping_ratio(after.counting(designed.eigenvalue)) < required - _MET
    choice = _Choice(designed, after, judge.breach_in(after))
    if request.refine or ((short or choice.broken) and request.gain_bounds is None):
        refinement = _refined(judge, filters, required, report)
        final = refinement.chosen or designed
        after = judge.around(final)
        return _Choice(final, after, judge.breach_in(after), refinement)
    if not short:
        return choice
    report("other gains")
    other = None
    with suppress(AnalysisError):  # the mode cannot be followed
        bounds = request.bounds(search=False)
        other = sweep(judge.loop, judge.start.off, filters, required, bounds, "as designed").chosen
    if other is None:
        return choice
    there, now = judge.judgement(other), judge.judgement(designed)
    if there.damping > now.damping + _MET and not (there.broken and not now.broken):
        return _Choice(other, judge.around(other), there.broken, other_gain=other)
    return replace(choice, other_gain=other)


def _less_gain(judge: _Judge, final: Placed) -> Placed | None:
    """The setting of the first sensitivity, where it has more damping with less gain than the final one, is stable, and
    leaves the other modes no worse."""
    start, gain = judge.start, judge.start.request.delta_gain
    if gain >= final.setting.gain:
        return None
    bare = judge.loop.place(start.off, gain)
    there, now = judge.judgement(bare), judge.judgement(final)
    if there.least is None or now.least is None:
        return None
    better = there.damping > now.damping + _MET and there.least >= now.least - _MET
    if not better or there.broken or not judge.loop.examine(bare.setting).stability.stable:
        return None
    return bare


def _refined(
    judge: _Judge, filters: leads.LeadLag, required: float, report: StageReport
) -> Refinement:
    """The best gain and lead/lag on the closed loop."""
    start, request = judge.start, judge.start.request

    def settings() -> Sequence[tuple[str, PodSetting]]:
        report("refinement: a search and a grid of settings on the linear model")
        return start.search(
            start.prepared.case,
            request,
            start.target,
            start.mode_name,
            judge.loop,
            start.off.eigenvalue.imag,
        )

    return refine(
        judge.loop,
        start.off,
        filters=filters,
        required=required,
        bounds=request.bounds(search=True),
        judge=judge.judgement,
        search=settings,
        evenly=request.mode is None,
        report=report,
    )


def _unstable(stability: Stability, growth: Growth | None) -> str | None:
    """The fault of a design with which the system is not known to be stable at all frequencies; None if it is.

    ``growth``: what grows, beside what it was without the controller; None where that is not known."""
    if stability.stable:
        return None
    if growth is not None:
        return growth.sentence()
    subject = "the system is" if stability.stable is False else "whether the system is stable is"
    return f"{subject} {stability.sentence()}"


def _other_sign(angle: float, target: Target, prepared: PreparedScenario, controller: str) -> str:
    """The advice to turn the sign around: a sensitivity of a small angle [°] points to less damping."""
    if abs(angle) >= _WRONG_WAY:
        return ""
    typed = target.turned_around(prepared.system.components, controller)
    if not typed:
        return ""
    return (
        f"turn the sign around: without compensation the controller undamps the mode (the sensitivity's angle is "
        f"{angle:.0f}°), and with the other sign the lead/lag turns by {abs(angle):.0f}° instead of "
        f"{180 - abs(angle):.0f}°: add {' '.join(typed)}"
    )


def _required(request: DesignRequest, initial: complex) -> float:
    """ζ_d, checked against the damping ratio without the controller."""
    present = damping_ratio(initial)
    required = request.damping if request.damping is not None else present + request.increment
    if required <= present:
        raise InputError(
            Option.DAMPING
            + f" {100 * required:g}: without the controller the mode has {100 * present:.2f}"
            " % already; ask for more, or for an increase with " + Option.DAMPING_INCREMENT
        )
    if required >= 1:
        raise InputError(
            f"{100 * required:.1f} % of damping are required (the mode has {100 * present:.1f} %); "
            "it must be less than 100 %"
        )
    return required
