"""The sparse search against the full spectrum, on systems too large for the shortcut through dense matrices."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import critical_modes
from orchestrator.linear.spectra.critical_modes import (
    find_critical_modes,
    nearest_eigenvalue,
    nearest_pairs,
)
from orchestrator.linear.spectra.modes import eigenvalues, find_modes
from orchestrator.linear.spectra.region_cells import RegionCell

RNG = np.random.default_rng(3)


def oscillators(frequencies, damping, overdamped=120):
    """A coordinate change of many oscillators and of what decays without swinging."""
    blocks = [
        [[0, 1], [-((2 * np.pi * f) ** 2), -4 * np.pi * f * z]]
        for f, z in zip(frequencies, damping, strict=True)
    ]
    A = scipy.linalg.block_diag(*blocks, *([[-d]] for d in np.linspace(0.05, 40, overdamped)))
    T = np.eye(len(A)) + 0.1 * RNG.standard_normal((len(A), len(A))) / np.sqrt(len(A))
    return T @ A @ np.linalg.inv(T)


# local modes in a crowd, two inter-area modes, one of them unstable, and one beyond each limit
FREQUENCIES = [*np.linspace(1.05, 1.15, 40), 0.31, 0.72, 0.05, 3.0]
DAMPING = [*np.linspace(0.08, 0.12, 40), -0.02, 0.05, 0.05, 0.05]
MATRIX = oscillators(FREQUENCIES, DAMPING)


def model(step_size=None):
    A = MATRIX if step_size is None else scipy.linalg.expm(MATRIX * step_size)
    return LinearModel.from_matrix(A, tuple(f"x{k}" for k in range(len(A))), step_size)


@pytest.mark.parametrize("step_size", [None, 1e-3])
def test_every_critical_mode_is_found_once_with_its_participation(step_size):
    system = model(step_size)
    found, full = find_critical_modes(system), find_modes(system)
    assert len(found) == len(full) == 42
    assert found[0].damping_ratio == pytest.approx(-0.02, abs=1e-8)
    for one, other in zip(found, full, strict=True):
        assert one.eigenvalue == pytest.approx(other.eigenvalue, abs=1e-7)
        assert dict(one.participation) == pytest.approx(dict(other.participation), abs=1e-6)


def test_a_search_from_an_eigenvalue_itself_finds_it():
    """A washout that nothing feeds is a root of the equations to the last digit."""
    A = np.diag([-0.0625, *-np.linspace(1.0, 9.0, 40)])
    system = LinearModel.from_matrix(A, tuple(f"x{k}" for k in range(len(A))), None)
    found = min(abs(value + 0.0625) for value, _, _ in nearest_pairs(system, -0.0625 + 0j, 2))
    assert found < 1e-9


def test_a_crowd_that_is_too_large_for_one_disc_is_cut(monkeypatch):
    monkeypatch.setattr(critical_modes, "_AT_A_TIME", (10, 20))
    found, full = find_critical_modes(model(), 1.0, 1.2), find_modes(model(), 1.0, 1.2)
    assert [m.eigenvalue for m in found] == pytest.approx([m.eigenvalue for m in full], abs=1e-7)


@pytest.mark.parametrize("apart", [0.0, 1e-13, 1e-11])
def test_a_mode_on_the_point_of_the_search_leaves_the_others_their_digits(apart, monkeypatch):
    points = []
    with monkeypatch.context() as seen:
        plain = critical_modes.Search
        seen.setattr(
            critical_modes,
            "Search",
            lambda *given: points.append(given[1]) or plain(*given),
        )
        find_critical_modes(model(), 0.75, 0.85)
    (point,) = points
    low, high = 2 * np.pi * 0.75, 2 * np.pi * 0.85
    modes = [*(complex(-0.05 * w, w) for w in np.linspace(4.6, 5.6, 9)), point + apart]
    blocks = [[[s.real, s.imag], [-s.imag, s.real]] for s in modes]
    A = scipy.linalg.block_diag(*blocks, *([[-d]] for d in np.linspace(20, 60, 240)))
    rng = np.random.default_rng(4)
    Q, P = (np.linalg.qr(rng.standard_normal(A.shape))[0] for _ in range(2))
    T = Q @ np.diag(np.logspace(0, 1, len(A))) @ P
    system = LinearModel.from_matrix(
        T @ A @ np.linalg.inv(T), tuple(f"x{k}" for k in range(len(A))), None
    )
    found = [mode.eigenvalue for mode in find_critical_modes(system, 0.75, 0.85)]
    wanted = [mode for mode in modes if low <= mode.imag <= high]
    assert len(found) == len(wanted) == 6
    assert max(min(abs(one - mode) for mode in found) for one in wanted) < 1e-9


def test_only_modes_below_the_damping_asked_for():
    found = find_critical_modes(model(), 0.1, 2.0, damping=0.06)
    assert [round(m.frequency_hz, 2) for m in found] == [0.31, 0.72]


def test_the_nearest_eigenvalue():
    assert nearest_eigenvalue(model(1e-3), 4.4j) == pytest.approx(
        2 * np.pi * 0.72 * complex(-0.05, np.sqrt(1 - 0.05**2)), abs=1e-6
    )


def test_equations_with_outputs_under_way_mean_their_matrix():
    n, m = 250, 12
    F, G, H = (sp.random_array(shape, density=0.02, rng=RNG) for shape in ((n, n), (n, m), (m, n)))
    K = sp.csr_array(np.tril(0.3 * RNG.standard_normal((m, m)), -1))
    system = LinearModel(
        *(sp.csr_array(x) for x in (F, G, H, K)), tuple(f"x{k}" for k in range(n)), None, 0.0
    )
    A = F.toarray() + G.toarray() @ np.linalg.solve(np.eye(m) - K.toarray(), H.toarray())
    b = RNG.standard_normal(n)
    assert np.allclose(system.A, A, atol=1e-12)
    assert np.allclose(system.apply(b), A @ b, atol=1e-12)
    solver = system.shifted(0.3 + 2j)
    shifted = A - (0.3 + 2j) * np.eye(n)
    assert np.allclose(shifted @ solver.solve(b), b, atol=1e-9)
    assert np.allclose(shifted.conj().T @ solver.solve_adjoint(b), b, atol=1e-9)
    wanted = 0.4 + 0.1j
    nearest = min(eigenvalues(system), key=lambda v: abs(v - wanted))
    assert nearest_eigenvalue(system, wanted) == pytest.approx(nearest)


@pytest.mark.parametrize(
    "arguments", [(2.0, 0.1, 0.2), (0.0, 2.0, 0.2), (0.1, 2.0, 0.0), (0.1, 2.0, 1.2)]
)
def test_a_search_over_nothing_is_refused(arguments):
    with pytest.raises(AnalysisError, match="is none"):
        find_critical_modes(model(), *arguments)


def test_equal_modes_of_equal_units_are_all_found():
    block = [[0, 1], [-((2 * np.pi * 0.8) ** 2), -4 * np.pi * 0.8 * 0.05]]
    A = scipy.linalg.block_diag(block, block, block, *([[-d]] for d in np.linspace(0.05, 40, 250)))
    T = np.linalg.qr(RNG.standard_normal((len(A), len(A))))[0]
    system = LinearModel.from_matrix(T @ A @ T.T, tuple(f"x{k}" for k in range(len(A))), None)
    assert [m.frequency_hz for m in find_critical_modes(system)] == pytest.approx(
        3 * [0.8 * np.sqrt(1 - 0.05**2)]
    )


@pytest.mark.parametrize(
    "cell",
    [
        RegionCell(1.0, 40.0, 0.02, 0.05),
        RegionCell(1.0, 1.1, -0.3, 0.4),
        RegionCell(2.0, 2.1, 0.5, 0.9),
    ],
)
def test_two_halves_of_a_cell_are_the_cell(cell):
    rng = np.random.default_rng(1)
    for omega, ratio in zip(rng.uniform(0.5, 50, 200), rng.uniform(-0.5, 0.95, 200), strict=True):
        point = complex(-ratio / np.sqrt(1 - ratio**2) * omega, omega)
        assert sum(half.holds(point) for half in cell.halves()) == cell.holds(point)
    assert all(half.radius < 0.9 * cell.radius for half in cell.halves())
