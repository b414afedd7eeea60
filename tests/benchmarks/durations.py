"""Measures every test that lands a change, and writes the list of those that take long.

python -m tests.benchmarks.durations            # all of them
python -m tests.benchmarks.durations --longest  # the twenty longest of the list
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.support.durations import LIST, LONGEST, LONGEST_THAT_CATCHES, MEASURED, read_list

ROOT = Path(__file__).parents[2]
_MISTAKES = ("mutations.json", "random_mutations.json")  # by which test each was caught


def measured(*options: str) -> dict[str, float]:
    """Seconds of processor by test, from one run of pytest with these options."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "seconds"
        environment = {**os.environ, MEASURED: str(path)}
        subprocess.run(
            [sys.executable, "-m", "pytest", *options], cwd=ROOT, env=environment, check=False
        )
        return read_list(path)


def write(seconds: dict[str, float], path: Path = LIST) -> None:
    caught = catching()
    lines = [
        f"{value:.1f} {test}"
        for test, value in sorted(seconds.items())
        if value >= (LONGEST_THAT_CATCHES if without_values(test) in caught else LONGEST)
    ]
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def catching() -> set[str]:
    """Tests that caught a planted mistake, without the values of their parameters."""
    return {without_values(test) for test in catches()}


def catches() -> set[str]:
    """Tests that caught a planted mistake, as pytest calls them."""
    results = (json.loads((Path(__file__).parent / name).read_text("utf-8")) for name in _MISTAKES)
    return {one["by"] for found in results for one in found.values()} - {""}


def without_values(test: str) -> str:
    return test.partition("[")[0]


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.durations", description=__doc__.split("\n")[0]
    )
    parser.add_argument(
        "--longest", action="store_true", help="show the list's twenty longest instead"
    )
    if parser.parse_args().longest:
        for test, seconds in sorted(read_list().items(), key=lambda entry: -entry[1])[:20]:
            print(f"{seconds:8.1f} s  {test}")
        return
    write(measured("-n", "2", "-m", "not nightly and not wheel"))


if __name__ == "__main__":
    main()
