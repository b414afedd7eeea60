"""Speed of the two-area study: ``python -m tests.benchmarks.two_area``.

Prints, taken in one run: communication steps per second of the four coupled Python-backed FMUs with
the share spent inside FMUs, the same loop with the FMUs' pure-Python kernels, and the time that all
five scenarios take from built FMUs to modes.
"""

import os
import subprocess
import sys
import time

from orchestrator.cases.case import load_case
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.master import Master

STEPS = 50_000


def steps_per_second(steps: int) -> tuple[float, float]:
    """Best of three runs of the pod_pq scenario, and the share of time inside FMI calls."""
    (ready,) = load_case("two_area").prepare(["pod_pq"])
    best = None
    for _ in range(3):
        with Master(ready.system, ready.schedule, ready.step_size) as master:
            statistics = master.run(steps * ready.step_size)
        if best is None or statistics.steps_per_second > best.steps_per_second:
            best = statistics
    return best.steps_per_second, best.share_in_fmus


def modes_seconds() -> float:
    """Prepare, initialise, verify and linearise all five scenarios."""
    start = time.perf_counter()
    case = load_case("two_area")
    for ready in case.prepare():
        compute_modes(ready)
    return time.perf_counter() - start


def main() -> None:
    if os.environ.get("GFOR_COSIM_KERNEL") == "python":
        print(steps_per_second(STEPS // 50)[0])
        return
    rate, share = steps_per_second(STEPS)
    print(
        f"compiled kernel: {rate:,.0f} communication steps/s, {share:.0%} of the time inside FMUs"
    )
    environment = os.environ | {"GFOR_COSIM_KERNEL": "python"}
    command = [sys.executable, "-m", "tests.benchmarks.two_area"]
    slow = float(
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    )
    print(
        f"pure-Python kernel: {slow:,.0f} communication steps/s; compiled / Python = {rate / slow:.0f}"
    )
    first, again = modes_seconds(), modes_seconds()
    print(f"modes of five scenarios: {first:.1f} s with all imports, {again:.1f} s again")


if __name__ == "__main__":
    main()
