"""Small blocks, factorised by size, against the dense matrix."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.linear.models import separate_blocks
from orchestrator.linear.models.separate_blocks import InverseBlocks, by_size

SIGMA = -0.3 + 5j
SIZES = (3, 1, 4, 3, 1, 2, 4)


def prepared():
    """Blocks of several sizes, in an order that hides them; the whole, its shifted places, and the parts."""
    rng = np.random.default_rng(1)
    blocks = [rng.standard_normal((size, size)) for size in SIZES]
    hidden = rng.permutation(sum(SIZES))
    P = sp.csr_array(scipy.linalg.block_diag(*blocks)[np.ix_(hidden, hidden)])
    order = by_size(P)
    P = P[order][:, order]
    at_rest = rng.integers(0, 2, sum(SIZES)).astype(float)
    return P.toarray(), at_rest, separate_blocks.separate_blocks(P.tocsc(), at_rest)


@pytest.mark.parametrize("largest", [64, 3])
@pytest.mark.parametrize("sigma", [0.7, SIGMA])
def test_both_equations_are_solved(largest, sigma, monkeypatch):
    monkeypatch.setattr(separate_blocks, "LARGEST", largest)
    P, at_rest, parts = prepared()
    factors = parts.at(sigma)
    assert isinstance(factors, InverseBlocks) == (largest >= max(SIZES))
    shifted = P - sigma * np.diag(at_rest)
    b = np.random.default_rng(2).standard_normal((len(P), 3)).astype(type(sigma))
    assert np.allclose(shifted @ factors.solve(b), b, atol=1e-10)
    assert np.allclose(shifted.conj().T @ factors.solve(b, "H"), b, atol=1e-10)


@pytest.mark.parametrize("largest", [64, 3])
def test_a_singular_block_has_no_factors(largest, monkeypatch):
    monkeypatch.setattr(separate_blocks, "LARGEST", largest)
    P = sp.csc_array(scipy.linalg.block_diag([[2.0]], [[3.0]], np.diag([2.0] * 4) + np.eye(4, k=1)))
    at_rest = np.ones(P.shape[0])
    assert separate_blocks.separate_blocks(P, at_rest).at(2.5) is not None
    assert separate_blocks.separate_blocks(P, at_rest).at(3.0) is None
