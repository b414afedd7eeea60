"""All eigenvalues with other settings of a component by one Schur form: those of each whole matrix."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.changed_spectra import ChangedSpectra
from orchestrator.linear.spectra.continuation import eigenpairs
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.linear.spectra.real_schur import RealSchur

H = 2e-3
REST, STAGES = 40, 3


def rest_over_a_step(step):
    """Damped swings of 0.2 to 8 Hz, mixed, as a continuous matrix or over a step."""
    rates = np.linspace(1.0, 50.0, REST // 2) * np.exp(1j * 1.65)
    mixed = np.eye(REST) + 0.1 * np.random.default_rng(3).standard_normal((REST, REST))
    values = np.concatenate([rates, rates.conj()])
    pairs = np.kron(np.array([[1, 1], [1j, -1j]]), np.eye(REST // 2))
    own = values if step is None else np.exp(values * step)
    return mixed @ ((pairs * own) @ np.linalg.inv(pairs)).real @ np.linalg.inv(mixed)


def system(gain, step=H, stage=0.05, rest=None):
    """Equal stages of a controller in a loop with the rest, over two wires, with a state that nothing moves."""
    n, per = REST + STAGES + 1, 1.0 if step is None else step
    A = rest_over_a_step(step) if rest is None else rest
    F = np.zeros((n, n))
    F[:REST, :REST] = A
    stages = slice(REST, REST + STAGES)
    chain = (np.eye(STAGES, k=-1) - np.eye(STAGES)) / stage
    F[stages, stages] = chain * per + (0 if step is None else np.eye(STAGES))
    F[-1, -1] = 0 if step is None else 1
    G, Hz = np.zeros((n, 2)), np.zeros((2, n))
    Hz[0, :REST] = np.linspace(-1, 1, REST)  # w0: what the controller measures
    G[REST, 0] = per / stage
    Hz[1, REST + STAGES - 1] = gain  # w1: what it gives
    K = np.array([[0.0, 0.0], [0.1 * gain, 0.0]])
    G[:REST, 1] = per * np.cos(np.arange(REST))
    names = (*(f"grid.x{k}" for k in range(REST)), *(f"pod.x{k}" for k in range(STAGES + 1)))
    F, G, Hz, K = map(sp.csr_array, (F, G, Hz, K))
    return LinearModel(
        F, G, H=Hz, K=K, names=names, step_size=step, disagreement=0.0, wires=("grid.y", "pod.u")
    )


def farthest(mine, theirs):
    return max(np.abs(theirs - value).min() / max(abs(value), 1.0) for value in mine)


@pytest.mark.parametrize("step", [None, H])
def test_values_are_those_of_each_whole_matrix(step):
    changes = ChangedSpectra(system(0.0, step), system(1.0, step))
    before = eigenvalues(system(0.0, step))
    for gain, stage in ((0.5, 0.05), (1.0, 0.05), (3.0, 0.2)):
        model = system(gain, step, stage)
        mine, theirs = changes.of(model).values, eigenvalues(model)
        assert len(mine) == len(theirs)
        assert farthest(mine, theirs) < 1e-8
        assert farthest(theirs, mine) < 1e-8
        assert farthest(theirs, before) > 0.01  # the gain moves something


def test_a_state_that_only_a_later_setting_reads_is_taken_in():
    changes = ChangedSpectra(system(0.0), system(1.0))
    changes.of(system(1.0))
    model = system(2.0)
    reads = model.H.tolil()
    reads[1, 5] = 0.7
    model = replace(model, H=sp.csr_array(reads))
    assert farthest(changes.of(model).values, eigenvalues(model)) < 1e-8


@pytest.mark.parametrize("step", [None, H])
def test_pairs_are_as_alike_as_those_of_the_whole_matrices(step):
    off, model = system(0.0, step), system(1.0, step)
    changes = ChangedSpectra(off, model)
    starts = eigenpairs(off, 0.5, 4.0)[0]
    exact = {pair.eigenvalue: pair for pair in eigenpairs(model, 0.0, np.inf)[0]}
    assert len(starts) > 5
    for start in starts:
        seen = changes.seen(start)
        (near, *_) = changes.of(model).pairs_near(start.eigenvalue, 3)
        same = min(exact, key=lambda value: abs(value - near.eigenvalue))
        assert seen.similarity(near) == pytest.approx(start.similarity(exact[same]), abs=1e-5)


def test_models_of_other_states_are_refused():
    other = system(1.0)
    other = replace(other, names=tuple(f"{name}'" for name in other.names))
    with pytest.raises(AnalysisError, match="other states or wires"):
        ChangedSpectra(system(0.0), other)


def test_a_rest_whose_modes_do_not_give_its_answer_is_refused():
    """Forty equal stages side by side share one eigenvector."""
    rest = (np.eye(REST, k=-1) - np.eye(REST)) / 0.1
    one, other = system(0.0, None, rest=rest), system(1.0, None, rest=rest)
    with pytest.raises(AnalysisError, match="rest of the system"):
        ChangedSpectra(one, other).of(other)


@pytest.mark.parametrize("size", [1.0, 1e-130])
def test_coordinates_make_a_matrix_diagonal(size):
    """A tiny one is left to LAPACK's driver."""
    rng = np.random.default_rng(4)
    scale = 10.0 ** rng.uniform(-3, 3, 30)
    A = size * rng.standard_normal((30, 30)) * scale[:, None] / scale
    A[2:, :2] = 0.0  # balancing permutes it
    form = RealSchur(A)
    at = form.coordinates()
    vectors = at.rows(np.eye(30))
    there_and_back = at.columns(np.eye(30)) @ vectors
    assert np.abs(there_and_back - np.eye(30)).max() < 1e-8
    rest = A @ vectors - vectors * form.values
    assert (
        np.abs(rest).max(axis=0) <= 1e-9 * size * np.abs(A / size @ np.abs(vectors)).max(axis=0)
    ).all()
