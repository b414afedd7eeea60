"""How long an FMU is made to run: a busy machine takes nothing of it, and what was not reached is not passed."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import running
from orchestrator.devices.acceptance.checks.base import Verdict


class Slow:
    """An FMU whose steps take some time of a clock, of which it computes a part; NaN from a time on."""

    def __init__(self, clock, seconds, share, nan_at):
        self.clock, self.seconds, self.share, self.nan_at = clock, seconds, share, nan_at
        self.time = 0.0

    def record(self, steps, h, stimulus):
        self.clock.wall += steps * self.seconds
        self.clock.own += steps * self.seconds * self.share
        times = self.time + h * np.arange(steps)
        return np.where(times >= self.nan_at, np.nan, 1.0)[:, None]


def result_of(monkeypatch, seconds, share, nan_at=np.inf, stop=1.0):
    clock = SimpleNamespace(wall=0.0, own=0.0)
    monkeypatch.setattr(running, "perf_counter", lambda: clock.wall)
    monkeypatch.setattr(running, "process_time", lambda: clock.own)
    fmu = Slow(clock, seconds, share, nan_at)

    @contextmanager
    def opened():
        yield fmu

    subject = SimpleNamespace(
        step_size=1e-4,
        description=SimpleNamespace(stop_time=stop),
        steps=lambda hold: None,
        memory={},
        running=opened,
        memory_in_use=lambda: 0,
        watched=["y"],
        port=False,
    )
    return running.runs(subject), clock


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_a_fault_after_the_experiment_is_found_on_a_busy_machine_too(monkeypatch, share):
    """50 µs of computation a step; with a quarter of the processor a step takes 200 µs."""
    result, _ = result_of(monkeypatch, 50e-6 / share, share, nan_at=3.0)
    assert (result.verdict, result.fault) == (Verdict.FAIL, "not a number")


def test_what_waits_ends_as_well(monkeypatch):
    result, clock = result_of(monkeypatch, 1e-3, 0.0, stop=0.1)
    assert result.verdict == Verdict.PASS
    assert clock.wall == pytest.approx(4 * running.RUN_FOR, rel=0.1)


def test_an_experiment_that_is_not_reached_is_not_passed(monkeypatch):
    result, _ = result_of(monkeypatch, 1e-2, 1.0, nan_at=0.9)
    assert result.verdict == Verdict.REMARK
    assert "not judged from t = 0.2 s on" in result.evidence


@pytest.mark.parametrize(("ends", "left"), [(1.0, False), (500.0, True)])
def test_an_experiment_longer_than_is_run_is_told(monkeypatch, ends, left):
    seconds = 2 * running.RUN_FOR * 1e-4 / running.LONGEST
    result, _ = result_of(monkeypatch, seconds, 1.0, stop=ends)
    assert result.verdict == Verdict.PASS
    assert (f"rest, to t = {ends:g} s, was not run" in result.evidence) is left
