"""Speed of the two-area system in several masters: ``python -m tests.benchmarks.masters``.

The same four FMUs with the same parameters (scenario pod_pq, H = 100 µs, a load 1 % up from t = 0) run in
this project's master, libcosim, Ecos and FMU containers, one after the other and each in a process of its
own, best of three. The table gives communication steps per second, the ratio to our master with the default
schedule, and how far sg1.omega is from our master run with the same schedule (40 points of the run).

The other masters are the optional extra ``interop``:
``pip install libcosimpy ecospy tbb fmu-manipulation-toolbox`` (instead of ``tbb``: Debian's libtbb12).
A container is driven from a C loop (our inner loop), with one doStep a communication step, and a second
time with one doStep for 500 of them, so that its own master does the stepping.
"""

import atexit
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from orchestrator.cases.case import load_case
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.simulation.interop import drivers
from tests.simulation.interop.jobs import job_of

STEPS, POINTS, REPEATS = 20_000, 40, 3
STEP_SIZE = 1e-4
WATCHED = ("sg1", "omega")

Stepper = Callable[[int], None]
Reader = Callable[[], float]
Runner = Callable[[bool], tuple[Stepper, Reader]]
"""Sets a fresh simulation up, with or without what is needed to read from it; the caller keeps both functions."""


def two_area() -> System:
    """Scenario pod_pq as it would start, except that a load draws 1 % more than the steady state has it."""
    (prepared,) = load_case("two_area").prepare(["pod_pq"])
    prepared.system.components["grid"].parameters["load_2.scale"] = 1.01
    return prepared.system


# -- masters -------------------------------------------------------------------------------------


def our_master(schedule: Schedule) -> Runner:
    return lambda _observe: _stepper(Master(two_area(), schedule, STEP_SIZE), WATCHED)


def _stepper(master: Master, watched: tuple[str, str]) -> tuple[Stepper, Reader]:
    batch = RealBatch(master.components[watched[0]], [watched[1]])
    atexit.register(master.close)

    def step(count: int) -> None:
        master.run((master.index + count) * master.clock.step_size)

    return step, lambda: float(batch.read()[0])


def libcosim(observe: bool) -> tuple[Stepper, Reader]:
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    job = job_of_two_area()
    execution, slaves = drivers.libcosim_execution(job)
    slave, omega = slaves[WATCHED[0]], job["references"][WATCHED[0]][WATCHED[1]]
    observer = CosimObserver.create_last_value() if observe else None
    if observer is not None:
        execution.add_observer(observer)

    def step(count: int) -> None:
        if not execution.step(count):
            raise RuntimeError("libcosim: a step failed")

    return step, lambda: float(observer.last_real_values(slave, [omega])[0])


def ecos(_observe: bool) -> tuple[Stepper, Reader]:
    simulation = drivers.ecos_simulation(job_of_two_area())
    return lambda count: simulation.step(count) and None, lambda: simulation.get_real(
        "::".join(WATCHED)
    )


def container(sequential: bool, stretch: int) -> Runner:
    def run(_observe: bool) -> tuple[Stepper, Reader]:
        folder = tempfile.mkdtemp(prefix="container_")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        path = drivers.container(job_of_two_area(), folder, sequential)
        outer = System()
        outer.add("container", read_description(path))
        master = Master(outer, jacobi(("container",)), stretch * STEP_SIZE)
        step, read = _stepper(master, ("container", ".".join(("recorded", *WATCHED))))
        return lambda count: step(count // stretch), read

    return run


def job_of_two_area() -> dict[str, Any]:
    return job_of(two_area(), STEP_SIZE, STEPS * STEP_SIZE, [".".join(WATCHED)])


DEVICES = (("gfor", "sg1", "sg2"), ("grid",))
FLAT = ("gfor", "sg1", "sg2", "grid")
CONTAINER, LONG = "fmu-manipulation-toolbox", 500
MASTERS: dict[str, tuple[Runner, str, str]] = {
    # label: how to run it, the package that it needs, our run with the same schedule
    "ours, Gauss-Seidel": (our_master(gauss_seidel(DEVICES)), "", ""),
    "ours, Jacobi": (our_master(jacobi(FLAT)), "", ""),
    "libcosim (Jacobi)": (libcosim, "libcosimpy", "ours, Jacobi"),
    "Ecos (Jacobi)": (ecos, "ecospy tbb", "ours, Jacobi"),
    "container, parallel": (container(False, 1), CONTAINER, "ours, Jacobi"),
    f"container, parallel, {LONG} steps a doStep": (
        container(False, LONG),
        CONTAINER,
        "ours, Jacobi",
    ),
    "container, sequential": (container(True, 1), CONTAINER, "ours, Gauss-Seidel"),
    f"container, sequential, {LONG} steps a doStep": (
        container(True, LONG),
        CONTAINER,
        "ours, Gauss-Seidel",
    ),
}


# -- measurement ---------------------------------------------------------------------------------


def measure(label: str) -> None:
    """In a process of its own: print the best rate and the trajectory as one line of JSON."""
    runner, alive, rates = MASTERS[label][0], [], []
    for _ in range(REPEATS):
        step, read = runner(False)
        step(STEPS // POINTS)
        start = time.perf_counter()
        step(STEPS)
        rates.append(STEPS / (time.perf_counter() - start))
        alive.append((step, read))
    step, read = runner(True)
    trajectory = []
    for _ in range(POINTS):
        step(STEPS // POINTS)
        trajectory.append(read())
    print("RESULT" + json.dumps({"rate": max(rates), "trajectory": trajectory}), flush=True)


def run_apart(label: str) -> dict[str, Any] | str:
    """Result of a master, or why there is none. A foreign master may abort when its process ends; that is no loss."""
    command = [sys.executable, "-m", "tests.benchmarks.masters", label]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        if line.startswith("RESULT"):
            return json.loads(line.removeprefix("RESULT"))
    package = MASTERS[label][1]
    if package and (
        "ModuleNotFoundError" in done.stderr or "cannot open shared object" in done.stderr
    ):
        return f"not installed: pip install {package}"
    said = done.stderr.strip().splitlines() or [f"return code {done.returncode}"]
    return f"did not run: {said[-1]}"


def table(results: dict[str, dict[str, Any] | str]) -> Sequence[str]:
    ours = results["ours, Gauss-Seidel"]
    assert isinstance(ours, dict), ours
    lines = [
        f"{'master':42} {'steps/s':>9} {'ours / it':>9}  largest difference of sg1.omega from ours [pu]"
    ]
    for label, result in results.items():
        if isinstance(result, str):
            lines.append(f"{label:42} {result}")
            continue
        same = results.get(MASTERS[label][2])
        difference = ""
        if isinstance(same, dict):
            gap = np.abs(np.subtract(result["trajectory"], same["trajectory"])).max()
            difference = f"{gap:.1e} ({MASTERS[label][2]})"
        ratio = ours["rate"] / result["rate"]
        lines.append(f"{label:42} {result['rate']:9,.0f} {ratio:9.2f}  {difference}".rstrip())
    moved = np.ptp(ours["trajectory"])
    lines.append(
        f"sg1.omega moves over {moved:.1e} pu in {STEPS} steps of {STEP_SIZE:g} s; best of {REPEATS} runs each"
    )
    return lines


def main() -> None:
    if len(sys.argv) > 1:
        measure(sys.argv[1])
        return
    print("\n".join(table({label: run_apart(label) for label in MASTERS})))


if __name__ == "__main__":
    main()
