"""A few of the signals that ``python -m tests.benchmarks.signals`` sends by the thousand."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="it counts the processor's time of a process"
)


@pytest.mark.slow
def test_a_signal_at_any_moment_ends_a_command_with_its_code():
    call = [sys.executable, "-m", "tests.benchmarks.signals", "3", "2", "run", "modes", "report"]
    done = subprocess.run(call, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("seed 2: 3 signals, 0 with errors\n")
