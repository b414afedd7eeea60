"""Models on the way from one to another, and the pairs of a model whose eigenvectors are known."""

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import continuation
from orchestrator.linear.spectra.continuation import between, near_with, pairs_near
from orchestrator.linear.spectra.modes import find_spectrum

NAMES = tuple(f"a.x{k}" for k in range(6))


def sparse_model(seed):
    """A continuous model whose matrices have other zeros with each seed."""
    draw = np.random.default_rng(seed)

    def matrix(rows, columns):
        full = draw.standard_normal((rows, columns))
        return sp.csr_array(np.where(draw.random(full.shape) < 0.4, 0.0, full))

    F, G, H = matrix(6, 6), matrix(6, 3), matrix(3, 6)
    return LinearModel(F, G, H=H, K=0.3 * matrix(3, 3), names=NAMES, step_size=None, disagreement=0)


def whole(model, *, part, other):
    F, G, H, K = (
        (1 - part) * getattr(model, name).toarray() + part * getattr(other, name).toarray()
        for name in "FGHK"
    )
    return F + G @ np.linalg.solve(np.eye(3) - K, H)


@pytest.mark.parametrize("part", [-1.0, 0.0, 0.25, 0.75])
def test_a_model_on_the_way_has_both_in_parts(part):
    one, other = sparse_model(1), sparse_model(2)
    found = between(one, other)(part)
    np.testing.assert_allclose(found.A, whole(one, part=part, other=other), atol=1e-12)


def test_the_way_ends_at_the_other_model_itself():
    one, other = sparse_model(1), sparse_model(2)
    assert between(one, other)(1.0) is other


def test_known_eigenvectors_are_not_computed_again(monkeypatch):
    one, other = sparse_model(1), sparse_model(2)
    expected, near = pairs_near(one, 0j), near_with(one, find_spectrum(one))
    elsewhere = pairs_near(other, 0j)
    asked, computed = [], continuation.eigenvectors
    monkeypatch.setattr(
        continuation, "eigenvectors", lambda model: asked.append(model) or computed(model)
    )
    for found, pairs in ((near(one, 0j), expected), (near(other, 0j), elsewhere)):
        for pair, same in zip(found, pairs, strict=True):
            assert pair.eigenvalue == same.eigenvalue
            assert np.array_equal(pair.left, same.left)
            assert np.array_equal(pair.right, same.right)
    assert [model is other for model in asked] == [True]
