"""The search beside an exhaustive grid, on systems whose modes lie close together and cross as the gain grows."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.linalg

from orchestrator.studies.coordinated_design import open_loops
from orchestrator.studies.coordinated_design.objective import Aim, RatedPoint
from orchestrator.studies.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.studies.coordinated_design.search import SettingSearch
from orchestrator.studies.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION, lead_lag_turning

PLACE = PodPlace("gfor", "pod_p")
GROUP = PodGroup("pod_p", ("gfor",), ("gfor",), 2)
LARGEST = 400.0
GRID = list(
    product(np.linspace(-120, 120, 13), np.geomspace(0.5, 4.0, 6), np.geomspace(10, LARGEST, 9))
)


def close_modes(seed, apart=0.08):
    """Two modes that lie close together, one of them hardly seen; a third one, a faster control mode, and a washout."""
    random = np.random.default_rng(seed)
    hertz = 0.9 * (1 + apart * np.array([0.0, 1.0])) * random.uniform(0.9, 1.1)
    poles = [
        (2 * np.pi * f, zeta) for f, zeta in zip(hertz, random.uniform(0.03, 0.06, 2), strict=True)
    ]
    poles += [
        (2 * np.pi * random.uniform(1.3, 1.8), random.uniform(0.06, 0.1)),
        (2 * np.pi * 3.0, 0.3),
    ]
    blocks = [w * np.array([[-z, np.sqrt(1 - z**2)], [-np.sqrt(1 - z**2), -z]]) for w, z in poles]
    A = scipy.linalg.block_diag(*blocks)
    # by the largest gain, of its size
    moved = np.repeat([0.02, 0.08, 0.04, 0.02], 2) * random.uniform(0.5, 1.5, 8)
    sizes = np.repeat([w for w, _ in poles], 2)
    U = np.sqrt(moved * sizes / LARGEST)[:, None] * random.standard_normal((8, 1))
    V = np.sqrt(moved * sizes / LARGEST)[None] * random.standard_normal((1, 8))
    # a washout of 5 s and a low-pass of 20 ms in the signal's way
    slow, fast = 1 / 5.0, 1 / 0.02
    whole = np.block(
        [
            [A, np.zeros((8, 2))],
            [V, np.array([[-slow, 0.0]])],
            [fast * V, np.array([[-fast * slow, -fast]])],
        ]
    )
    entries, exits = np.vstack([U, np.zeros((2, 1))]), np.array([[0.0] * 9 + [1.0]])
    names = tuple(f"x{k}" for k in range(10))
    return OpenLoops.of(whole, entries, exits, [PLACE], names)


def searched(loops, largest=LARGEST):
    rated = [RatedPoint(0, loops, Aim((), 0.05), {PLACE: largest})]
    return SettingSearch(SettingSpace([GROUP], (0.0, largest), 2 * np.pi * 0.93), rated)


@pytest.mark.parametrize("seed", range(5))
def test_the_search_is_not_worse_than_an_exhaustive_grid(seed):
    search = searched(close_modes(seed))
    tried = [search.tried(search._space.vector([t], [c], [k])) for t, c, k in GRID]
    best = max(one.worth.worst for one in tried if one.worth.allowed)
    without = search.tried(search._space.vector([0.0], [1.0], [0.0])).worth.worst
    found = search.best()
    assert found.worth.allowed
    assert found.worth.worst - without >= 0.98 * (best - without)


def test_a_mode_that_is_hardly_moved_counts():
    """Where one mode follows the loop well and another one hardly, the best setting of both is not that of one."""
    loops = close_modes(3)
    search = searched(loops)
    point = search._points[0]
    assert point._hardly
    assert not point._held
    found = search.best()
    values = loops.eigenvalues(search._space.setting(found.x))
    swings = [z for z in values if 0.1 < z.imag / (2 * np.pi) < 2.0]
    assert found.worth.worst == pytest.approx(min(-z.real / abs(z) for z in swings), abs=1e-12)


def test_a_mode_that_nothing_moves_is_left_as_it_is():
    """A mode of another area holds the search back no longer, and the rest gets what it gets without it."""
    alone = close_modes(1)
    w, zeta = 2 * np.pi * 1.1, 0.02
    block = np.array([[-zeta * w, w], [-w, -zeta * w]])
    whole = OpenLoops.of(
        scipy.linalg.block_diag(alone.A, block),
        np.vstack([alone.U, np.zeros((2, 1))]),
        np.hstack([alone.V, np.zeros((1, 2))]),
        [PLACE],
        (*alone.names, "y1", "y2"),
    )
    found, expected = searched(whole).best(), searched(alone).best()
    assert found.worth.worst == pytest.approx(expected.worth.worst, rel=1e-3)


def test_the_direct_term_of_a_reduced_system_has_the_right_sign(monkeypatch):
    """Many fast modes that are each hardly moved answer together as a gain at rest."""
    slow = 2 * np.pi
    A = scipy.linalg.block_diag(
        slow * np.array([[-0.05, 1.0], [-1.0, -0.05]]), -400.0 * np.eye(60) - np.diag(range(60))
    )
    U, V = np.zeros((62, 1)), np.zeros((1, 62))
    U[0, 0], V[0, 0] = 0.05, 0.05
    U[2:, 0], V[0, 2:] = 0.006, 0.006
    setting = {PLACE: PodSetting(400.0, lead_lag_turning(120.0, 8.0, 2))}
    names = tuple(f"x{k}" for k in range(62))
    whole = OpenLoops.of(A, U, V, [PLACE], names)
    monkeypatch.setattr(open_loops, "REDUCED", 5)
    reduced = OpenLoops.of(A, U, V, [PLACE], names)
    assert len(reduced.A) == 2
    found = {}
    for key, loops in {
        "whole": whole,
        "reduced": reduced,
        "wrong": replace(reduced, D=-reduced.D),
    }.items():
        values = loops.eigenvalues(setting)
        found[key] = min((z for z in values if z.imag > 1), key=lambda z: abs(z - 1j * slow))
    wrong = abs(found["wrong"] - found["whole"])
    assert wrong > 0.04
    assert abs(found["reduced"] - found["whole"]) < 0.1 * wrong


def test_what_many_modes_give_to_a_loop_stays_in_a_reduced_system(monkeypatch):
    """Each of sixty modes is moved by a hundredth of its size, and all of them together by another swing's damping."""
    swing = 2 * np.pi * 0.7 * np.array([[-0.07, 1.0], [-1.0, -0.07]])
    rates, few = np.linspace(1.0, 20.0, 60), np.linspace(25.0, 30.0, 8)
    A = scipy.linalg.block_diag(swing, np.diag(-rates), np.diag(-few))
    U = np.concatenate([[0.05, 0.05], np.sqrt(0.01 * rates / 400), np.full(8, 1e-6)])[:, None]
    names = tuple(f"x{k}" for k in range(len(A)))
    setting = {PLACE: PodSetting(400.0, lead_lag_turning(80.0, 4.4, 2))}
    expected = OpenLoops.of(A, U, U.T, [PLACE], names).eigenvalues(setting)
    target = min(expected, key=lambda z: abs(z - 4.4j))
    monkeypatch.setattr(open_loops, "REDUCED", 5)
    reduced = OpenLoops.of(A, U, U.T, [PLACE], names)
    assert len(reduced.A) == 62
    assert np.abs(reduced.eigenvalues(setting) - target).min() < 1e-6 * abs(target)
    monkeypatch.setattr(open_loops, "_FELT", 0.02)
    monkeypatch.setattr(open_loops, "_TRUE", np.inf)
    rough = OpenLoops.of(A, U, U.T, [PLACE], names)
    assert len(rough.A) == 2
    assert np.abs(rough.eigenvalues(setting) - target).min() > 1e-2 * abs(target)


@pytest.mark.parametrize(("off", "is_taken"), [(0.0, True), (1e-4, False)])
def test_a_reduction_whose_answers_are_others_is_not_taken(off, is_taken):
    loops = close_modes(0)
    found = open_loops._reduced(loops, lambda s: loops.answer(s) + off)
    assert (found is not None) is is_taken


def test_a_large_system_is_reduced_as_one_whose_vectors_are_all_computed(monkeypatch):
    whole = close_modes(0)
    monkeypatch.setattr(open_loops, "REDUCED", 5)
    monkeypatch.setattr(open_loops, "_FELT", 0.02)  # so that some are left out
    monkeypatch.setattr(open_loops, "_TRUE", np.inf)
    expected = open_loops._reduced(whole)
    monkeypatch.setattr(open_loops, "MOST_VECTORS", 0)
    monkeypatch.setattr(np.linalg, "eig", None)  # which gives the vectors of all
    found = open_loops._reduced(whole)
    assert len(found.A) == len(expected.A) < len(whole.A)
    assert found.left @ found.right == pytest.approx(np.eye(len(found.A)), abs=1e-9)
    for gain in (0.0, 90.0):
        setting = {PLACE: PodSetting(gain, lead_lag_turning(40.0, 6.0, 2))}
        one, other = (np.sort_complex(x.eigenvalues(setting)) for x in (found, expected))
        assert one == pytest.approx(other, rel=1e-8)


def test_a_signal_that_acts_on_itself_closes_as_the_algebra_says():
    """Where what a loop gives comes back at once, its gain is K/(1 − K·D)."""
    loops = close_modes(2)
    direct, gain = 5e-4, 300.0
    known = OpenLoops.of(loops.A, loops.U, loops.V, [PLACE], loops.names, np.array([[direct]]))
    closed = known.eigenvalues({PLACE: PodSetting(gain, NO_COMPENSATION)})
    expected = np.linalg.eigvals(loops.A + gain / (1 - gain * direct) * loops.U @ loops.V)
    assert np.sort_complex(closed) == pytest.approx(np.sort_complex(expected.astype(complex)))


def test_a_reduced_system_names_its_modes(monkeypatch):
    """The eigenvalues that a reduction left out have no eigenvectors, and stand behind the others."""
    monkeypatch.setattr(open_loops, "REDUCED", 5)
    monkeypatch.setattr(open_loops, "_FELT", 0.02)  # so that some are left out
    monkeypatch.setattr(open_loops, "_TRUE", np.inf)
    loops = close_modes(0)
    assert len(loops.rest)
    seen = []

    def naming(names, modes):
        seen.append(len(names))
        return {"swing": min(modes, key=lambda mode: mode.damping_ratio)}

    point = RatedPoint(0, loops, Aim(("swing",), 0.05, naming), {PLACE: LARGEST})
    plain = RatedPoint(0, loops, Aim((), 0.05), {PLACE: LARGEST})
    assert point.worth({}).worst == pytest.approx(plain.worth({}).worst)
    setting = {PLACE: PodSetting(50.0, lead_lag_turning(40.0, 6.0, 2))}
    assert 0 < point.worth(setting).worst < 1
    assert set(seen) == {10, 12}, "the states of the whole system, and two stages"
