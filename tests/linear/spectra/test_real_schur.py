"""Eigenvectors of only some eigenvalues, beside those that LAPACK's driver computes for all."""

import threading
import time

import numpy as np
import pytest
import scipy.linalg

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import modes, real_schur
from orchestrator.linear.spectra.modes import find_spectrum
from orchestrator.linear.spectra.real_schur import RealSchur, lapack


def _random(n: int, seed: int = 1) -> np.ndarray:
    """Badly scaled, with states that act on nothing, so that balancing has something to do."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-3, 3, n)
    A = rng.standard_normal((n, n)) * scale[:, None] / scale
    A[2:, :2] = 0.0
    A[1, 0] = 0.0
    return A


MATRICES = {
    "one number": np.array([[3.0]]),
    "diagonal": np.diag([1.0, -2.0, 3.0]),
    "an oscillator": np.array([[-0.3, -5.0], [5.0, -0.3]]),
    "random": _random(40),
    "zero": np.zeros((3, 3)),
    "tiny": 1e-130 * np.random.default_rng(2).standard_normal((5, 5)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_values_are_the_drivers_to_the_last_bit_and_vectors_belong_to_them(name: str) -> None:
    A = MATRICES[name]
    form = RealSchur(A)
    values, lefts, rights = scipy.linalg.eig(A, left=True, right=True)
    assert np.array_equal(form.values, values)
    # both halves of pairs, in another order than that of the columns
    chosen = list(range(len(A)))[::-2]
    for k, left, right in zip(chosen, *(side.T for side in form.vectors(chosen)), strict=True):
        assert np.allclose(
            A @ right, values[k] * right, atol=1e-9 * np.abs(A).max() * np.abs(right).max()
        )
        for own, other in ((left, lefts[:, k]), (right, rights[:, k])):
            assert abs(np.vdot(own, other)) == pytest.approx(
                np.linalg.norm(own) * np.linalg.norm(other), rel=1e-9
            )


def test_left_and_right_vectors_of_different_modes_are_orthogonal() -> None:
    form = RealSchur(_random(40))
    left, right = form.vectors(range(40))
    products = np.abs(left.conj().T @ right)
    own = np.sqrt(np.outer(products.diagonal(), products.diagonal()))
    assert np.all(products - np.diag(products.diagonal()) < 1e-8 * own)


def test_no_vector_is_none() -> None:
    left, right = RealSchur(_random(6)).vectors([])
    assert left.shape == right.shape == (6, 0)


def test_what_is_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match="infs or NaNs"):
        RealSchur(np.array([[1.0, np.nan], [0.0, 1.0]]))


def test_without_lapacks_routines_the_driver_gives_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert lapack() is not None
    A = _random(20)
    usual = RealSchur(A)
    vectors = usual.vectors([4, 7])
    monkeypatch.setattr(real_schur, "lapack", lambda: None)
    other = RealSchur(A)
    assert np.array_equal(usual.values, other.values)
    for own, driven in zip(vectors, other.vectors([4, 7]), strict=True):
        assert np.allclose(
            *(v / v[np.abs(v[:, 0]).argmax()] for v in (own, driven)), rtol=1e-8, atol=1e-12
        )


@pytest.mark.parametrize("step_size", [None, 1e-3])
def test_modes_of_a_large_system_are_those_of_a_small_one(
    step_size: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    n = 30
    rng = np.random.default_rng(3)
    A = rng.standard_normal((n, n)) - 6 * np.eye(n)
    if step_size is not None:
        A = scipy.linalg.expm(A * step_size)
        A[:, 0] = 0.0  # a multiplier 0, which is no mode, stands before all others
    model = LinearModel.from_matrix(A, tuple(f"a.{k}" for k in range(n)), step_size)
    small = find_spectrum(model, 0.05, 5.0)
    monkeypatch.setattr(modes, "ALL_VECTORS", 0)
    large = find_spectrum(model, 0.05, 5.0)
    assert len(small.modes) > 3
    assert np.array_equal(small.eigenvalues, large.eigenvalues)
    assert small.rightmost is not None
    assert large.rightmost is not None
    assert large.rightmost.eigenvalue.real == large.eigenvalues.real.max()
    assert {m.eigenvalue for m in large.modes} == {
        z for z in large.eigenvalues if 0.05 <= z.imag / (2 * np.pi) <= 5.0
    }
    for one, other in zip(
        [*small.modes, small.rightmost], [*large.modes, large.rightmost], strict=True
    ):
        assert one.eigenvalue == other.eigenvalue
        assert dict(one.participation) == pytest.approx(
            dict(other.participation), rel=1e-8, abs=1e-12
        )
        assert np.allclose(
            list(one.shape.values()), list(other.shape.values()), rtol=1e-8, atol=1e-12
        )
        assert np.allclose(list(one.left.values()), list(other.left.values()), rtol=1e-8, atol=1e-9)


@pytest.mark.slow
def test_other_threads_run_meanwhile() -> None:
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    counter = threading.Thread(target=tick)
    counter.start()
    begin = time.perf_counter()
    RealSchur(_random(600))
    taken = time.perf_counter() - begin
    done.set()
    counter.join()
    inside = [t for t in ticks if t <= begin + taken]
    assert np.diff(inside).max() < 0.5 * taken
