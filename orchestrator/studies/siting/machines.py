"""Where a POD at a machine's voltage regulator helps: the residue from each regulator's reference to the machine's own
speed, and the best machines confirmed with a POD in the coupled FMUs."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError, CosimError, InputError
from orchestrator.core.options import Option
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.state_space import StateSpace, state_space
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import Mode, damping_percent
from orchestrator.studies.modes.modes import ModesResult, modes_from, running
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from orchestrator.studies.siting.confirmation import (
    Confirmation,
    in_turn,
    least_of,
    same_mode,
    trial_of,
    tuned_setting,
)
from orchestrator.studies.siting.least_damping import LeastDamping
from orchestrator.studies.siting.placing import STAGES
from orchestrator.studies.siting.study import SiteRequest
from orchestrator.systems.coupling.system import ComponentPlan

CONTROLLER = "pod_q"
PART = "pod"  # the stabiliser that is such a POD
_GENERATOR = "synchronous_generator_"  # beginning of the names of models of parts
_LEAST_PARTS = 3  # machine, exciter and governor
_REFERENCE = "exciter.delta_V_ref"
_SPEED = "omega"
_SIGNALS = ("pss.", "pod_q.")  # beginnings of the variables of a machine that has a stabiliser

# washout and lag of the POD before its gain, its defaults [s]: fmus.synchronous_generator.stabilization.damping
_WASHOUT = 5.0
_LAG = 0.02


@dataclass(frozen=True)
class RegulatorShift:
    """Δλ [rad/s] by a gain of 1 pu between the machine's speed and its voltage reference, without lead or lag; the
    change of the damping ratio [points] where the phase is tuned; and its part of the best machine's."""

    change: complex
    damping: float
    part: float

    @property
    def angle(self) -> float:
        """Angle of Δλ [°], which lead or lag turns to 180°."""
        return math.degrees(cmath.phase(self.change))


@dataclass(frozen=True)
class MachineSites:
    """Shifts by label of the mode and machine; the machines, best for the least damped mode first; those that have a
    stabiliser, which a POD would replace; those whose model has none to choose; and those without a voltage regulator
    to act on."""

    case: Case
    request: SiteRequest
    found: ModesResult
    modes: Mapping[str, Mode]
    shifts: Mapping[str, Mapping[str, RegulatorShift]]
    ranking: tuple[str, ...]
    stabilised: tuple[str, ...]
    fixed: tuple[str, ...]
    without: tuple[str, ...]
    confirmations: tuple[Confirmation, ...] = ()
    unconfirmed: tuple[str, ...] = ()  # machines before whose confirmation it was interrupted

    @property
    def prepared(self) -> PreparedScenario:
        return self.found.prepared

    @property
    def free(self) -> list[str]:
        """The machines that can have a POD as their stabiliser, best first."""
        return [name for name in self.ranking if name not in {*self.stabilised, *self.fixed}]

    @property
    def first(self) -> str:
        """The label of the least damped mode."""
        return next(iter(self.modes))

    @property
    def agrees(self) -> bool:
        return all(one.agrees for one in self.confirmations)

    @property
    def breaking(self) -> list[Confirmation]:
        """The machines at which the POD makes a stable system unstable."""
        stable = self.found.stability.stable is True
        return [one for one in self.confirmations if stable and one.stable is False]


def find_machines(
    case: Case, request: SiteRequest, report: Callable[[int, int], None] = lambda a, b: None
) -> MachineSites:
    """Rank the machines of a case as places of a POD at the voltage regulator, and confirm the best of those that have
    no stabiliser.

    Raises `InputError` if no machine has a voltage regulator, or an option is one for a device at a bus."""
    _check(request)
    scenario = request.scenario or next(iter(case.scenarios))
    prepared = _prepared(case, request, scenario, {})
    plans = prepared.system.components
    machines = [name for name, plan in plans.items() if plan.kind == "machine"]
    regulated = [name for name in machines if _REFERENCE in plans[name].description.variables]
    if not regulated:
        raise InputError(
            f"scenario {scenario!r}: no machine has a voltage regulator with a reference ("
            f"{_REFERENCE}) that a POD could move; take "
            + Option.DEVICE
            + " pod_q, a converter's, or a scenario whose machines have exciters"
        )
    stabilised = [
        name
        for name in regulated
        if any(v.startswith(_SIGNALS) for v in plans[name].description.variables)
    ]
    report(0, 1 + request.confirm)
    found, space, model = _linearised(prepared, regulated, request.frequencies)
    modes = _poor(found, 100 * request.below)
    shifts = {label: _shifts(mode, space, model, regulated) for label, mode in modes.items()}
    first = shifts[next(iter(modes))]
    ranking = tuple(sorted(regulated, key=lambda name: -first[name].damping))
    result = MachineSites(
        case=case,
        request=request,
        found=found,
        modes=modes,
        shifts=shifts,
        ranking=ranking,
        stabilised=tuple(stabilised),
        fixed=tuple(name for name in regulated if not _of_parts(plans[name])),
        without=tuple(name for name in machines if name not in regulated),
    )
    best = tuple(result.free[: request.confirm])
    report(1, 1 + len(best))
    done = in_turn(
        best,
        lambda name: _confirmed(result, name, scenario),
        lambda count: report(1 + count, 1 + len(best)),
    )
    return replace(result, confirmations=done, unconfirmed=best[len(done) :])


def _of_parts(plan: ComponentPlan) -> bool:
    """Return whether a machine is one of ours whose parts were chosen: its name has those of at least three."""
    name = plan.description.model_name
    parts = name.removeprefix(_GENERATOR).removesuffix("_phasor").split("_")
    return name.startswith(_GENERATOR) and len(parts) >= _LEAST_PARTS


def _check(request: SiteRequest) -> None:
    given = {
        Option.OUTAGES: request.outages is not None,
        Option.BUSES: bool(request.buses),
        Option.RATING: request.rating is not None,
        Option.BINDING: request.binding is not None,
    }
    wrong = [name for name, is_given in given.items() if is_given]
    if wrong:
        raise InputError(
            f"{wrong[0]} belongs to a device at a bus, and "
            + Option.DEVICE
            + f" {request.name} is one at a machine: leave it out, or take "
            + Option.DEVICE
            + " pod_q"
        )


def _prepared(
    case: Case, request: SiteRequest, scenario: str, further: Mapping[str, Value]
) -> PreparedScenario:
    (prepared,) = case.prepare(
        [scenario], {**request.overrides, **further}, request.step_size, None, request.files
    )
    return prepared


def _linearised(
    prepared: PreparedScenario, machines: list[str], frequency_range: tuple[float, float]
) -> tuple[ModesResult, StateSpace, LinearModel]:
    """The modes, and the continuous system between the machines' references and speeds."""
    inputs = [f"{name}.{_REFERENCE}" for name in machines]
    outputs = [f"{name}.{_SPEED}" for name in machines]
    with running(prepared) as master:
        point = find_operating_point(master)
        found = modes_from(
            prepared, master, point, Blocks(master, derivatives=True), frequency_range
        )
        blocks = Blocks(master, inputs=inputs, outputs=outputs, without_step=True)
        space = state_space(blocks, None)
    model = LinearModel.from_matrix(space.A, space.states, None)
    return found, space, model


def _poor(found: ModesResult, below: float) -> dict[str, Mode]:
    """The modes with less damping than ``below`` [%], or the least damped one, least damped first, by their labels."""
    swings = [mode for mode in found.modes if mode.is_oscillation]
    if not swings:
        raise InputError(
            f"scenario {found.prepared.name!r} has no oscillation in the range; give "
            "another " + Option.RANGE
        )
    poor = [mode for mode in swings if mode.damping_percent < below] or swings[:1]
    labels = dict[str, Mode]()
    for mode in poor:
        text = found.name_of(mode) or f"{mode.frequency_hz:.3f} Hz"
        labels[text if text not in labels else f"{text} ({len(labels) + 1})"] = mode
    return labels


def _shifts(
    mode: Mode, space: StateSpace, model: LinearModel, machines: list[str]
) -> dict[str, RegulatorShift]:
    pair = same_mode(mode, model)
    s = pair.eigenvalue
    filtered = s * _WASHOUT / (1 + s * _WASHOUT) / (1 + s * _LAG)
    drive = pair.left.conj() @ space.B
    shown = space.C @ pair.right
    changes = {name: complex(drive[k] * shown[k]) * filtered for k, name in enumerate(machines)}
    most = max(map(abs, changes.values())) or 1.0
    before = damping_percent(s)
    return {
        name: RegulatorShift(change, damping_percent(s - abs(change)) - before, abs(change) / most)
        for name, change in changes.items()
    }


def _confirmed(result: MachineSites, machine: str, scenario: str) -> Confirmation:
    """Put the POD there, tune it, and compare a small gain's shift with the residue's."""
    request, label = result.request, result.first
    further: dict[str, Value] = {
        f"{machine}.stabilizer": PART,
        f"{machine}.{CONTROLLER}.N_S": float(STAGES),
    }
    by_gain, mode = result.shifts[label][machine].change, result.modes[label]
    try:
        prepared = _prepared(result.case, request, scenario, further)
        with running(prepared) as master:
            find_operating_point(master)
            loop = PodLoop(master, [machine], CONTROLLER)
            off = PodSetting(0.0, NO_COMPENSATION)
            start = Placed(off, same_mode(mode, loop.model(off)))
            if not by_gain:
                raise AnalysisError("a POD there does not move the mode at all")
            s = start.eigenvalue
            looks = LeastDamping(loop, frequency_range=request.frequencies)
            tuned, search = tuned_setting(loop, start, by_gain, s, request.gain, looks=looks)
            turned = by_gain * tuned.filters.response(s)
            trial = trial_of(tuned, by_gain, s)
            coupled = loop.place(start, trial.gain, trial.filters).eigenvalue - s
            reached = loop.place(start, tuned.gain, tuned.filters)
            values = looks.all_values(tuned)
            return Confirmation(
                machine,
                predicted=trial.gain * turned,
                coupled=coupled,
                with_device=s,
                setting=tuned,
                tuned=reached.eigenvalue,
                least=least_of(values, request.frequencies, reached.eigenvalue),
                stable=looks.is_stable(tuned),
                search=search,
            )
    except CosimError as error:
        return Confirmation(machine, failure=str(error))
