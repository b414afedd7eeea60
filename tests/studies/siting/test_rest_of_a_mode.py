"""How a drive moves a system beside one of its modes: by sparse equations as by dense ones."""

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.studies.siting import residues

N, M, DRIVES = 30, 12, 4


@pytest.fixture
def model():
    rng = np.random.default_rng(4)
    sizes = {"F": (N, N), "G": (N, M), "H": (M, N), "K": (M, M)}
    parts = {name: 0.2 * rng.standard_normal(shape) for name, shape in sizes.items()}
    parts["K"] = np.tril(parts["K"], -1)
    return LinearModel(
        **{name: sp.csr_array(part) for name, part in parts.items()},
        names=tuple(f"c.x{k}" for k in range(N)),
        step_size=1e-3,
        disagreement=0.0,
    )


@pytest.mark.parametrize("largest_dense", [0, N])
def test_the_rest_is_what_all_other_modes_give(model, monkeypatch, largest_dense):
    monkeypatch.setattr(residues, "DENSE", largest_dense)
    values, right = np.linalg.eig(model.A)
    left = np.linalg.inv(right)
    drive = np.random.default_rng(1).standard_normal((N, DRIVES))
    k = int(np.argmax(np.abs(values.imag)))
    found = residues._through_others(model, values[k], left[k].conj(), right[:, k], drive)
    others = [i for i in range(N) if i != k]
    expected = sum(np.outer(right[:, i], left[i] @ drive) / (values[k] - values[i]) for i in others)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-10)
