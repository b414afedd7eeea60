"""How a drive moves a system beside one of its modes: by sparse equations as by dense ones."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.linear.models import hub_elimination
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.studies.siting import residues
from tests.linear.models.test_hub_elimination import system as units_around_a_network

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


@pytest.mark.parametrize("is_map", [False, True])
def test_the_rest_is_the_same_by_blocks_and_a_hub(monkeypatch, is_map):
    """Units around a network: the wires that hold the mode belong to the hub."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    model = units_around_a_network()
    if is_map:  # a step of 5 ms by Euler's rule
        identity = sp.eye_array(len(model.names))
        F, G = sp.csr_array(identity + 5e-3 * model.F), sp.csr_array(5e-3 * model.G)
        model = replace(model, F=F, G=G, step_size=5e-3)
    values, left, right = scipy.linalg.eig(model.A, left=True)
    swinging = [k for k in range(len(values)) if values[k].imag > 1e-3]
    drive = np.random.default_rng(1).standard_normal((len(model.names), DRIVES))
    for k in swinging[:5]:
        given = values[k], left[:, k], right[:, k], drive
        found = residues._by_hub(model, *given)
        monkeypatch.setattr(residues, "DENSE", len(model.names))
        assert found == pytest.approx(residues._through_others(model, *given), rel=1e-7, abs=1e-9)


def test_what_does_not_swing_is_left_to_the_sparse_equations(monkeypatch):
    """Its conjugate is itself, and would be held twice."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    model = units_around_a_network()
    values, left, right = scipy.linalg.eig(model.A, left=True)
    k = int(np.flatnonzero(values.imag == 0)[0])
    drive = np.ones((len(model.names), 1))
    assert residues._by_hub(model, values[k].real, left[:, k], right[:, k], drive) is None
