"""Linear models as other programs take them."""

import numpy as np
import pytest

from orchestrator.face.api.linear import LinearSystem


@pytest.mark.parametrize("step", [None, 0.1])
def test_scipys_state_space_has_the_same_matrices(step):
    A, B, C, D = (
        np.arange(n * m, dtype=float).reshape(n, m) + n for n, m in ((3, 3), (3, 2), (1, 3), (1, 2))
    )
    made = LinearSystem(A, B, C, D, ("x", "y", "z"), ("u", "v"), ("w",), step).to_scipy(
        step_map=step is not None
    )
    for mine, theirs in zip((A, B, C, D), (made.A, made.B, made.C, made.D), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert made.dt == step
