"""The search for growing modes on a matrix that is known."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.growth_search import find_growing_modes


def test_growing_modes_come_fastest_first():
    known = [0.2 + 9j, 1.5 + 3j, 0.7 + 40j, -0.5 + 5j]
    A = block_diag(
        *([[z.real, z.imag], [-z.imag, z.real]] for z in known), -np.diag(np.arange(1.0, 61.0))
    )
    names = tuple(f"x{k}" for k in range(len(A)))
    found = find_growing_modes(LinearModel.from_matrix(expm(0.01 * A), names, 0.01, 0.0)).modes
    assert [m.eigenvalue for m in found] == pytest.approx([known[1], known[2], known[0]])
