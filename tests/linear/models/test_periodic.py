"""The periodic point and the map of a period, on a linear system that is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.linear.models import periodic

A, OFFSET = np.array([[0.5, 0.3], [-0.2, 0.8]]), np.array([1.0, -2.0])


class Linear:
    """A system whose state becomes A·x + offset within a period, in two parts."""

    def __init__(self, *_):
        self.x, self.scale, self._parts = np.array([10.0, 10.0]), np.array([1.0, 4.0]), [1, 1]

    def change(self, x):
        return A @ x + OFFSET - x

    def _run(self, x, parts):
        return [x + OFFSET, A @ x + OFFSET]

    def take(self, x):
        self.x = x

    maps = periodic._Period.maps


def test_the_maps_of_a_linear_system_are_its_matrices():
    assert Linear().maps() == pytest.approx(np.array([np.eye(2), A]), abs=1e-7)


def test_newtons_method_finds_the_point_that_repeats(monkeypatch):
    for name in ("gauss_seidel", "Blocks", "steps_of_period"):
        monkeypatch.setattr(periodic, name, lambda *_, **__: None)
    monkeypatch.setattr(periodic, "_Period", Linear)
    monkeypatch.setattr(periodic, "_names_and_scales", lambda *_: (("a", "b"), None))
    master = SimpleNamespace(
        schedule=SimpleNamespace(groups=()), clock=SimpleNamespace(step_size=1e-4)
    )
    found = periodic.find_periodic_point(master, 1e-9, 5)
    assert found.x == pytest.approx(np.linalg.solve(np.eye(2) - A, OFFSET), rel=1e-5)
    assert (found.names, found.counting.any(), found.residual < 1e-9 < found.first) == (
        ("a", "b"),
        False,
        True,
    )
