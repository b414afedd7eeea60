"""Speed of a sweep: ``python -m tests.benchmarks.sweep [POINTS]``.

Sweeps X_L of the two-area system over all five scenarios, three times each in one process and in two, alternating, and
once on a local Dask cluster where Dask is installed. Every sweep is a process of its own and starts its workers anew.
Prints, beside the times of the whole process and of the points, workers' start included, what the machine gives to two
processes that only count, taken before each round: no sweep can be expected to do better than that.
"""

import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROUNDS = 3
COUNT = 20_000_000


def sweep(points: int, executor: str, folder: str) -> None:
    """Print the seconds of a sweep's points; run by ``python -c``, so that all imports count in the whole."""
    from orchestrator.cases.case import load_case  # noqa: PLC0415
    from orchestrator.studies.points.points import Work  # noqa: PLC0415
    from orchestrator.studies.points.store import PointStore  # noqa: PLC0415
    from orchestrator.studies.points.study import choose_executor  # noqa: PLC0415
    from orchestrator.studies.sweep.axes import parse_vary  # noqa: PLC0415
    from orchestrator.studies.sweep.point import SweepPointTask  # noqa: PLC0415
    from orchestrator.studies.sweep.request import SweepRequest  # noqa: PLC0415
    from orchestrator.studies.sweep.sweep import plan_sweep, run_sweep  # noqa: PLC0415

    where = (int(executor), None) if executor.isdigit() else (None, executor)
    chosen = choose_executor(*where, [SweepPointTask.__module__])
    plan = plan_sweep(
        load_case("two_area"), SweepRequest([parse_vary(f"grid.X_L=0.01:0.6:{points}")])
    )
    start = time.perf_counter()
    result = run_sweep(plan, Work(chosen, PointStore(Path(folder))))
    chosen.close()
    print(json.dumps([time.perf_counter() - start, result.computed]))


def timed(points: int, executor: str, folder: str) -> tuple[float, float, int]:
    """Seconds of the whole process and of the points, and their number."""
    call = f"from tests.benchmarks.sweep import sweep; sweep({points}, {executor!r}, {folder!r})"
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=True)
    seconds, computed = json.loads(done.stdout)
    return time.perf_counter() - start, seconds, computed


def numbers(folder: str) -> Iterator[tuple[str, bytes]]:
    """All that is kept of the points, to the last bit."""
    for path in sorted(Path(folder).glob("*.npz")):
        with np.load(path) as data:
            yield path.name, b"".join(data[name].tobytes() for name in sorted(data))


def count(_: int) -> None:
    """Work that needs nothing but a processor."""
    total = 0
    for number in range(COUNT):
        total += number * number


def machine() -> float:
    """How much faster two processes count than one."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(len, ["", ""], chunksize=1)
        start = time.perf_counter()
        pool.apply(count, (0,))
        middle = time.perf_counter()
        pool.map(count, [0, 1], chunksize=1)
        return 2 * (middle - start) / (time.perf_counter() - middle)


def main() -> None:
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    times: dict[str, list[tuple[float, float]]] = {"1": [], "2": []}
    with tempfile.TemporaryDirectory() as top:
        reference = []
        for number in range(ROUNDS):
            ceiling = machine()
            for workers, measured in times.items():
                folder = f"{top}/{number}_{workers}"
                whole, seconds, computed = timed(points, workers, folder)
                measured.append((whole, seconds))
                print(
                    f"{workers} process(es): points {seconds:.1f} s, in all {whole:.1f} s, {computed} points",
                    flush=True,
                )
                reference = reference or list(numbers(folder))
                print(
                    f"    equal to the last bit: {list(numbers(folder)) == reference}", flush=True
                )
            (whole_1, points_1), (whole_2, points_2) = times["1"][-1], times["2"][-1]
            print(
                f"  two processes are {points_1 / points_2:.2f} times as fast, in all {whole_1 / whole_2:.2f}; "
                f"at counting {ceiling:.2f}",
                flush=True,
            )
        best = [
            [min(column) for column in zip(*measured, strict=True)] for measured in times.values()
        ]
        print(f"best times: {best[0][1] / best[1][1]:.2f}, in all {best[0][0] / best[1][0]:.2f}")
        try:
            from distributed import LocalCluster  # noqa: PLC0415 - an extra
        except ImportError:
            return
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            whole, seconds, _ = timed(points, cluster.scheduler_address, f"{top}/dask")
        print(
            f"Dask, two workers: points {seconds:.1f} s; "
            f"equal to the last bit: {list(numbers(f'{top}/dask')) == reference}"
        )


if __name__ == "__main__":
    main()
