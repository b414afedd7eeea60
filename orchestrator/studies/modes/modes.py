"""The modes of a scenario: steady state, linear model, modes with names, and what they say of the coupling."""

import copy
import fnmatch
import math
from cmath import phase
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from orchestrator.cases.events.fault_tables import component_faults
from orchestrator.cases.form.schema import ReferenceModeTable
from orchestrator.cases.networks.areas import areas_of
from orchestrator.cases.questions.dead_bands import resting_loops
from orchestrator.cases.scenario.facts import facts_of, rated_frequency
from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.core.errors import ComponentError
from orchestrator.core.options import Option
from orchestrator.core.threads import side_by_side
from orchestrator.devices.binding.misfits import Misfit
from orchestrator.linear.doubts.common_speed import name_common_speed, tell_common_speed
from orchestrator.linear.doubts.examination import Examination, examine
from orchestrator.linear.doubts.external_exciters import settled_warnings
from orchestrator.linear.doubts.starts import warnings_at_start
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.device_start import misfits_of, sentences
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.models.linearization import Blocks, continuous_model
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.remembered import keep_by_system
from orchestrator.linear.models.steady_state import OperatingPoint, find_operating_point
from orchestrator.linear.spectra import modes as spectra
from orchestrator.linear.spectra.continuation import Near, near_with, pairs_near
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.mode_names import Naming
from orchestrator.linear.spectra.slowest_decay import LEAST_STATES, Decay, reduced, slowest_decay
from orchestrator.linear.spectra.stability import (
    WHOLE,
    Hidden,
    Stability,
    grows,
    hidden,
    whole_spectrum,
)
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.simulation.engine import Engine
from orchestrator.studies.modes.mode_identity import NamedSystem, settle_names
from orchestrator.studies.modes.naming import matching, named_modes
from orchestrator.studies.modes.start_errors import start_errors
from orchestrator.systems.coupling.coupled import open_plan
from orchestrator.systems.coupling.master import Master

# of the states of an electromechanical mode: angle and speed of one machine, and the speed of
# another
_LEADING = 3

SPARSE_BELOW = 0.2
"""Damping ratio below which a system too large for all its eigenvalues is searched where nobody asks for another."""

# states up to which both spectra take less time than two threads to start
_IN_TURN = 100

BlackBoxes = Callable[[Master], Mapping[str, ComponentLinearization]]
"""Identifies components of a running system that hide their states."""


@dataclass(frozen=True)
class PortValues:
    """Coupled inputs of a component with their values at the operating point, and names of its coupled outputs."""

    inputs: Mapping[str, float]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class ModesResult:
    prepared: PreparedScenario
    operating_point: OperatingPoint
    model: LinearModel
    modes: list[spectra.Mode]
    # the modes that the case looks for by their shape, as far as they are in range
    named: dict[str, spectra.Mode]
    # somebody else's figures for them, where their conditions hold
    references: dict[str, ReferenceModeTable]
    warnings: tuple[str, ...]
    swing: tuple[str, ...]  # states that show who swings against whom, mostly speeds
    areas: dict[str, str]
    stability: Stability
    # the oscillatory modes outside of the range; None where the system is too large for all its eigenvalues
    hidden: Hidden | None
    # the continuous model, without a communication step; None where a component gives no derivatives
    system: LinearModel | None
    # all of ``model`` [rad/s]; none where it is too large for them
    eigenvalues: Sequence[complex] = ()
    # of the components that were identified: largest relative difference of model and measured response
    fit_errors: dict[str, float] = field(default_factory=dict)
    # why no mode bears a name that the case gives, by name
    unnamed: Mapping[str, str] = field(default_factory=dict)
    misfits: Mapping[str, list[Misfit]] = field(default_factory=dict)
    # damping ratio below which modes were looked for; None where all were
    critical: float | None = None
    # the ports at the operating point of components with a loop that rests within its dead band, by component
    resting: Mapping[str, PortValues] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The scenario's title in a picture, with the verdict where the system is unstable."""
        rate = self.stability.largest_growth_rate
        if self.stability.stable is not False or rate is None:
            return self.prepared.title
        return f"{self.prepared.title}: UNSTABLE, {rate:+.3g} 1/s"

    @property
    def unasked(self) -> list[str]:
        """The warnings without the questions, which are asked before anything is computed."""
        asked = {
            str(question) for question in (*self.prepared.questions, *self.prepared.about_rows)
        }
        return [text for text in self.warnings if text not in asked]

    @property
    def electromechanical(self) -> spectra.Mode | None:
        return next(iter(self.named.values()), None)

    @property
    def linearised(self) -> dict[str, str]:
        """How the linear model of every component was found: perturbed, directional, packed or identified."""
        return dict(self.model.sources)

    def name_of(self, mode: spectra.Mode) -> str | None:
        return next((name for name, named in self.named.items() if named is mode), None)

    def by_area(self, mode: spectra.Mode) -> dict[str, float]:
        """Participation of every area, largest first; components without an area are left out."""
        return mode.by_group_of_components(self.areas)

    def swings_apart(self) -> tuple[list[spectra.Mode], list[spectra.Mode]]:
        """Return the modes in which machines swing or that have a name, and the others."""
        swinging: list[spectra.Mode] = []
        others: list[spectra.Mode] = []
        for mode in self.modes:
            swings = any(state in self.swing for state, _ in mode.participation[:_LEADING])
            (swinging if swings or self.name_of(mode) else others).append(mode)
        return swinging, others

    def swing_of(self, mode: spectra.Mode) -> tuple[list[str], list[str]]:
        """Components that swing together in a mode, and those that swing against them; each largest first.

        Those at an angle in between are in neither."""
        groups = mode.swing_groups(self.swing)
        together, against = (
            [s.partition(".")[0] for s in side] for side in (groups.together, groups.against)
        )
        return together, against


def compute_modes(
    prepared: PreparedScenario,
    frequency_range: tuple[float, float] = spectra.ELECTROMECHANICAL_HZ,
    critical: float | None = None,
    *,
    directional: bool = False,
) -> ModesResult:
    """Initialise a scenario's FMUs, verify their steady state, and linearise around it.

    ``critical``: damping ratio below which modes are looked for, by sparse search; None for the full spectrum, or
    `SPARSE_BELOW` in a system too large for that. The search knows too little to give modes their names.
    ``directional``: linearise with the FMUs' own directional derivatives instead of by perturbation."""
    with running(in_service(prepared)) as master:
        return modes_of(prepared, master, frequency_range, critical, directional=directional)


def running(
    prepared: PreparedScenario, engine: Engine | None = None, threads: int | None = 1
) -> Master:
    """The scenario's FMUs, initialised; those of an engine still in this process."""
    opener = open_plan if engine is None else engine.open
    try:
        return Master(
            prepared.system,
            prepared.schedule,
            prepared.step_size,
            prepared.stop_time,
            opener,
            threads,
        )
    except ComponentError as error:
        raise start_errors(prepared, error) or error from error


def modes_of(
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    critical: float | None = None,
    *,
    directional: bool = False,
) -> ModesResult:
    """`compute_modes` of a running system, whose FMUs stand at the operating point afterwards."""
    return _computed(
        linearised(prepared, master, frequency_range, critical, directional=directional)
    )


def linearised(
    prepared: PreparedScenario,
    master: Master,
    frequency_range: tuple[float, float],
    critical: float | None = None,
    *,
    directional: bool = False,
) -> "Linearised":
    """The same before its eigenvalues are computed."""
    misfits, said = (
        misfits_of(master),
        warnings_at_start(master),
    )
    point = find_operating_point(master)
    said += settled_warnings(master)
    blocks = Blocks(master, derivatives=True, directional=directional)
    return Linearised(
        prepared,
        master,
        point=point,
        blocks=blocks,
        frequency_range=frequency_range,
        critical=critical,
        said=said,
        misfits=misfits,
    )


def modes_from(
    prepared: PreparedScenario,
    master: Master,
    point: OperatingPoint,
    blocks: Blocks,
    frequency_range: tuple[float, float],
    critical: float | None = None,
    black_boxes: BlackBoxes | None = None,
) -> ModesResult:
    """The modes of components that were linearised at an operating point; ``black_boxes`` as `identified`."""
    misfits = misfits_of(master)
    return _computed(
        Linearised(
            prepared,
            master,
            point=point,
            blocks=blocks,
            frequency_range=frequency_range,
            critical=critical,
            said=(),
            misfits=misfits,
            black_boxes=black_boxes,
        )
    )


def start_alike(one: PreparedScenario, other: PreparedScenario) -> bool:
    """Return whether two scenarios start from the same system, so that they have one linear model.

    Events come later, and change none of it."""
    one, other = in_service(one), in_service(other)
    return (
        (one.step_size, one.stop_time, one.schedule)
        == (other.step_size, other.stop_time, other.schedule)
        and one.system.components == other.system.components
        and one.system.connections == other.system.connections
        and one.system.wires == other.system.wires
    )


def _computed(system: "Linearised") -> ModesResult:
    with side_by_side(pays=system.size > _IN_TURN) as pool:
        system.begin(pool)
    return system.finished()


class Linearised:
    """A linearised scenario, whose eigenvalues other threads compute meanwhile.

    ``said`` are earlier warnings, behind those of ``misfits``, which are as `misfits_of` gives them."""

    def __init__(
        self,
        prepared: PreparedScenario,
        master: Master,
        point: OperatingPoint,
        blocks: Blocks,
        frequency_range: tuple[float, float],
        critical: float | None,
        said: tuple[str, ...] = (),
        misfits: Mapping[str, list[Misfit]] = MappingProxyType({}),
        black_boxes: BlackBoxes | None = None,
    ) -> None:
        self._misfits = misfits
        self._prepared, self._master, self._point, self._blocks = prepared, master, point, blocks
        self._range, self._critical, self._said = (
            frequency_range,
            critical,
            (*sentences(misfits), *said, *(one.sentence for one in point.held)),
        )
        self._black_boxes = black_boxes
        self._model, self._system = model_of(master, blocks), continuous_model(master, blocks)
        states = len(self._model.names)
        if critical is None and states > WHOLE:
            self._critical = SPARSE_BELOW
            self._said += (_too_large(states, frequency_range),)
        self.named: NamedSystem | None = None
        self._of_system: Future[spectra.Spectrum | Decay | None]
        self._examined: Examination | None = None

    @property
    def size(self) -> int:
        """Number of states of the step map."""
        return len(self._model.names)

    def of(self, prepared: PreparedScenario) -> "Linearised":
        """Return the same under the name of a scenario that starts from the same system; nothing is computed again."""
        other = copy.copy(self)
        other._prepared, other.named = prepared, None
        return other

    def begin(self, pool: Executor) -> None:
        if self._system is not None and LEAST_STATES <= len(self._system.names) <= WHOLE:
            self._network = pool.submit(reduced, self._system)
            self._found = pool.submit(self._spectrum_of_map)
            # no thread waits for the map's meanwhile: the one that has it goes on
            self._of_system = Future()
            self._found.add_done_callback(self._go_on)
        elif self._system is not None and len(self._model.names) <= spectra.ALL_VECTORS:
            # SciPy's `eig` lets no other thread of Python run in a small system, so that the other spectrum must be on
            # its way, in NumPy's `eigvals`, before that begins.
            _ = self._system.A
            self._of_system = pool.submit(self._spectrum_of_system)
            self._found = pool.submit(self._spectrum_of_map)
        else:  # the step map's takes longer
            self._found = pool.submit(self._spectrum_of_map)
            self._of_system = pool.submit(self._spectrum_of_system)

    def _go_on(self, found: "Future[tuple[spectra.Spectrum | None, list[spectra.Mode]]]") -> None:
        try:
            of_map, _ = found.result()
            self._of_system.set_result(self._decay_of_system(of_map) or self._spectrum_of_system())
        except BaseException as error:  # for the thread that asks for the result
            self._of_system.set_exception(error)

    def _decay_of_system(self, of_map: spectra.Spectrum | None) -> Decay | None:
        """That no mode of the system grows, proved without all its eigenvalues; None where they are needed."""
        network = self._network.result()
        if self._system is None or network is None or of_map is None:
            return None
        if grows(of_map.eigenvalues).any():
            return None
        return slowest_decay(self._system, network, of_map.eigenvalues)

    def _spectrum_of_system(self) -> spectra.Spectrum | None:
        return None if self._system is None else whole_spectrum(self._system)

    def _spectrum_of_map(self) -> tuple[spectra.Spectrum | None, list[spectra.Mode]]:
        """The step map's spectrum, and the critical modes where only they are asked for."""
        if self._critical is not None:
            return whole_spectrum(self._model), find_critical_modes(
                self._model, *self._range, self._critical
            )
        first, last = _named_range(self._range)
        return spectra.find_spectrum(self._model, first, max(last, spectra.HIGHEST_SWING_HZ)), []

    def _at_gains(self, gains: Mapping[str, float]) -> LinearModel:
        """The model with other values of parameters that leave the operating point where it is."""
        # in service
        gains = {
            n: gain for n, gain in gains.items() if n.partition(".")[0] in self._master.components
        }
        before = {name: _value(self._prepared, name) for name in gains}
        blocks = self._blocks
        with changed(self._master, gains, before):
            for name in {name.partition(".")[0] for name in gains}:
                blocks = blocks.with_component(self._master, name)
            parts = tuple(blocks.components.values())
            return keep_by_system(
                self._master, "model", parts, lambda: model_of(self._master, blocks)
            )

    def finished(self, known: Mapping[str, NamedSystem] = MappingProxyType({})) -> ModesResult:
        """The result, once the eigenvalues are there; the FMUs are asked again for what it rests on."""
        prepared, model = self._prepared, self._model
        low, high = self._range
        spectrum, critical_modes = self._found.result()
        if self._critical is None and spectrum is not None:
            first, last = _named_range(self._range)
            oscillating = [mode for mode in spectrum.modes if mode.is_oscillation]
            swinging = [mode for mode in oscillating if first <= mode.frequency_hz <= last]
            shown = [mode for mode in swinging if low <= mode.frequency_hz <= high]
            directional = self._blocks.directional
            self.named = identified(
                prepared,
                self._point,
                model=model,
                modes=swinging,
                frequency_range=self._range,
                known=known,
                at_gains=self._at_gains,
                directional=directional,
                black_boxes=self._black_boxes,
                master=self._master,
                near=near_with(model, spectrum),
            )
            naming = self.named.naming
            named = {
                name: mode
                for name, mode in naming.named.items()
                if low <= mode.frequency_hz <= high
            }
        else:
            swinging = shown = critical_modes
            naming, named, oscillating = Naming({}), {}, []
        examined = self._examined = self._examined or examine(
            self._master,
            self._blocks,
            model,
            self._system,
            spectrum=spectrum,
            of_system=self._of_system.result(),
            modes=swinging,
            shown=shown,
            frequency_range=self._range,
        )
        analysis = prepared.case.table.analysis
        own = prepared.case.scenarios[prepared.name].events
        failing = component_faults(
            prepared.case.table.events if own is None else own, prepared.system
        )
        misfits = [
            f"{name} does not fit its binding: {misfit.fault}"
            for name, found in self._misfits.items()
            for misfit in found
        ]
        speeds = tuple(matching(model.names, analysis.swing))
        rated_hz = rated_frequency(prepared)
        stability = replace(name_common_speed(examined.stability, speeds), rated_hz=rated_hz)
        eigenvalues: Sequence[complex] = ()
        outside = None
        if spectrum is not None:
            eigenvalues = spectrum.eigenvalues.tolist()
            beyond = [mode for mode in oscillating if not low <= mode.frequency_hz <= high]
            swings = [mode for mode in beyond if is_swing(mode, analysis.swing)]
            outside = replace(
                hidden(spectrum.eigenvalues, low, high),
                electromechanical=tuple(mode.eigenvalue for mode in swings),
                who=tuple(spectra.shares_in_words(mode.by_component.items()) for mode in swings),
                rated_hz=rated_hz,
            )
        fit_errors = {
            name: component.disagreement
            for name, component in self._blocks.components.items()
            if component.source == IDENTIFIED
        }
        return ModesResult(
            prepared=prepared,
            operating_point=self._point,
            model=model,
            modes=shown,
            named=named,
            references=dict(prepared.references),
            misfits=self._misfits,
            warnings=(
                *self._said,
                *map(str, prepared.questions),
                *examined.warnings,
                *tell_common_speed(stability),
                *naming.doubts,
                *(f"{fault}: the modes are those before it" for fault in failing),
            ),
            swing=speeds,
            areas=areas_of(analysis.areas, prepared.system) or prepared.areas_of_units,
            stability=stability.doubted(misfits),
            hidden=outside,
            system=self._system,
            eigenvalues=eigenvalues,
            fit_errors=fit_errors,
            unnamed=naming.reasons,
            critical=self._critical,
            resting=self._ports_at_rest(),
        )

    def _ports_at_rest(self) -> dict[str, PortValues]:
        found = {}
        for loop in resting_loops(self._prepared.system.components):
            exchange = self._master.exchanges.get(loop.component)
            if exchange is not None:
                values = exchange.inputs.read().tolist()
                inputs = dict(zip(exchange.inputs.names, values, strict=True))
                found[loop.component] = PortValues(inputs, exchange.outputs.names)
        return found


def _too_large(states: int, frequency_range: tuple[float, float]) -> str:
    low, high = frequency_range
    return (
        f"{states} states are too many for all eigenvalues (at most {WHOLE}): modes from {low:g} to {high:g} Hz with "
        f"less than {100 * SPARSE_BELOW:g} % damping are found by sparse search; "
        + Option.CRITICAL
        + " and "
        + Option.RANGE
        + " take others"
    )


def identified(
    prepared: PreparedScenario,
    point: OperatingPoint,
    model: LinearModel,
    modes: Sequence[spectra.Mode],
    frequency_range: tuple[float, float] = spectra.ELECTROMECHANICAL_HZ,
    known: Mapping[str, NamedSystem] = MappingProxyType({}),
    at_gains: Callable[[Mapping[str, float]], LinearModel] | None = None,
    *,
    directional: bool = False,
    black_boxes: BlackBoxes | None = None,
    master: Master | None = None,
    near: Near = pairs_near,
) -> NamedSystem:
    """A linearised scenario with the names of its modes, by shape and where two fit by following.

    ``at_gains``: the linear model with other gains of damping controllers, where the scenario still runs.
    ``black_boxes``: identifies components of such a scenario that hide their states.
    ``master``: what keeps spectra of models that come again.
    ``near``: as `settle_names`."""
    first, last = _named_range(frequency_range)

    def name_system(
        other: PreparedScenario, at: OperatingPoint, linear: LinearModel
    ) -> NamedSystem:
        spectrum = keep_by_system(
            master, (first, last), (linear,), lambda: spectra.find_spectrum(linear, first, last)
        )
        found = [mode for mode in spectrum.modes if mode.is_oscillation]
        return NamedSystem(other, at, linear, found, named_modes(other.case, linear, found))

    def computed(other: PreparedScenario) -> NamedSystem:
        with running(in_service(other)) as beside:
            boxes = black_boxes(beside) if black_boxes else {}
            at = (
                OperatingPoint(math.nan, math.nan, math.nan, 0, {})
                if boxes
                else find_operating_point(beside)
            )
            linear = model_of(beside, Blocks(beside, directional=directional, known=boxes))
        return name_system(other, at, linear)

    return settle_names(
        NamedSystem(prepared, point, model, modes, named_modes(prepared.case, model, modes)),
        computed,
        known,
        undamped=None
        if at_gains is None
        else lambda gains: name_system(prepared, point, at_gains(gains)),
        near=near,
    )


@contextmanager
def changed(
    master: Master, values: Mapping[str, float], before: Mapping[str, float]
) -> Iterator[None]:
    """Inside, running FMUs have other values of tunable parameters; they are put back with their states."""
    saved = {
        name: master.components[name].save_state()
        for name in {key.partition(".")[0] for key in values}
    }
    try:
        for key, value in values.items():
            _set(master, key, value)
        yield
    finally:
        for name, state in saved.items():
            master.components[name].restore_state(state)
            master.components[name].free_state(state)
        for key, value in before.items():
            _set(master, key, value)


def _value(prepared: PreparedScenario, key: str) -> float:
    name, _, variable = key.partition(".")
    value = prepared.system.components[name].value(variable)
    assert not isinstance(value, str | None)
    return value


def _set(master: Master, key: str, value: float) -> None:
    name, _, variable = key.partition(".")
    master.components[name].set({variable: value})


def _named_range(shown: tuple[float, float]) -> tuple[float, float]:
    """Names are given before the range is applied, so that a mode outside it leaves its name to no other [Hz]."""
    return min(shown[0], spectra.ELECTROMECHANICAL_HZ[0]), max(
        shown[1], spectra.ELECTROMECHANICAL_HZ[1]
    )


def is_swing(mode: spectra.Mode, speeds: Sequence[str]) -> bool:
    """Return whether one of the states that show who swings against whom is among those that take part most."""
    states = [state for state, _ in mode.participation[:_LEADING]]
    return any(fnmatch.fnmatchcase(state, pattern) for state in states for pattern in speeds)


def unknown_modes(prepared: PreparedScenario, reasons: Sequence[str]) -> ModesResult:
    """The result for a system that can be simulated but not linearised: no modes, and a warning with the reasons."""
    why = "; ".join(reasons)
    said = (
        *map(str, prepared.questions),
        f"no steady state was looked for and there are no modes: {why}",
    )
    return ModesResult(
        prepared=prepared,
        operating_point=OperatingPoint(math.nan, math.nan, math.nan, 0, {}),
        model=LinearModel.from_matrix(np.zeros((0, 0)), (), prepared.step_size),
        modes=[],
        named={},
        references={},
        warnings=said,
        swing=(),
        areas={},
        hidden=None,
        system=None,
        stability=Stability(None, reason=f"the system cannot be linearised: {why}"),
    )


def modes_json(
    results: Sequence[ModesResult], questions: Sequence[str] = (), beside: Sequence[str] = ()
) -> Mapping[str, Any]:
    """The machine-readable form of `gfor modes`, of scenarios of one case with one communication step."""
    first = results[0].prepared
    asked = [str(question) for result in results for question in result.prepared.questions]
    facts = facts_of(first)
    return {
        "case": first.case.name,
        "step_size_s": first.step_size,
        "facts": None if facts is None else facts.sentence(),
        "beside": list(beside),
        "questions": list(dict.fromkeys([*asked, *questions])),
        "scenarios": [_whole_json(r) for r in results],
    }


def scenario_json(r: ModesResult) -> dict[str, Any]:
    """Return what `gfor modes` and `gfor run` both say of a scenario in JSON."""
    residual = r.operating_point.residual
    return {
        "name": r.prepared.name,
        "subject": r.prepared.subject,
        "models": r.prepared.models,
        "basis": r.prepared.basis,
        **r.prepared.names.as_json(),
        "residual": None if math.isnan(residual) else residual,
        "states": r.model.number_of_states,
        "stable": r.stability.stable,
        "largest_growth_rate": r.stability.largest_growth_rate,
        "stability": r.stability.as_json(),
        "outside_range": None if r.hidden is None else r.hidden.as_json(),
    }


def named_json(r: ModesResult) -> dict[str, Any]:
    """Return the modes with a name, somebody else's figures for them, and why other names have none."""
    return {
        "title": r.prepared.title,
        "modes": {
            name: eigenvalue_json(mode.eigenvalue, mode.damping_percent)
            for name, mode in r.named.items()
        },
        "references": {
            name: table.model_dump(exclude_none=True) for name, table in r.references.items()
        },
        "unnamed": dict(r.unnamed),
    }


def _whole_json(r: ModesResult) -> dict[str, Any]:
    """Return the same with all modes in the range."""
    named = {table.name: r.named.get(table.name) for table in r.prepared.case.table.analysis.modes}
    figures = {
        name: mode and eigenvalue_json(mode.eigenvalue, mode.damping_percent)
        for name, mode in named.items()
    }
    return {
        **scenario_json(r),
        "power_flow": power_flow_json(r.prepared),
        "linearised": r.linearised,
        "fit_errors": r.fit_errors,
        "warnings": list(r.warnings),
        "named": figures,
        "modes": [_mode_json(r, mode) for mode in r.modes],
    }


def _mode_json(r: ModesResult, mode: spectra.Mode) -> dict[str, Any]:
    """One mode with who takes part; smaller shares than 0.01 % are left out."""
    participation = [{"state": s, "factor": f} for s, f in mode.participation if f >= 1e-4]
    shape = [
        {
            "state": state,
            "magnitude": abs(mode.shape[state]),
            "angle_deg": math.degrees(phase(mode.shape[state])),
        }
        for state in r.swing
    ]
    return {
        **eigenvalue_json(mode.eigenvalue, mode.damping_percent),
        "name": r.name_of(mode),
        "participation": participation,
        "components": {c: f for c, f in mode.by_component.items() if f >= 1e-4},
        "areas": r.by_area(mode),
        "shape": shape,
    }
