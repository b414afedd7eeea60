"""Speed of a sweep: ``python -m tests.benchmarks.sweep [POINTS]``.

Sweeps X_L of the two-area system over all five scenarios, three times each in one process and in two, alternating, and
once on a local Dask cluster where Dask is installed. Prints the times, the ratio of the best ones, and whether all
results are equal to the last bit. Each run's workers start anew, and that is counted. On a machine that others use as
well, the processor time says more: two workers that need no more of it together than one process are twice as fast
where two cores are free.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from orchestrator.cases.case import load_case
from orchestrator.distributed.dask_cluster import DaskCluster
from orchestrator.distributed.executor import Executor
from orchestrator.distributed.processes import Processes
from orchestrator.distributed.serial import Serial
from orchestrator.study.sweep import SweepPlan, SweepResult, plan_sweep, run_sweep
from orchestrator.study.sweep_axes import parse_vary
from orchestrator.study.sweep_point import PointStore

ROUNDS = 3


def timed(plan: SweepPlan, executor: Executor) -> tuple[float, float, SweepResult]:
    """Seconds and processor seconds of a sweep into an empty folder, from the start of the workers to the end."""
    with tempfile.TemporaryDirectory() as folder:
        start, used = time.perf_counter(), processor_seconds()
        result = run_sweep(plan, executor, PointStore(Path(folder)))
        executor.close()
        return time.perf_counter() - start, processor_seconds() - used, result


def processor_seconds() -> float:
    """Of this process and of the workers that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def numbers(result: SweepResult) -> list[tuple[object, ...]]:
    """All that is computed, to the last bit."""
    return [
        (s.prepared.name, place, *(getattr(r.modes, a).tobytes() for a in ("eigenvalues", "left", "right")))
        for s in result.scenarios
        for place, r in sorted(s.points.items())
    ]


def main() -> None:
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    plan = plan_sweep(load_case("two_area"), [parse_vary(f"grid.X_L=0.01:0.6:{points}")])
    times: dict[str, list[float]] = {"one process": [], "two processes": []}
    results = {}
    for _ in range(ROUNDS):
        for name, executor in (("one process", Serial()), ("two processes", Processes(2))):
            seconds, used, results[name] = timed(plan, executor)
            times[name].append(seconds)
            print(f"{name}: {seconds:.1f} s, processor {used:.1f} s, {results[name].computed} points", flush=True)
    ratios = [one / two for one, two in zip(*times.values(), strict=True)]
    print(f"one process / two processes: best times {min(times['one process']) / min(times['two processes']):.2f}, "
          f"round by round {', '.join(f'{r:.2f}' for r in ratios)}")  # fmt: skip
    print(f"equal to the last bit: {numbers(results['one process']) == numbers(results['two processes'])}")
    try:
        from distributed import LocalCluster  # noqa: PLC0415 - an extra
    except ImportError:
        return
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        seconds, _, on_cluster = timed(plan, DaskCluster(cluster.scheduler_address))
    print(f"Dask, two workers: {seconds:.1f} s; "
          f"equal to the last bit: {numbers(results['one process']) == numbers(on_cluster)}")  # fmt: skip


if __name__ == "__main__":
    main()
