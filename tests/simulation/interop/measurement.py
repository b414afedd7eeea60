"""One master, three systems: what it gives, beside our emulation of its schedule."""

import importlib.util
import json
import os
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from orchestrator.simulation.interop.probe_result import SIGNALS, probe_system
from orchestrator.simulation.interop.rules import MASTERS, MasterRules
from orchestrator.simulation.interop.which_master import STEP_SIZE as PROBE_STEP_SIZE
from orchestrator.simulation.interop.which_master import STOP_TIME as PROBE_STOP_TIME
from orchestrator.studies.runs.like import emulate
from orchestrator.systems.coupling.system import System
from tests.simulation.interop.jobs import job_of, write_ssp
from tests.simulation.interop.systems import (
    KINDS,
    MAGNIFIED,
    STEP_SIZE,
    STOP_TIME,
    SYSTEMS,
    with_magnifier,
)

ROOT = Path(__file__).parents[3]
DRIVERS = Path(__file__).with_name("drivers.py")
TIMEOUT = 600
PACKAGES = {
    # master → modules that it needs, what installs them
    "libcosim": (("libcosimpy",), "libcosimpy"),
    "ecos": (("ecospy",), "ecospy tbb"),
    "ecos_executable": (("ecospy",), "ecospy tbb"),
    "fmpy_container": (("fmpy.container_fmu",), "'fmpy>=0.3.27'"),
    "fmpy_ssp": (("fmpy.ssp",), "'fmpy>=0.3.27'"),
    "fmucontainer": (("fmu_manipulation_toolbox",), "fmu-manipulation-toolbox"),
    "fmucontainer_sequential": (("fmu_manipulation_toolbox",), "fmu-manipulation-toolbox"),
    "mosaik": (("mosaik", "mosaik_api_v3"), "mosaik"),
    "pathsim": (("pathsim", "pathsim_fmi"), "pathsim-fmi"),
}
READ_SSP = ("fmpy_ssp", "ecos_executable")
"""Masters that are given the archive."""

COFMUPY_PYTHON = Path(
    os.environ.get("GFOR_COFMUPY_PYTHON", ROOT / ".venv-cofmupy" / "bin" / "python")
)
"""CoFMuPy pins its packages hard, so it has an environment of its own."""


@dataclass(frozen=True)
class Outcome:
    """How far a master's rows are from the emulation's.

    Attributes
    ----------
    difference
        Largest of any recorded signal in any row [pu].
    moved
        By how much the signal that moves most does.
    rows, expected
        Number of rows that the master gave, and that its rules say; libcosim's observers see no row at t = 0.
    """

    difference: float
    moved: float
    rows: int
    expected: int


def why_not(master: str, kind: str = "native") -> str | None:
    """Why a master cannot run a kind of FMU here; None if it can."""
    if master == "ecos_executable" and kind == "Python-backed" and libpython() is None:
        return "this Python is linked statically: there is no libpython to preload"
    if master.startswith("cofmupy"):
        if COFMUPY_PYTHON.exists():
            return None
        return (
            "CoFMuPy has no environment: python3 -m venv .venv-cofmupy && "
            ".venv-cofmupy/bin/pip install cofmupy==1.0.0; or name its Python in GFOR_COFMUPY_PYTHON"
        )
    modules, package = PACKAGES[master]
    if all(importlib.util.find_spec(module) for module in modules):
        return None
    return f"not installed: pip install {package} (or the extra 'interop')"


@dataclass(frozen=True)
class Given:
    """What a master gave in one process: for the systems of each kind of FMU, and for the probe pair.

    Attributes
    ----------
    systems
        System and what is recorded of it, by kind and name.
    results
        Result of a job by kind and name; none where the master ended before.
    said
        Its return code and its last words.
    """

    systems: dict[tuple[str, str], tuple[System, list[str]]]
    results: dict[tuple[str, str], dict]
    said: str


PROBES = ("Python-backed", "probes")


def results_of(
    master: str,
    folder: Path,
    kinds: tuple[str, ...] = KINDS,
    *,
    preload: bool = True,
) -> Given:
    """Run all systems of these kinds in a master, in one process of its own, and the probe pair if they are all.

    A master takes longer to begin than to run; native FMUs come first, with nothing of Python loaded.

    Parameters
    ----------
    preload
        Whether libpython is loaded into a host that is not Python where the FMUs need it.
    """
    systems, jobs = {}, {}
    for kind in sorted(kinds, key=KINDS.index, reverse=True):
        for name, coupled in SYSTEMS.items():
            system, record = coupled.build(kind), list(coupled.record)
            if master == "ecos_executable":
                system, record = with_magnifier(system, coupled.record, kind)
            systems[kind, name] = system, record
            jobs[kind, name] = system, job_of(system, STEP_SIZE, STOP_TIME, record)
    if kinds == KINDS:
        system = probe_system()
        jobs[PROBES] = system, job_of(system, PROBE_STEP_SIZE, PROBE_STOP_TIME, list(SIGNALS))
    return Given(systems, *_run(master, jobs, folder, preload=preload))


def measure(master: str, kind: str, given: Given) -> dict[str, Outcome]:
    """Compare what a master gave for all systems of a kind with the emulation."""
    names = {system: (kind, system) for system in SYSTEMS}
    assert set(names.values()) <= set(given.results), f"{master}: {given.said}"
    return {
        system: compare(MASTERS[master], *given.systems[name], given.results[name])
        for system, name in names.items()
    }


def _run(
    master: str, jobs: dict[tuple[str, str], tuple[System, dict]], folder: Path, *, preload: bool
) -> tuple[dict[tuple[str, str], dict], str]:
    """Results of a master in a process of its own, which may abort when it ends; and what it said."""
    command, results = [_python(master), str(DRIVERS), _driver(master)], {}
    for number, (name, (system, job)) in enumerate(jobs.items()):
        ssp, path, results[name] = (
            folder / f"{number}.{ending}" for ending in ("ssp", "json", "out")
        )
        if master in READ_SSP:
            write_ssp(system, job, ssp)
        kind, _ = name
        needs_it = preload and kind == "Python-backed"
        host = ecos_host(preload=needs_it) if master == "ecos_executable" else {}
        path.write_text(json.dumps(job | {"ssp": str(ssp)} | host), encoding="utf-8")
        command += [str(path), str(results[name])]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=TIMEOUT, cwd=folder
    )
    said = f"return code {done.returncode}\n{done.stdout}\n{done.stderr}"[-4000:]
    return {
        name: json.loads(result.read_text(encoding="utf-8"))
        for name, result in results.items()
        if result.exists()
    }, said


def compare(rules: MasterRules, system: System, record: list[str], result: dict) -> Outcome:
    """Rows of a master against the emulation of its schedule, matched by their labels."""
    emulation = emulate(system, rules, STEP_SIZE, STOP_TIME, record, order=result["order"])
    rows = np.array(result["rows"])
    index = np.round(rows[:, 0] / STEP_SIZE).astype(int)
    assert np.abs(rows[:, 0] - index * STEP_SIZE).max() < 1e-3 * STEP_SIZE
    scale = MAGNIFIED if "magnifier" in system.components else 1.0
    gaps = np.abs(rows[:, 1:] - emulation.values[index]) / scale
    moved = np.ptp(emulation.values, axis=0).max() / scale
    return Outcome(float(gaps.max()), float(moved), len(rows), rules.rows(STEP_SIZE, STOP_TIME))


def _driver(master: str) -> str:
    return "ecospy" if master == "ecos" else master


def _python(master: str) -> str:
    return str(COFMUPY_PYTHON) if master.startswith("cofmupy") else sys.executable


# -- a host that is not Python ---------------------------------------------------------------------


def ecos_host(*, preload: bool) -> dict:
    """How to start the executable of Ecos: with nothing of Python around it, or with libpython in it."""
    environment = {
        "PATH": os.defpath,
        "LD_LIBRARY_PATH": str(Path(sysconfig.get_path("data")) / "lib"),
    }
    if preload:
        library = libpython()
        assert library, "this Python has no shared library to preload"
        environment |= {"LD_PRELOAD": library, "PYTHONHOME": sys.base_prefix}
    return {"command": [str(_executable())], "environment": environment}


def libpython() -> str | None:
    """The shared library of this Python, for LD_PRELOAD; None where it is linked statically."""
    folder, name = sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME")
    path = Path(folder or "") / (name or "")
    return str(path) if ".so" in path.name and path.exists() else None


@cache
def _executable() -> Path:
    """Pip installs the file without the permission to run it."""
    spec = importlib.util.find_spec("ecospy")
    path = Path(spec.submodule_search_locations[0]) / "binaries" / "ecos"
    path.chmod(path.stat().st_mode | 0o111)
    return path
