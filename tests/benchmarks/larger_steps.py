"""What longer steps cost: processor time a simulated second of each schedule, interleaved in one run.

``python -m tests.benchmarks.larger_steps``; ``--native`` for native FMUs. With ``--same-step`` all schedules take the
case's step of 100 µs, and steps per second of processor time are printed: what a schedule costs by itself.
"""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from time import process_time

from orchestrator.face.api.case import load
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.schedule import SCHEDULES, ScheduleName

RUNS: tuple[tuple[ScheduleName, float], ...] = (
    ("gauss-seidel", 1e-4),
    ("midpoint", 5e-4),
    ("newton", 5e-4),
)
"""Schedules with their steps [s]; the first is what the others are compared with."""

SAME_STEP: tuple[tuple[ScheduleName, float], ...] = tuple((name, 1e-4) for name in SCHEDULES)
"""All schedules with the same step."""

CASES = {"two_area": 0.2, "ieee118": 0.05}
"""Simulated time of one turn [s]."""

SHORT = {"two_area": 0.2, "ieee118": 0.015}
"""The same with one step for all: midpoint diverges in `ieee118` after 0.09 s at 100 µs."""

TURNS = 5


def measure(
    case: str, turn: float, runs: Sequence[tuple[ScheduleName, float]], *, native: bool
) -> list[float]:
    """Processor time a simulated second [s] of each of some runs, the best of some turns.

    Parameters
    ----------
    case
        A built-in case with the scenario ``pod_pq``.
    turn
        Simulated time of one turn [s].
    runs
        Schedules with their steps [s].
    native
        Whether FMUs are native.
    """
    values = {"*.native": True} if native else {}
    file, best = load(case), [float("inf")] * len(runs)
    with ExitStack() as stack:
        masters = [
            stack.enter_context(
                running(file.scenario("pod_pq", values, step=step, schedule=schedule).prepared)
            )
            for schedule, step in runs
        ]
        for k in range(1, TURNS + 1):
            for i, master in enumerate(masters):
                start = process_time()
                master.run(k * turn)
                best[i] = min(best[i], process_time() - start)
    return [seconds / turn for seconds in best]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.larger_steps", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--native", action="store_true")
    parser.add_argument("--same-step", action="store_true")
    options = parser.parse_args(arguments)
    runs, cases = (SAME_STEP, SHORT) if options.same_step else (RUNS, CASES)
    for case, turn in cases.items():
        found = measure(case, turn, runs, native=options.native)
        for (schedule, step), seconds in zip(runs, found, strict=True):
            rate = f"{1 / (seconds * step):,.0f} steps/s, " if options.same_step else ""
            ratio = seconds / found[0]
            print(
                f"{case}: {schedule} at {step:g} s: {seconds:.3g} s, {rate}ratio {ratio:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
