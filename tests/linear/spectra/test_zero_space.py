"""Zeros of a system and the states in which they lie, against what was planted."""

import numpy as np
import pytest

from orchestrator.linear.doubts.examination import verdict_warnings
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import stability
from orchestrator.linear.spectra.stability import judge
from orchestrator.linear.spectra.zero_space import zero_space

OTHERS = 60


def regulators(*in_parallel):
    """Groups of integrators that see nothing but their sum, among states that decay."""
    size = sum(in_parallel) + OTHERS
    A = np.diag(-np.linspace(0.5, 50.0, size))
    first = 0
    for count in in_parallel:
        A[first : first + count, first : first + count] = -2.0
        first += count
    return LinearModel.from_matrix(A, tuple(f"c.x{k}" for k in range(size)), None)


@pytest.mark.parametrize(
    ("groups", "zeros"), [((1,), 0), ((2,), 1), ((3,), 2), ((2, 3), 3), ((20, 21), 39)]
)
def test_of_integrators_in_parallel_all_but_one_are_zeros(groups, zeros):
    found = zero_space(regulators(*groups))
    assert found.count == zeros
    partaking = {f"c.x{k}" for k in range(sum(groups))} if zeros > 1 else set()
    assert set(found.states) == partaking


@pytest.mark.parametrize(
    "whole", [pytest.param(20, marks=pytest.mark.slow), pytest.param(stability.WHOLE)]
)
def test_the_verdict_on_a_system_of_any_size_tells_its_zeros(whole, monkeypatch):
    monkeypatch.setattr(stability, "WHOLE", whole)
    verdict = judge(regulators(2, 3))
    assert verdict.stable
    assert verdict.zeros == 3
    assert "3 eigenvalues are zero" in verdict.sentence()
    assert "which lie in c.x" in verdict.sentence()
    (said,) = verdict_warnings(verdict)
    assert said in verdict.sentence()
    assert "compensation" in said
