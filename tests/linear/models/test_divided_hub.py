"""A hub in halves against the dense matrix: units along a line, whose halves are tied by one branch."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.linear.models import divided_hub, hub_elimination, linear_model
from orchestrator.linear.models.hub_elimination import DenseHub
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import critical_modes
from orchestrator.linear.spectra.block_arnoldi import WIDTHS, BlockArnoldi
from orchestrator.linear.spectra.critical_modes import Search, find_critical_modes
from orchestrator.linear.spectra.modes import find_modes
from tests.linear.models.test_hub_elimination import STATES, UNITS, system

SIGMA = -0.3 + 5j
RANGE = (0.5, 1.0)  # Hz


def along_a_line(*, noise=0.0):
    """The voltages are those of a line of buses with an admittance to earth each, in an order that hides the line."""
    given = system()
    branches = sp.diags_array([-np.ones(UNITS - 1)] * 2, offsets=[-1, 1]).toarray()
    answers = np.linalg.inv(branches - np.diag(branches.sum(axis=1)) + 0.05 * np.eye(UNITS))
    rng = np.random.default_rng(2)
    answers = 0.02 * (answers + noise * rng.standard_normal(answers.shape))
    order = rng.permutation(UNITS)
    K = given.K.toarray()
    K[:UNITS, UNITS : 2 * UNITS] = answers[np.ix_(order, order)]
    G = given.G.toarray()
    for u in range(UNITS):  # each unit takes its own voltage alone
        G[3 * u : 3 * u + 3, (u + 1) % UNITS] = 0.0
    return LinearModel(given.F, sp.csr_array(G), given.H, sp.csr_array(K), given.names, None, 0.0)


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    monkeypatch.setattr(divided_hub, "LEAST_PART", 16)
    monkeypatch.setattr(divided_hub, "_DIRECTIONS", 12)
    monkeypatch.setattr(divided_hub, "_SPARE", 4)


def ranks(part):
    for tie in part.ties or ():
        yield tie.left.shape[1]
    for half in part.halves or ():
        yield from ranks(half)


def test_the_halves_of_a_line_have_few_ties():
    hub = along_a_line().hub.divided
    found = list(ranks(hub.whole))
    assert len(found) >= 6
    # one branch, and the network's two states
    assert max(found) <= 6


def test_solutions_are_close_and_refined_ones_are_those_of_the_matrix():
    model = along_a_line()
    shifted = model.A - SIGMA * np.eye(STATES)
    factors = model.hub.near_at(SIGMA)
    assert not isinstance(factors.port, DenseHub)
    rng = np.random.default_rng(1)
    b = rng.standard_normal((STATES, 3)) + 1j * rng.standard_normal((STATES, 3))
    for solve, matrix, close in (
        (factors.solve, shifted, 1e-5),
        (factors.solve_exactly, shifted, 1e-10),
        (factors.solve_adjoint, shifted.conj().T, 1e-5),
        (factors.solve_adjoint_exactly, shifted.conj().T, 1e-10),
    ):
        assert np.abs(matrix @ solve(b) - b).max() < close
        assert np.allclose(solve(b)[:, 1], solve(b[:, 1]), atol=1e-9)


def test_critical_modes_are_those_of_the_full_spectrum():
    model = along_a_line()
    assert model.is_searched_in_blocks
    found, full = find_critical_modes(model, *RANGE, 0.1), find_modes(model, *RANGE)
    wanted = [mode for mode in full if -0.1 <= mode.damping_ratio <= 0.1]
    assert len(found) == len(wanted) > 5
    for one, other in zip(found, wanted, strict=True):
        assert abs(one.eigenvalue - other.eigenvalue) < 1e-10
        assert dict(one.participation) == pytest.approx(dict(other.participation), abs=1e-6)


def test_ties_below_the_noise_of_perturbation_are_left_out_and_the_modes_keep_their_digits():
    model = along_a_line(noise=1e-9)
    assert model.hub.divided is not None
    full = [m for m in find_modes(model, *RANGE) if -0.1 <= m.damping_ratio <= 0.1]
    found = find_critical_modes(model, *RANGE, 0.1)
    assert [m.eigenvalue for m in found] == pytest.approx([m.eigenvalue for m in full], abs=1e-10)


def test_a_network_that_does_not_fall_into_halves_is_not_divided():
    assert system().hub.divided is None
    assert isinstance(system().hub.near_at(SIGMA).port, DenseHub)


def test_solutions_that_are_not_close_are_corrected_and_the_hub_stays_divided(monkeypatch):
    monkeypatch.setattr(hub_elimination, "_NEAR", 0.0)
    model = along_a_line()
    factors = model.hub.near_at(SIGMA)
    assert not isinstance(factors.port, DenseHub)
    shifted, b = model.A - SIGMA * np.eye(STATES), np.ones((STATES, 2), dtype=complex)
    for solve, matrix in (
        (factors.solve, shifted),
        (factors.solve_adjoint, shifted.conj().T),
    ):
        assert np.abs(matrix @ solve(b) - b).max() < 1e-10


def test_ties_of_weight_that_are_left_out_are_noticed(monkeypatch):
    monkeypatch.setattr(divided_hub, "_NEGLIGIBLE", 3e-2)
    model = along_a_line()
    assert model.hub.divided is not None
    factors = model.hub.near_at(SIGMA)
    assert isinstance(factors.port, DenseHub)
    b = np.ones((STATES, 1), dtype=complex)
    assert np.allclose(model.A @ factors.solve(b) - SIGMA * factors.solve(b), b, atol=1e-9)


def test_currents_of_one_bus_are_taken_together_and_what_no_other_says_is_kept():
    """Three buses with four, four and one current; two of the first four move the hub as the others do."""
    rng = np.random.default_rng(3)
    taker = np.array([0, 1, 0, 2, 1, 0, 1, 0, 1])
    R = rng.standard_normal((60, 9))
    R[:, 5] = 2 * R[:, 0]
    R[:, 7] = R[:, 0] - R[:, 2]
    L, common, owner = divided_hub._in_common(R, np.ones(60), taker)
    assert np.bincount(owner).tolist() == [2, 4, 1]
    assert np.abs(L @ common - R).max() < 1e-13
    noisy = R + 1e-12 * rng.standard_normal(R.shape)
    assert divided_hub._in_common(noisy, np.ones(60), taker)[1].shape == (7, 9)
    R[3, 7] += 1e-6  # far above what is left out
    L, common, _ = divided_hub._in_common(R, np.ones(60), taker)
    assert common.shape == (8, 9)
    assert np.abs(L @ common - R).max() < 1e-13


def assert_left(model, pairs):
    assert pairs
    for value, left, right in pairs:
        assert np.abs(model.A.T @ left.conj() - value * left.conj()).max() < 1e-7 * abs(left).max()
        assert np.abs(model.A @ right - value * right).max() < 1e-6 * abs(right).max()


def searched(monkeypatch):
    """A search, its model, and the vectors of each search in its adjoint equations, once there is one."""
    model = along_a_line()
    search = Search(model, 2j * np.pi * 0.75)
    assert search.reaching(0.6) is not None
    begun = []

    class Counted(BlockArnoldi):
        def __init__(self, *given, **named):
            begun.append(self)
            super().__init__(*given, **named)

    monkeypatch.setattr(critical_modes, "BlockArnoldi", Counted)
    return search, model, begun


def random_vectors(blocks, places):
    return np.random.default_rng(3).standard_normal((STATES, len(places))) + 0j


def test_left_vectors_are_found_from_the_right_ones_with_fewer_vectors(monkeypatch):
    search, model, begun = searched(monkeypatch)
    assert_left(model, search.pairs([0, 1]))
    monkeypatch.setattr(BlockArnoldi, "duals", random_vectors)
    assert_left(model, search.pairs([0, 1]))
    from_right, from_random = (adjoint.count for adjoint in begun)
    assert from_right < 0.7 * from_random


def test_left_vectors_are_found_from_a_beginning_that_tells_nothing(monkeypatch):
    search, model, _ = searched(monkeypatch)
    monkeypatch.setattr(
        BlockArnoldi, "duals", lambda blocks, places: 0 * random_vectors(blocks, places)
    )
    assert_left(model, search.pairs([0, 1]))


def test_a_search_that_leads_nowhere_begins_anew_with_random_vectors(monkeypatch):
    search, model, begun = searched(monkeypatch)
    so_many = STATES // 2  # that there is room for one power of the operator
    monkeypatch.setattr(
        BlockArnoldi, "duals", lambda blocks, places: random_vectors(blocks, range(so_many))
    )
    monkeypatch.setattr(critical_modes, "MOST", so_many)
    assert_left(model, search.pairs([0, 1]))
    assert [adjoint.width for adjoint in begun] == [so_many, WIDTHS[0]]


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("right_kind", [float, complex])
def test_a_solution_through_factors_is_scipys(kind, right_kind):
    """To the last bit, of one right side or many, of none, and of the adjoint; the right side stays as it is."""
    rng = np.random.default_rng(3)

    def drawn(kind, *shape):
        parts = rng.standard_normal((2, *shape))
        return parts[0] + 1j * parts[1] if kind is complex else parts[0]

    lu = scipy.linalg.lu_factor(drawn(kind, 30, 30))
    for columns in (0, 1, 7):
        right = drawn(right_kind, 30, columns)
        given = right.copy()
        for adjoint in (False, True):
            found = divided_hub.through_lu(lu, right, adjoint=adjoint)
            wanted = scipy.linalg.lu_solve(lu, given, trans=2 if adjoint else 0)
            assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
            assert found.tobytes() == wanted.tobytes()
            assert np.array_equal(right, given)
