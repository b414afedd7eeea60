"""One row of a code, run on the test bench. It can run in another process."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import tomli_w

from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError, CosimError, ErrorKind
from orchestrator.core.safe_files import write_text
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.linear.models.device_start import misfits_of
from orchestrator.simulation.watch.finding import UNSTABLE, Finding
from orchestrator.simulation.watch.watch import Watch
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.codes.bench_resonance import find_resonance
from orchestrator.studies.certification.codes.measured import RESONANCE
from orchestrator.studies.certification.codes.programme import RATING_MVA, BenchProgramme
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.modes.modes import running
from orchestrator.studies.points.failure import Failure, failure_kept
from orchestrator.studies.points.task import Kept, Task, computed

# components of a row's case
PLANT = "converter"
DUPLICATE = "duplicate"
BENCH = "bench"

# at the connection point [pu of the plant's rating]: no voltage may jump between FMUs
CAPACITANCE = 0.05

RECORDED = ("v_re", "v_im", "v", "p", "q", "duplicate.p", "duplicate.q", "source.p", "source.q")

STEP = 1e-4  # communication step [s]
INTERVAL = 1e-3  # interval of the record [s]


def case_name(row: str) -> str:
    return f"row_{row}.toml"


def write_row(
    request: CertificationRequest,
    row: str,
    title: str,
    programme: BenchProgramme,
    f_n: float,
    folder: Path,
) -> Path:
    description = bound_fmu(request.fmu, request.binding)
    own = dict(request.values)
    components: dict[str, Any] = {
        PLANT: _plant(request, description, own, RATING_MVA, programme.power, f_n)
    }
    if programme.duplicate is not None:
        components[DUPLICATE] = _plant(
            request, description, own, RATING_MVA / 2, programme.duplicate, f_n
        )
    components[BENCH] = _bench(programme, f_n)
    ports = [(PLANT, "")] + ([(DUPLICATE, "duplicate.")] if programme.duplicate is not None else [])
    connections = []
    for name, prefix in ports:
        connections += [
            {"from": f"{BENCH}.v_{part}", "to": f"{name}.v_{part}"} for part in ("re", "im")
        ]
        connections += [
            {"from": f"{name}.i_{part}", "to": f"{BENCH}.{prefix}i_{part}"} for part in ("re", "im")
        ]
    events = [
        {
            "type": "parameter_change",
            "time": f"{c.time!r} s",
            "component": BENCH,
            "parameter": c.parameter,
            "value": c.value,
        }
        for c in programme.changes
    ]
    table = {
        "name": row,
        "title": title,
        "source": "written by gfor certify",
        "solver": {
            "step_size": f"{STEP:g} s",
            "stop_time": f"{programme.stop:g} s",
            "record_interval": f"{INTERVAL:g} s",
            "record": [f"{BENCH}.{name}" for name in RECORDED],
            "groups": [[name for name, _ in ports], [BENCH]],
        },
        "components": components,
        "connections": connections,
        "events": events,
    }
    path = folder / case_name(row)
    write_text(path, tomli_w.dumps(table))
    return path


def _plant(
    request: CertificationRequest,
    description: FmuDescription,
    own: Mapping[str, Value],
    rating: float,
    power: float,
    f_n: float,
) -> dict[str, Any]:
    values: dict[str, Any] = {
        "S_n": rating,
        "P_0": power,
        "Q_0": 0.0,
        "v_0": 1.0,
        "theta_0": 0.0,
        "f_n": f_n,
    }
    bound = description.port.start if isinstance(description, BoundDescription) else {}
    known = {
        name: value
        for name, value in values.items()
        if name in description.variables or name in bound
    }
    made: dict[str, Any] = {"fmu": FMU, "parameters": known | dict(own)}
    return made | ({"binding": BINDING} if request.binding else {})


def _bench(programme: BenchProgramme, f_n: float) -> dict[str, Any]:
    Z = programme.impedance
    power = programme.power + (programme.duplicate or 0.0) / 2
    made: dict[str, Any] = {
        "model": "test_bench",
        "native": True,
        "parameters": {
            "P_0": power,
            "f_n": f_n,
            "X_0": Z.imag,
            "R_0": Z.real,
            "B": CAPACITANCE,
            "load.P": RATING_MVA * programme.load[0],
            "load.Q": programme.load_mvar,
        },
    }
    if programme.duplicate is None:
        made["inputs"] = {"duplicate.i_re": 0.0, "duplicate.i_im": 0.0}
    return made


@dataclass
class BenchResult(Kept):
    row: str
    times: Numbers = field(default_factory=lambda: np.empty(0))
    # by the bench's names, each of the shape of ``times``
    signals: dict[str, Numbers] = field(default_factory=dict)
    # of the watch, in the form of `Finding.as_json`
    findings: list[dict[str, Any]] = field(default_factory=list)
    # processor time of the run, that of FMUs in processes of their own included [s]
    seconds: float = 0.0
    # what the binding declares of the plant [pu of its rating]; None where it declares none
    current_limit: float | None = None
    failure: Failure | None = None

    keeps_failures = False


@dataclass(frozen=True)
class BenchTask(Task):
    record: ClassVar[Any] = BenchResult
    row: str
    # values by ``component.variable`` that are others than the case file's
    changes: tuple[tuple[str, Value], ...] = ()

    def failed(self, failure: Failure) -> Any:
        return BenchResult(self.row, failure=failure)


def declared_limit(description: FmuDescription) -> float | None:
    """Return the current that a binding declares as a converter's limit [pu of its rating]; None where none does."""
    return description.port.current_limit if isinstance(description, BoundDescription) else None


def compute_row(task: BenchTask) -> BenchResult:
    return computed(task, row_result)


def row_result(task: BenchTask, case: Case) -> BenchResult:
    result, begin = BenchResult(task.row), _processor_time()
    with failure_kept(result):
        prepared = task.study.prepare(case, dict(task.changes))
        result.current_limit = declared_limit(prepared.system.components[PLANT].description)
        watch = Watch(prepared)
        ended: CosimError | None = None
        with running(prepared) as master:
            misfits = misfits_of(master)
            try:
                master.run(prepared.stop_time, prepared.events, watch.observers)
            except ComponentError as error:
                if error.kind is ErrorKind.HANG:
                    # a machine that is too busy looks the same: no verdict, and nothing is kept
                    raise
                # the converter gave up, or its values were no numbers: the row is not met
                ended = error
        _keep(result, watch)
        found = watch.findings(ended, misfits=misfits)
        high = bool((result.signals["v"] > RESONANCE).any())
        if high or ended is not None or any(finding.kind in UNSTABLE for finding in found):
            found += _resonance(task, case, result, prepared)
        result.findings = [finding.as_json() for finding in found]
        result.seconds = _processor_time() - begin
    return result


def _resonance(
    task: BenchTask, case: Case, result: BenchResult, prepared: PreparedScenario
) -> list[Finding]:
    """The finding on the bench's own resonance, from runs with parts of its capacitance and step."""

    def prepare(capacitance: float, step: float) -> PreparedScenario:
        study = replace(task.study, step_size=step * prepared.step_size)
        values = {**dict(task.changes), f"{BENCH}.B": capacitance * CAPACITANCE}
        return study.prepare(case, values)

    v = result.signals["v_re"] + 1j * result.signals["v_im"]
    names = [f"{BENCH}.{name}" for name in ("v_re", "v_im", "p", "q")]
    f_n = float(prepared.system.components[BENCH].value("f_n") or 0.0)
    found = find_resonance(prepare, result.times, v, names, f_n)
    return [] if found is None else [found]


def _processor_time() -> float:
    """Return the processor time [s] of this process and of those that it has started and that have ended."""
    return sum(os.times()[:4])


def _keep(result: BenchResult, watch: Watch) -> None:
    recorder = watch.recorder
    result.times = recorder.times.copy()
    named = zip(recorder.names, recorder.values.T.copy(), strict=True)
    result.signals = {name.removeprefix(f"{BENCH}."): values for name, values in named}
