"""From a command to its answer: ``python -m tests.benchmarks.start_up [--against CHECKOUT]``.

Every command runs once to fill the caches, then several times in processes of its own. The median of processor time
(user and system, of the command and what it starts) and of time on the clock is printed; beside another checkout, the
ratio as well. BLAS has one thread, since waiting threads count as processor time.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
COMMANDS = {
    "two_area": ("modes", "two_area"),
    "ieee39": ("modes", "ieee39", "--scenario", "base"),
    "ieee118": ("modes", "ieee118", "--scenario", "pod_pq"),
    "ieee118_all": ("modes", "ieee118"),
    "wscc9_run": (
        "run",
        "wscc9",
        "--scenario",
        "pod_p",
        "--native",
        "--stop",
        "10",
        "--out",
        "{folder}/wscc9",
    ),
}
"""Name → words of the command ``gfor``."""


def _command(checkout: Path) -> str:
    """Module of the command; before rooms stood on floors it was another one."""
    floors = (checkout / "orchestrator" / "face").is_dir()
    return "orchestrator.face.cli" if floors else ".".join(("orchestrator", "cli"))


def measured(checkout: Path, words: tuple[str, ...], repeats: int) -> tuple[float, float]:
    """Median of processor time and of time on the clock [s], from kept FMUs and compiled modules."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {
            **{
                name: value
                for name, value in os.environ.items()
                if name != "PYTHONDONTWRITEBYTECODE"
            },
            "PYTHONPATH": str(checkout),
            "PYTHONPYCACHEPREFIX": str(Path(folder) / "compiled"),
            "OPENBLAS_NUM_THREADS": "1",
        }
        command = [
            sys.executable,
            "-m",
            _command(checkout),
            *(word.format(folder=folder) for word in words),
        ]
        times = [_once(command, environment, checkout) for _ in range(repeats + 1)][1:]
    return median(cpu for cpu, _ in times), median(clock for _, clock in times)


def _once(command: list[str], environment: dict[str, str], checkout: Path) -> tuple[float, float]:
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=environment, cwd=checkout, check=True, stdout=subprocess.DEVNULL)
    clock, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, clock


def main() -> None:
    """Print one line for each command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="root of another checkout")
    parser.add_argument(
        "--repeats", type=int, default=5, help="times that each command is measured (default: 5)"
    )
    parser.add_argument(
        "--only", action="append", choices=COMMANDS, help="only this command (repeatable)"
    )
    options = parser.parse_args()
    for name in options.only or COMMANDS:
        cpu, clock = measured(ROOT, COMMANDS[name], options.repeats)
        line = (
            f"gfor {' '.join(COMMANDS[name])}: {cpu:.2f} s of processor, {clock:.2f} s on the clock"
        )
        if options.against is not None:
            other, other_clock = measured(
                options.against.resolve(), COMMANDS[name], options.repeats
            )
            ratios = f"{other / cpu:.1f} and {other_clock / clock:.1f} times"
            line += f"; there {other:.2f} and {other_clock:.2f} s: {ratios}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
