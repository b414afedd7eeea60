"""One thread, several, and the automatic choice, on native FMUs: ``python -m tests.benchmarks.threads [THREADS]``.

The masters of a case run side by side and take turns of a few milliseconds, so that whatever else the machine does
disturbs all of them alike. All are compared to the last bit after every turn. Printed are the medians and the best of
the turns, the processor time of the thread that calls and of all threads, and what Amdahl's law allows: the FMUs of a
group are shared out, the groups follow one another.
"""

import os
import sys
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.systems.coupling.master import Master

CASES = (("two_area", "pod_pq"), ("ieee118", "pod_pq"))
TURNS, SECONDS_OF_A_TURN = 200, 0.005
SETTLED = 1500
"""Communication steps before the first turn: calls are timed and shared out in them."""


@dataclass
class Measured:
    """Seconds a communication step of each turn: by the clock, and of processor time."""

    clock: list[float] = field(default_factory=list)
    caller: list[float] = field(default_factory=list)
    process: list[float] = field(default_factory=list)

    def take(self, master: Master, steps: int) -> None:
        clock, caller, process = time.perf_counter(), time.thread_time(), time.process_time()
        master.advance(steps)
        self.process.append((time.process_time() - process) / steps)
        self.caller.append((time.thread_time() - caller) / steps)
        self.clock.append((time.perf_counter() - clock) / steps)


def amdahl(master: Master, threads: int, costs: NDArray[np.float64]) -> tuple[float, float]:
    """Seconds a step inside FMUs on one thread, and the factor by which threads can shorten that at best."""
    each = iter(costs)
    groups = [np.array([next(each) for _ in group]) for group in master.schedule.groups]
    alone = sum(group.sum() for group in groups)
    return alone, alone / sum(max(group.sum() / threads, group.max()) for group in groups)


def print_case(prepared: PreparedScenario, threads: int) -> None:
    """Measure a case and print a row for each way."""
    ways = {"1 thread": 1, f"{threads} threads": threads, "automatic": None}
    masters = {
        name: Master(prepared.system, prepared.schedule, prepared.step_size, threads=number)
        for name, number in ways.items()
    }
    try:
        for master in masters.values():
            master.advance(SETTLED)
        alone = masters["1 thread"]
        begun = time.perf_counter()
        alone.advance(SETTLED)
        steps = max(20, round(SECONDS_OF_A_TURN * SETTLED / (time.perf_counter() - begun)))
        for name in ways:
            if name != "1 thread":
                masters[name].advance(SETTLED)
        measured = {name: Measured() for name in ways}
        # the least of all turns: others disturb some
        costs = np.full(len(prepared.system.components), np.inf)
        for _ in range(TURNS):
            before = np.array(alone.seconds())
            for name, master in masters.items():
                measured[name].take(master, steps)
            costs = np.minimum(costs, (np.array(alone.seconds()) - before) / steps)
            same = {master.y.tobytes() for master in masters.values()}
            assert len(same) == 1, "threads gave another value"
        used = {
            name: master.statistics(1, 1.0, master.seconds()).threads
            for name, master in masters.items()
        }
    finally:
        for master in masters.values():
            master.close()
    inside, bound = amdahl(masters["1 thread"], threads, costs)
    print(
        f"{prepared.case.name}, {len(prepared.system.components)} FMUs, {1e6 * inside:.1f} us a step inside FMUs; "
        f"{threads} threads can be {bound:.2f} times as fast at best"
    )
    reference = measured["1 thread"]
    for name, found in measured.items():
        ratios = np.array(reference.clock) / np.array(found.clock)
        median = float(np.median(found.clock))
        best = min(reference.clock) / min(found.clock)
        speed = f"{1 / median:9,.0f} steps/s, {prepared.step_size / median:.2f} x real time"
        print(
            f"  {name:10} ({used[name]} used): {speed}; ratio {np.median(ratios):.2f} (best turns {best:.2f});"
        )
        caller, process = 1e6 * np.median(found.caller), 1e6 * np.median(found.process)
        print(
            f"    processor time of the caller {caller:.1f} us, of all threads {process:.1f} us a step"
        )


def main() -> None:
    threads = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; {TURNS} turns of each way")
    for name, scenario in CASES:
        prepared, *_ = load_case(name).prepare([scenario] if scenario else (), {"*.native": True})
        print_case(prepared, threads)


if __name__ == "__main__":
    main()
