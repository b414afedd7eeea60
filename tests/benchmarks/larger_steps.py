"""What longer steps cost: processor time a simulated second of each schedule, interleaved in one run.

``python -m tests.benchmarks.larger_steps``; ``--native`` for native FMUs.
"""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from time import process_time

from orchestrator.api.case import load
from orchestrator.coupling.schedule import ScheduleName
from orchestrator.study.modes import running

RUNS: tuple[tuple[ScheduleName, float], ...] = (("gauss-seidel", 1e-4), ("midpoint", 5e-4), ("newton", 5e-4))
"""Schedules with their steps [s]; the first is what the others are compared with."""

CASES = {"two_area": 0.2, "ieee118": 0.05}
"""Simulated time of one turn [s]."""

TURNS = 5


def measure(case: str, turn: float, *, native: bool) -> list[float]:
    """Processor time a simulated second [s] of each of `RUNS`, the best of some turns.

    Parameters
    ----------
    case
        A built-in case with the scenario ``pod_pq``.
    turn
        Simulated time of one turn [s].
    native
        Whether FMUs are native.
    """
    values = {"*.native": True} if native else {}
    file, best = load(case), [float("inf")] * len(RUNS)
    with ExitStack() as stack:
        masters = [
            stack.enter_context(running(file.scenario("pod_pq", values, step=step, schedule=schedule).prepared))
            for schedule, step in RUNS
        ]
        for k in range(1, TURNS + 1):
            for i, master in enumerate(masters):
                start = process_time()
                master.run(k * turn)
                best[i] = min(best[i], process_time() - start)
    return [seconds / turn for seconds in best]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.larger_steps", description=__doc__.split("\n")[0])
    parser.add_argument("--native", action="store_true")
    options = parser.parse_args(arguments)
    for case, turn in CASES.items():
        found = measure(case, turn, native=options.native)
        for (schedule, step), seconds in zip(RUNS, found, strict=True):
            print(f"{case}: {schedule} at {step:g} s: {seconds:.3g} s, ratio {seconds / found[0]:.2f}")


if __name__ == "__main__":
    main()
