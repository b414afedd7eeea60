"""How long an FMU is made to run: so many steps, whatever a step takes; what was not reached is not passed."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import running
from orchestrator.devices.acceptance.checks.base import Verdict


class Slow:
    """An FMU whose steps take some time of a clock; NaN from a time on."""

    def __init__(self, clock, seconds, nan_at):
        self.clock, self.seconds, self.nan_at = clock, seconds, nan_at
        self.time = 0.0
        self.subject = None

    def record(self, steps, h, stimulus):
        self.clock.wall += steps * self.seconds
        self.subject.steps_made += steps
        times = self.time + h * np.arange(steps)
        return np.where(times >= self.nan_at, np.nan, 1.0)[:, None]


def result_of(monkeypatch, seconds, nan_at=np.inf, stop=1.0, step_size=1e-4):
    clock = SimpleNamespace(wall=0.0)
    monkeypatch.setattr(running, "perf_counter", lambda: clock.wall)
    fmu = Slow(clock, seconds, nan_at)

    @contextmanager
    def opened():
        yield fmu

    subject = fmu.subject = SimpleNamespace(
        step_size=step_size,
        description=SimpleNamespace(stop_time=stop),
        steps=lambda hold: None,
        steps_made=0,
        memory={},
        running=opened,
        memory_in_use=lambda: 0,
        watched=["y"],
        port=False,
    )
    return running.runs(subject), subject.steps_made


@pytest.mark.parametrize("seconds", [1e-6, 200e-6, 0.1])
def test_a_late_fault_is_found_of_a_slow_fmu_too(monkeypatch, seconds):
    result, _ = result_of(monkeypatch, seconds, nan_at=55.0)
    assert (result.verdict, result.fault) == (Verdict.FAIL, "not a number")


@pytest.mark.parametrize("seconds", [1e-6, 1e-3])
def test_as_many_steps_are_made_whatever_one_takes(monkeypatch, seconds):
    result, made = result_of(monkeypatch, seconds, step_size=1e-5)
    assert result.verdict == Verdict.PASS
    assert made == pytest.approx(running.RUN_FOR / running.STEP_TAKES, rel=0.01)


def test_an_experiment_that_is_not_reached_is_not_passed(monkeypatch):
    result, made = result_of(monkeypatch, 1e-6, stop=1000.0, step_size=1e-6)
    assert result.verdict == Verdict.REMARK
    assert "not judged from t = 8 s on" in result.evidence
    assert made == pytest.approx(10 * running.RUN_FOR / running.STEP_TAKES, rel=0.01)


@pytest.mark.parametrize(("ends", "left"), [(1.0, False), (500.0, True)])
def test_an_experiment_longer_than_is_run_is_told(monkeypatch, ends, left):
    result, _ = result_of(monkeypatch, 1e-6, stop=ends)
    assert result.verdict == Verdict.PASS
    assert (f"rest, to t = {ends:g} s, was not run" in result.evidence) is left
