"""A − σI in sparse equations: made once, and then only its diagonal anew, with the same bits."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.linear.models.linear_model import LinearModel


def coupled(n=12, m=5):
    """A model of few entries, a third of whose states have none on the diagonal, with outputs that travel."""
    rng = np.random.default_rng(3)
    F, G, H, K = (
        sp.csr_array(sp.random_array(shape, density=0.3, rng=rng))
        for shape in ((n, n), (n, m), (m, n), (m, m))
    )
    F = sp.lil_array(F)
    F.setdiag(np.where(np.arange(n) % 3, -np.arange(n) - 0.1, 0.0))
    names = tuple(f"c.x{k}" for k in range(n))
    return LinearModel(sp.csr_array(F), G, H, 0.1 * K, names, None, 0.0)


@pytest.fixture
def model():
    return coupled()


SHIFTS = (1j, -0.3 + 4j, 2e4j, -1.1, 0.25, 0.0)
"""The last is the diagonal's own value where there is none, and -1.1 that of a state: these entries are left out."""


@pytest.mark.parametrize("sigma", SHIFTS)
def test_they_are_those_that_are_put_together_anew(model, sigma):
    model.shifted(5j)
    found, expected = model._equations_at(sigma), model._assembled(sigma)
    expected.sum_duplicates()
    for part in ("data", "indices", "indptr"):
        assert np.array_equal(getattr(found, part), getattr(expected, part))
    assert found.dtype == expected.dtype


def test_they_are_put_together_once(model, monkeypatch):
    made = []
    whole = LinearModel._assembled
    monkeypatch.setattr(
        LinearModel, "_assembled", lambda self, sigma: made.append(sigma) or whole(self, sigma)
    )
    right = np.ones(12, dtype=complex)
    for sigma in (1j, 2j, 3 + 1j):
        found = model.shifted(sigma).solve(right)
        assert np.allclose(model.A @ found - sigma * found, right)
    assert len(made) == 1


def test_a_model_whose_entries_are_no_numbers_is_put_together_anew(model):
    model.F.data[0] = np.nan
    assert np.isnan(model._equations_at(1j).data).sum() == 1


def test_a_copy_makes_them_anew(model):
    model.shifted(1j)
    copy = pickle.loads(pickle.dumps(model))
    assert "_with_gaps" not in vars(copy)
    right = np.ones(12, dtype=complex)
    assert np.array_equal(copy.shifted(2j).solve(right), model.shifted(2j).solve(right))
