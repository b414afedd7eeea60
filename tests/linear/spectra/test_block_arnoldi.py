"""Arnoldi's method with many vectors at once, against the method with one and dense matrices; and what could make it
miss a mode."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models import hub_elimination, linear_model
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import critical_modes
from orchestrator.linear.spectra.block_arnoldi import WIDTHS, BlockArnoldi
from orchestrator.linear.spectra.critical_modes import Search, find_critical_modes
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.linear.spectra.region_cells import RegionCell
from orchestrator.linear.spectra.sketch import sketch
from tests.linear.models.test_hub_elimination import UNSTABLE, system

SIZE = 260
REGION = (0.1, 2.0, 0.1)


@pytest.fixture
def in_blocks(monkeypatch):
    """Models of this size are searched as large ones are."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)


def model(*swinging, size=SIZE):
    """A dense matrix with given pairs of eigenvalues, and others that decay."""
    blocks = [[[s.real, s.imag], [-s.imag, s.real]] for s in swinging]
    A = scipy.linalg.block_diag(
        *blocks, *([[-d]] for d in np.linspace(20, 60, size - 2 * len(blocks)))
    )
    turn = np.random.default_rng(4).standard_normal((size, size))
    turn = np.eye(size) + 0.2 * turn / np.sqrt(size)
    return LinearModel.from_matrix(
        turn @ A @ np.linalg.inv(turn), tuple(f"x{k}" for k in range(size)), None
    )


def test_vectors_stay_orthogonal_where_little_of_them_is_new():
    """An operator near the identity leaves a ten-millionth of a vector as new, and the rounding of the rest."""
    rng = np.random.default_rng(1)
    near = np.eye(SIZE) + 1e-7 * rng.standard_normal((SIZE, SIZE)) / np.sqrt(SIZE)
    search = BlockArnoldi(lambda vectors: near @ vectors, SIZE, most=96)
    assert search.grow()
    known = search._basis[:, : search._done + search.width]
    assert abs(known.conj().T @ known - np.eye(known.shape[1])).max() < 1e-13


LONG, MOST_VECTORS = 3_000, 96
"""A vector's elements and a search's vectors, of which short images are taken."""


def searched(operator, **options):
    """A search that has taken all its vectors."""
    search = BlockArnoldi(operator, LONG, MOST_VECTORS, **options)
    while search.grow():
        pass
    assert search._images.shape[0] < LONG / 5
    return search


def assert_written_in_the_basis(search, operator):
    """A·V = V·H to the last digits, and no vector hides among the others."""
    done = search.count
    known = search._basis[:, : done + search.width]
    image = known @ search._image[: done + search.width, :done]
    assert np.abs(operator(known[:, :done]) - image).max() < 1e-13
    assert np.linalg.cond(known) < 4


def test_vectors_orthogonal_in_their_images_give_the_same_eigenvalues():
    values = 1 / np.concatenate([np.array([1 + 2j, 1 - 2j, 3, 3.001]), np.linspace(30, 900, 2_996)])

    def operator(x):
        return values[:, None] * x

    search = searched(operator)
    assert_written_in_the_basis(search, operator)
    assert np.abs(search.values[:4, None] - values[:4]).min(axis=0).max() < 1e-13
    assert (search.accuracy[:4] < 1e-10).all()


def test_duals_hold_nothing_of_other_values_and_the_adjoint_turns_them_into_left_vectors():
    """An operator on pairs of elements, each of which moves its partner."""
    first, second = 1 / np.array([[1, 2], *np.linspace([20, 21], [900, 901], LONG // 2 - 1)]).T

    def operator(x):
        return np.vstack([first[:, None] * x[::2] + 3 * x[1::2], second[:, None] * x[1::2]])[order]

    def adjoint(x):
        return np.vstack([first[:, None] * x[::2], second[:, None] * x[1::2] + 3 * x[::2]])[order]

    order = np.arange(LONG).reshape(2, -1).T.ravel()
    search = searched(operator)
    near, vectors = search.duals([1, 0]), search.vectors(range(20))
    assert np.abs(near.conj().T @ vectors - np.eye(20)[[1, 0]]).max() < 1e-9
    left = adjoint(adjoint(adjoint(adjoint(near))))
    rest = adjoint(left) - left * search.values[[1, 0]].conj()
    assert (np.linalg.norm(rest, axis=0) < 1e-3 * np.linalg.norm(left, axis=0)).all()


def test_an_operator_that_turns_little_out_of_a_few_directions_leaves_the_basis_whole():
    turns = np.random.default_rng(2).standard_normal((2, LONG, 6)) / np.sqrt(LONG)

    def operator(x):
        return turns[0] @ (turns[1].T @ x)

    search = searched(operator)
    assert_written_in_the_basis(search, operator)
    wanted = np.linalg.eigvals(turns[1].T @ turns[0])
    assert np.abs(search.values[:6, None] - wanted).min(axis=0).max() < 1e-12


def test_short_images_keep_the_lengths_of_what_lies_in_one_place_and_of_what_lies_everywhere():
    rng = np.random.default_rng(5)
    in_one_place = np.eye(LONG)[:, rng.choice(LONG, 40, replace=False)]
    whole = np.linalg.qr(np.hstack([in_one_place, rng.standard_normal((LONG, 40))]))[0]
    lengths = np.linalg.svd(sketch(LONG, 400) @ whole, compute_uv=False)
    assert 0.45 < lengths.min() < lengths.max() < 1.55
    assert (sketch(30, 40).toarray() == np.eye(30)).all()


def one_by_one(found, wanted):
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert abs(one.eigenvalue - other.eigenvalue) < 1e-10
        assert dict(one.participation) == pytest.approx(dict(other.participation), abs=1e-6)


@pytest.fixture(scope="module")
def whole():
    """A network with units, one of them unstable, and its modes in the region by the full spectrum."""
    given = system(planted=True)
    return given, [
        m for m in find_modes(given, *REGION[:2]) if -0.1 <= m.damping_ratio <= REGION[2]
    ]


def test_both_searches_find_the_modes_of_the_full_spectrum(whole, monkeypatch):
    full = whole[1]
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    one_by_one(find_critical_modes(system(planted=True), *REGION), full)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    assert system(planted=True).is_searched_in_blocks
    with_many = find_critical_modes(system(planted=True), *REGION)
    one_by_one(with_many, full)
    assert len(full) > 5
    assert abs(with_many[0].eigenvalue - UNSTABLE) < 1e-9


def test_the_step_map_has_the_same_modes(in_blocks, whole):
    step = LinearModel.from_matrix(scipy.linalg.expm(5e-3 * whole[0].A), whole[0].names, 5e-3)
    found = find_critical_modes(step, 0.3, 0.7, 0.1)
    one_by_one(found, [m for m in whole[1] if 0.3 <= m.frequency_hz <= 0.7])
    assert len(found) > 1


def test_a_crowd_that_is_too_large_for_the_vectors_is_cut(in_blocks, monkeypatch):
    crowd = [complex(-0.09 * w, w) for w in np.linspace(6.0, 6.6, 40)]
    monkeypatch.setattr(BlockArnoldi.__init__, "__defaults__", (10 * WIDTHS[0],))
    searched = []
    monkeypatch.setattr(
        critical_modes, "Search", lambda *given: searched.append(given[1]) or Search(*given)
    )
    found = find_critical_modes(model(*crowd), 0.94, 1.06, 0.1)
    assert sorted(m.eigenvalue.imag for m in found) == pytest.approx(
        [value.imag for value in crowd], abs=1e-10
    )
    assert len(searched) > 2  # the stretches alone


def test_both_eigenvectors_are_those_of_the_matrix(in_blocks, whole):
    search = Search(system(planted=True), UNSTABLE * 1.05)
    values = search.reaching(0.3)
    assert values is not None
    for value, left, right in search.pairs(range(len(values))):
        assert np.allclose(whole[0].A @ right, value * right, atol=1e-6)
        assert np.allclose(whole[0].A.T @ left.conj(), value * left.conj(), atol=1e-6)
    assert np.abs(values - UNSTABLE).min() < 1e-5


@pytest.mark.parametrize("apart", [0.0, 1e-7, 1e-4])
def test_equal_and_nearly_equal_modes_are_all_found_with_vectors_of_their_own(in_blocks, apart):
    mode = complex(-0.2, 5.0)
    whole = model(*(mode + k * apart for k in range(4)))
    found = find_critical_modes(whole, 0.75, 0.85, 0.1)
    assert sorted(m.eigenvalue.real for m in found) == pytest.approx(
        [-0.2 + k * apart for k in range(4)], abs=1e-10
    )
    shapes = np.array([list(m.shape.values()) for m in found]).T
    assert np.linalg.matrix_rank(shapes, tol=1e-6 * np.linalg.norm(shapes)) == 4


def test_a_mode_that_is_there_more_often_than_can_be_seen_is_refused(in_blocks):
    mode = complex(-0.2, 5.0)
    most = WIDTHS[-1]
    assert len(find_critical_modes(model(*[mode] * (most - 1)), 0.79, 0.81, 0.1)) == most - 1
    with pytest.raises(AnalysisError, match="modes lie at"):
        find_critical_modes(model(*[mode] * (most + 4)), 0.79, 0.81, 0.1)


@pytest.mark.parametrize("often", [WIDTHS[0] - 1, WIDTHS[0], WIDTHS[0] + 1])
def test_modes_as_often_there_as_vectors_at_once_are_looked_for_with_more(
    often, in_blocks, monkeypatch
):
    """Four vectors show four of five equal modes, and nothing else tells that there is a fifth."""
    widths = []
    made = BlockArnoldi.__init__
    monkeypatch.setattr(
        BlockArnoldi,
        "__init__",
        lambda self, *given, **named: widths.append(named["width"]) or made(self, *given, **named),
    )
    found = find_critical_modes(model(*[complex(-0.2, 5.0)] * often), 0.79, 0.81, 0.1)
    assert len(found) == often
    assert (WIDTHS[-1] in widths) == (often >= WIDTHS[0])


def blocks_with(values, accuracy):
    blocks = BlockArnoldi(lambda x: x, SIZE)
    blocks.values, blocks.accuracy = (
        np.array(values, dtype=complex),
        np.array(accuracy, dtype=float),
    )
    return blocks


BEYOND = [0.5] * 8


@pytest.mark.parametrize(
    ("values", "accuracy", "known"),
    [
        ([3.0, 2.0, *BEYOND], [1e-9, 1e-9, *[1e-3] * 8], True),
        # one that is wanted has not settled
        ([3.0, 2.0, *BEYOND], [1e-5, 1e-9, *[1e-3] * 8], False),
        ([3.0, 2.0, *BEYOND], [1e-9, 1e-5, *[1e-3] * 8], True),  # one that is not wanted
        ([3.0, 2.0, *BEYOND], [1e-9, 0.1, *[1e-3] * 8], False),  # nobody knows yet where it is
        ([3.0, 2.0, *BEYOND], [1e-9, 1e-9, *[0.4] * 8], True),  # half the way to the limit
        ([3.0, 2.0, *BEYOND], [1e-9, 1e-9, *[0.6] * 8], False),
        ([3.0, 2.0, *BEYOND[1:]], [1e-9, 1e-9, *[1e-3] * 7], False),  # too few beyond
        # may belong inside
        ([3.0, 2.0, 0.95, *BEYOND[1:]], [1e-9, 1e-9, 0.04, *[1e-3] * 7], False),
    ],
)
def test_a_disc_is_known_only_where_all_that_matters_has_settled(values, accuracy, known):
    assert blocks_with(values, accuracy).knows_all_beyond(1.0, lambda place: place == 0) is known


@pytest.mark.parametrize(("real", "known"), [(-0.51, False), (-0.6, True)])
def test_a_rough_value_beside_the_region_may_lie_in_it(real, known, in_blocks):
    search = Search(model(complex(-0.2, 5.0)), 5j)
    beside = [1 / (complex(real, 5.0) - 5j), *(1 / (-9.0 - k) for k in range(8))]
    blocks = blocks_with(beside, [5e-3, *[1e-3] * 8])
    assert search._knows(blocks, 1.0, lambda value: value.real > -0.5) is known


@pytest.mark.parametrize(
    ("share", "least"), [(0.6, critical_modes._ENOUGH), (0.8, critical_modes._MANY)]
)
def test_a_search_goes_on_where_little_is_left_of_its_cell(share, least, in_blocks, monkeypatch):
    search = Search(model(complex(-0.2, 5.0)), 5j)
    search.reach = 0.5
    cell = RegionCell(4.0, 6.0, -0.1, 0.1)
    part = replace(cell, high=4.0 * (6.0 / 4.0) ** share)
    looks = []
    monkeypatch.setattr(
        search, "_known_part", lambda blocks, *_: looks.append(blocks.count) or part
    )
    assert search.covering(cell, 2.0) is part
    assert looks[-2] < least <= looks[-1] < 1.3 * least
    assert search.vectors_taken == looks[-1]


@pytest.mark.parametrize(
    ("shares", "looks"),
    [
        ([0.2, 0.2], 2),
        ([0.2, 0.15], 2),
        ([0.15, 0.2, 0.2], 3),  # it has grown
        ([0.05] * 4, 4),  # too little of the cell
        ([0.2, None, 0.2], 3),
        ([0.75, 0.75, 1.0], 3),  # nearly all: the rest is waited for
    ],
)
def test_a_crowd_that_more_vectors_did_not_show_is_not_waited_for(
    shares, looks, in_blocks, monkeypatch
):
    cell, seen = RegionCell(4.0, 6.0, -0.1, 0.1), []
    search = Search(model(complex(-0.2, 5.0)), 5j)
    search.reach = 0.5

    def part(blocks, *_):
        blocks._done = critical_modes._ENOUGH
        share = shares[len(seen)]
        seen.append(share)
        high = 4.0 * (6.0 / 4.0) ** (share or 0.0)
        return cell if share == 1.0 else replace(cell, high=high) if share else None

    monkeypatch.setattr(search, "_known_part", part)
    monkeypatch.setattr(critical_modes, "_grow", looking)
    search.covering(cell, 2.0)
    assert len(seen) == looks


def looking(blocks, enough):
    """Look again and again, without more vectors, at most four times."""
    return any(enough(blocks) for _ in range(4))


@pytest.mark.parametrize(
    ("high", "vectors", "ratio"),
    [(3.0, 40, 1.8), (3.0, 112, 1.5), (3.0, 176, 1.25), (2.1, 220, 1.2), (9.0, 40, 2.5)],
)
def test_stretches_get_longer_where_few_vectors_are_enough_and_shorter_in_crowds(
    high, vectors, ratio
):
    known = RegionCell(2.0, high, -0.1, 0.1)
    assert critical_modes._next_stretch(known, vectors) == pytest.approx(ratio)


def test_an_adjoint_that_is_another_systems_is_noticed(in_blocks, monkeypatch):
    mode = complex(-0.2, 5.0)
    other, search = Search(model(mode * 1.01), 5.1j), Search(model(mode), 5.1j)
    assert search.reaching(0.5) is not None
    monkeypatch.setattr(
        search,
        "_solver",
        replace(search._solver, solve_adjoint=other._solver.solve_adjoint),
    )
    with pytest.raises(AnalysisError, match="does not converge"):
        search.pairs([0])
