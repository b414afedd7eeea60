"""What a box does at once, measured at a component that is a matrix."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.studies.black_box import bench
from orchestrator.studies.black_box.bench import Runs
from orchestrator.studies.black_box.frequency_response import odd_lines


def test_the_direct_effect_is_half_the_difference_of_both_ways(monkeypatch):
    D, rest, at = np.array([[0.5, -2.0, 0.0], [3.0, 0.25, 1.0]]), np.array([1.0, -2.0, 0.5]), {}

    class Batch:
        def __init__(self, _, names):
            self.values = np.zeros(len(names))

        def write(self):
            at["u"] = self.values.copy()

        def read(self):
            return D @ at["u"] + np.array([7.0, -4.0])

    monkeypatch.setattr(bench, "RealBatch", Batch)
    run = object.__new__(Runs)
    run._bench = SimpleNamespace(outputs=["p", "q"], inputs=["a", "b", "c"], rest=rest)
    run._component = object()
    monkeypatch.setattr(run, "_rewind", lambda: None)
    np.testing.assert_allclose(run.feedthrough(0.01), D, atol=1e-12)
    assert at["u"].tolist() == rest.tolist(), "and everything is put back"


@pytest.mark.parametrize(("highest", "last"), [(101.0, 101), (102.9, 101), (100.0, 99)])
def test_the_highest_odd_multiple_in_the_range_is_a_line(highest, last):
    lines = odd_lines(1.0, highest, 9)
    assert (lines[0], lines[-1]) == (1, last)
    assert (lines % 2 == 1).all()


def test_a_response_is_the_deviation_from_the_operating_point(monkeypatch):
    rest, at_rest = np.array([1.0, -2.0]), np.array([7.0, -4.0, 0.5])
    D = np.array([[0.5, -2.0], [3.0, 0.25], [0.0, 1.0]])
    run = object.__new__(Runs)
    run._bench = SimpleNamespace(rest=rest)
    run.operating_point = at_rest
    monkeypatch.setattr(run, "_rewind", lambda: None)
    monkeypatch.setattr(run, "_drive", lambda inputs: at_rest + (inputs - rest) @ D.T)
    deviations = np.array([[0.0, 0.0], [0.1, -0.3]])
    (found,) = run.respond([deviations])
    np.testing.assert_allclose(found, deviations @ D.T, atol=1e-12)


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (
            lambda t: 0.01 * np.sin(600 * np.pi * t),
            r"swings by 0\.02 pu at 300 Hz of the turning frame after 5 s",
        ),
        (lambda t: np.exp(-t / 20) * np.sin(600 * np.pi * t), "moves by .* give it more time"),
        (lambda t: 0.01 * t, "moves by 0.01 pu in a second after 5 s"),
    ],
)
def test_a_device_that_emits_a_line_is_told_apart_from_one_that_is_not_yet_at_rest(course, words):
    run, h = object.__new__(Runs), 1e-4
    named = SimpleNamespace(path=Path("vendor.fmu"))
    run._bench = SimpleNamespace(description=named, step_size=h, longest_wait=5.0)
    run._index = 0
    run._means = lambda outputs: outputs

    def hold(count):
        times = h * (run._index + np.arange(count))
        run._index += count
        return np.stack([course(times), 0.5 * course(times)], axis=1)

    run._hold = hold
    with pytest.raises(AnalysisError, match=words):
        run._come_to_rest()
