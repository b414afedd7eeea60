"""Jobs for `drivers`: what to couple, as plain data, and as the SSP that ``gfor export ssp`` would write."""

from pathlib import Path

from fmus.toolchain.archive import write_archive
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.system import System
from orchestrator.systems.ssp.parameter_sets import SET_NAME
from orchestrator.systems.ssp.study import study_of
from orchestrator.systems.ssp.writing import ssp_members


def job_of(system: System, step_size: float, stop_time: float, record: list[str]) -> dict:
    """A system as a job; see `drivers`."""
    plans = system.components
    return {
        "fmus": {name: str(plan.description.path) for name, plan in plans.items()},
        "parameters": {name: dict(plan.parameters) for name, plan in plans.items()},
        "references": {
            name: {v.name: v.reference for v in plan.description.variables.values()}
            for name, plan in plans.items()
        },
        "wires": [
            [[end.component, end.variable] for end in (wire.source, wire.target)]
            for wire in system.connections
        ],
        "step_size": step_size,
        "stop_time": stop_time,
        "record": [list(name.split(".", 1)) for name in record],
        "parameter_set": SET_NAME,
    }


def write_ssp(system: System, job: dict, path: Path) -> None:
    """The job's system as our exporter packs it, values and FMUs included."""
    study = study_of("interop", "", job["step_size"], jacobi(tuple(system.components)), [], {})
    write_archive(path, ssp_members("interop", "", system, job["stop_time"], study))
