"""Checks are budgeted in steps: neither a busy machine nor a slow FMU is seen less of; wrappers may leak."""

import subprocess
import sys
import time

import pytest

from orchestrator.devices.acceptance import process
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits

ASKED = ("runs", "limits")
SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Follows(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.u, self.y = 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=0.0))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y += step * (self.u - self.y)
        return True
"""


def test_a_slow_answer_takes_nothing_away_from_what_is_seen(gallery, monkeypatch):
    """A call that takes three times as long changes neither the number of steps nor of disturbances."""
    quick = check_fmu(*gallery("matching"), Limits(seconds=6.0), ASKED, run_for=0.5)
    usual = process.FmuProcess.run

    def late(self, *given, **named):
        begin = time.perf_counter()
        found = usual(self, *given, **named)
        time.sleep(2 * (time.perf_counter() - begin))
        return found

    monkeypatch.setattr(process.FmuProcess, "run", late)
    slow = check_fmu(*gallery("matching"), Limits(seconds=6.0), ASKED, run_for=0.5)
    seen = [
        (r.figures.get("steps"), r.figures.get("tried"), r.figures.get("left_out"))
        for report in (quick, slow)
        for r in report.results
    ]
    assert seen[: len(seen) // 2] == seen[len(seen) // 2 :]


@pytest.mark.slow
def test_every_disturbance_is_tried_by_default(gallery):
    (*_, limits) = check_fmu(*gallery("matching"), Limits(seconds=6.0), ASKED).results
    assert limits.figures["left_out"] == 0


@pytest.mark.slow
def test_what_the_wrapper_of_a_python_fmu_keeps_is_a_remark(tmp_path):
    (tmp_path / "follows.py").write_text(SLAVE, encoding="utf-8")
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "follows.py", "-d", "."]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    (*_, memory) = check_fmu(tmp_path / "Follows.fmu", None, None, ("runs", "memory")).results
    assert memory.verdict == "remark"
    assert "PythonFMU" in memory.evidence
    assert "which wraps it, keeps" in memory.evidence
