"""One point of the study: one reactance of the line, with or without the converter. It can run in another process."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.units import whole_percent
from orchestrator.linear.models.device_start import misfits_of
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import find_spectrum
from orchestrator.linear.spectra.stability import judge
from orchestrator.simulation.watch.watch import Watch
from orchestrator.studies.black_box.coupled_modes import is_black_box, linearize_with_box
from orchestrator.studies.certification.bus_frequency import bus_frequency
from orchestrator.studies.modes.modes import modes_of, running
from orchestrator.studies.modes.naming import named_modes
from orchestrator.studies.points.failure import Failure, failure_kept
from orchestrator.studies.points.task import Kept, Task, computed
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder

COMPUTED = (0.05, 3.0)
"""Frequencies of the kept modes [Hz]. The range is wider than the judged one, which shows modes that enter it, and
lists modes just outside."""

CONVERTER = "converter"
# signals that are judged
POWER = "sg1.p"
FREQUENCY = "bus_2.frequency"


@dataclass
class PointResult(Kept):
    X_L: float
    scenario: str
    modes: ModeSet | None = None
    components: list[str] = field(default_factory=list)
    growth: float = float("nan")  # largest real part of any eigenvalue [1/s], zeros left out
    # the verdict over the whole spectrum, as `Stability.as_json` has it
    stability: dict[str, Any] | None = None
    residual: float = float("nan")
    # order of the model in the converter's place; None where its own states are used
    identified: int | None = None
    # by component: perturbed, directional, packed or identified; and how far a fit is from what was measured, relative
    linearised: dict[str, str] = field(default_factory=dict)
    fit_errors: dict[str, float] = field(default_factory=dict)
    # of the converter at the start, from its current [MW]; None without the converter
    power: float | None = None
    times: Numbers = field(default_factory=lambda: np.empty(0))
    signals: dict[str, Numbers] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    # of the watch on the run, as `Finding.as_json`
    findings: list[dict[str, Any]] = field(default_factory=list)
    # eigenvalues with the damping controllers off [rad/s], None where none are or `off_failure` says why; and the
    # electromechanical mode's off and on, nan where no shape tells it
    off: Complex | None = None
    swings: Complex = field(default_factory=lambda: np.full(2, np.nan + 0j))
    off_failure: str = ""
    failure: Failure | None = None  # why there are no modes, or why the response is incomplete

    keeps_failures = False

    @property
    def lasting(self) -> bool:
        return super().lasting and not self.off_failure


@dataclass(frozen=True)
class CertificatePointTask(Task):
    record = PointResult
    X_L: float
    black_box: bool = False
    # values by ``component.variable`` that switch the damping controllers off
    off: tuple[tuple[str, Value], ...] = ()

    def failed(self, failure: Failure) -> PointResult:
        return PointResult(self.X_L, self.scenario, failure=failure)


def compute_point(task: CertificatePointTask) -> PointResult:
    return computed(task, _result)


def _result(task: CertificatePointTask, case: Case) -> PointResult:
    result = PointResult(task.X_L, task.scenario)
    with failure_kept(result):
        prepared = task.study.prepare(case, {"grid.X_L": task.X_L})
        watch = Watch(prepared)
        with running(prepared) as master:
            misfits = misfits_of(master)
            _linearised(prepared, master, result, black_box=task.black_box)
            f_n = prepared.system.components["sg1"].number("f_n")
            try:
                master.run(prepared.stop_time, prepared.events, watch.observers)
            finally:
                _keep_signals(result, watch.recorder, master, f_n)
        result.findings = [finding.as_json() for finding in watch.findings(misfits=misfits)]
        if task.off:
            _switch_off(case, task, result)
    return result


def _switch_off(case: Case, task: CertificatePointTask, result: PointResult) -> None:
    other = PointResult(task.X_L, task.scenario)
    with failure_kept(other):
        prepared = task.study.prepare(case, {"grid.X_L": task.X_L, **dict(task.off)})
        with running(prepared) as master:
            _linearised(prepared, master, other, black_box=task.black_box)
    result.off_failure = other.error or ""
    if other.modes is not None:
        result.off, result.swings[0] = other.modes.eigenvalues, other.swings[1]


def _linearised(
    prepared: PreparedScenario, master: Master, result: PointResult, *, black_box: bool
) -> None:
    converter = master.components.get(CONVERTER)
    if converter is not None and (black_box or is_black_box(converter)):
        boxed = linearize_with_box(master, CONVERTER)
        result.residual, result.identified = boxed.residual, len(boxed.identified.A)
        result.fit_errors, result.warnings = {CONVERTER: boxed.identified.error}, boxed.warnings
        model, stability = boxed.model, judge(boxed.model, find_spectrum(boxed.model, *COMPUTED))
    else:
        found = modes_of(prepared, master, COMPUTED)
        result.residual, result.warnings = found.operating_point.residual, found.warnings
        model, stability = found.model, found.stability
    modes = [mode for mode in find_spectrum(model, *COMPUTED).modes if mode.is_oscillation]
    for mode in named_modes(prepared.case, model, modes).named.values():
        result.swings[1] = mode.eigenvalue
    result.modes = ModeSet.of(modes, model.names)
    result.linearised = dict(model.sources)
    result.components = [
        ", ".join(
            f"{name} {whole_percent(share)}"
            for name, share in mode.by_component.items()
            if share >= 0.01
        )
        for mode in modes
    ]
    result.stability, growth = stability.as_json(), stability.largest_growth_rate
    result.growth = float("nan") if growth is None else growth


def _keep_signals(result: PointResult, recorder: Recorder, master: Master, f_n: float) -> None:
    recorded = dict(zip(recorder.names, recorder.values.T.copy(), strict=True))
    result.times = recorder.times.copy()
    v = recorded.pop("grid.bus_2.v_re"), recorded.pop("grid.bus_2.v_im")
    i = recorded.pop(f"{CONVERTER}.i_re", None), recorded.pop(f"{CONVERTER}.i_im", None)
    if i[0] is not None and i[1] is not None and len(result.times):
        result.power = SYSTEM_BASE_MVA * float(v[0][0] * i[0][0] + v[1][0] * i[1][0])
    if len(result.times) > 1:
        recorded[FREQUENCY] = bus_frequency(result.times, *v, f_n)
    result.signals = recorded
    for name in recorded:
        component, _, variable = name.partition(".")
        known = (
            master.components[component].description.variables
            if component in master.components
            else {}
        )
        result.units[name] = known[variable].unit if variable in known else "Hz"
