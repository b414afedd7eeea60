"""Modes followed through crossings, veering, gaps and the ends of a range, on systems with known eigenvalues."""

from itertools import pairwise

import numpy as np
import pytest

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.mode_tracking import (
    ModeSet,
    is_ambiguous,
    match,
    number_trajectories,
    similarities,
)
from orchestrator.linear.spectra.modes import find_modes

RANGE = (0.1, 2.0)


def mode_set(A, names, frequency_range=(0.0, 100.0)):
    """The modes of a matrix, sorted by damping as everywhere: the order alone says nothing."""
    modes = find_modes(LinearModel.from_matrix(A, names, None), *frequency_range)
    rows = [np.array([[getattr(m, s)[n] for n in names] for m in modes]) for s in ("left", "shape")]
    return ModeSet(
        np.array([m.eigenvalue for m in modes]),
        *(r.reshape(len(modes), len(names)) for r in rows),
        names,
    )


def oscillators(f_a, f_b, coupling=0.0, damping=(0.3, 0.2), scale=1.0):
    """Two oscillators of frequencies f_a and f_b [Hz], coupled through their positions."""
    w_a, w_b = 2 * np.pi * f_a, 2 * np.pi * f_b
    A = np.array(
        [
            [0, 1, 0, 0],
            [-(w_a**2) - coupling, -damping[0], coupling, 0],
            [0, 0, 0, 1],
            [coupling, 0, -(w_b**2) - coupling, -damping[1]],
        ]
    )
    S = np.diag([scale, 1, 1, 1 / scale])
    return mode_set(S @ A @ np.linalg.inv(S), ("a.x", "a.v", "b.x", "b.v"), RANGE)


def along(sets):
    """Follow modes along a line of points; trajectories as number → {point: frequency}."""
    points = dict(enumerate(sets))
    result = number_trajectories(points, [(k, [k - 1] if k else []) for k in points])
    found = {}
    for k, modes in points.items():
        for number, frequency in zip(result.trajectory[k], modes.frequencies, strict=True):
            found.setdefault(number, {})[k] = frequency
    return found


def test_crossing_modes_keep_their_names():
    """One rises from 0.5 to 1.5 Hz, the other falls: sorted lists would swap them at 1 Hz."""
    share = np.linspace(0, 1, 12)
    found = along([oscillators(0.5 + s, 1.5 - s) for s in share])
    assert len(found) == 2
    rising, falling = sorted(found.values(), key=lambda curve: curve[0])
    assert list(rising.values()) == pytest.approx(0.5 + share, abs=3e-3)
    assert list(falling.values()) == pytest.approx(1.5 - share, abs=3e-3)


def test_veering_modes_never_cross():
    """With a coupling and fine steps each stays above or below, and its shape goes over to the other's."""
    share = np.linspace(0, 1, 401)
    sets = [
        oscillators(0.8 + 0.4 * s, 1.2 - 0.4 * s, coupling=3.0, damping=(0.1, 0.1)) for s in share
    ]
    found = along(sets)
    assert len(found) == 2
    low, high = sorted(found.values(), key=lambda curve: curve[0])
    assert all(low[k] < high[k] for k in range(401))
    first, last = sets[0].participation(), sets[-1].participation()
    lower = [int(np.argmin(s.frequencies)) for s in (sets[0], sets[-1])]
    assert first[lower[0]][:2].sum() > 0.6  # it begins in oscillator a
    assert last[lower[1]][:2].sum() < 0.4


def test_a_step_across_the_veering_is_ambiguous_and_half_steps_resolve_it():
    def at(s):
        return oscillators(0.8 + 0.4 * s, 1.2 - 0.4 * s, coupling=3.0, damping=(0.1, 0.1))

    assert is_ambiguous(at(0.1), at(0.5), RANGE)
    assert len(match(at(0.1), at(0.5))) < 2
    steps = np.linspace(0.1, 0.5, 9)
    assert not any(is_ambiguous(at(a), at(b), RANGE) for a, b in pairwise(steps))


def test_a_mode_that_leaves_the_range_ends_and_is_not_taken_for_another():
    share = np.linspace(0, 1, 21)
    sets = [oscillators(1.5 + s, 0.5) for s in share]
    found = along(sets)
    assert len(found) == 2
    leaving, staying = sorted(found.values(), key=len)
    assert max(leaving) == 10  # 1.5 + 10/20 Hz is the last within 2 Hz
    assert len(staying) == 21
    assert not any(is_ambiguous(a, b, RANGE) for a, b in pairwise(sets))


def test_one_that_vanishes_in_the_middle_of_the_range_is_ambiguous():
    assert is_ambiguous(oscillators(1.0, 0.5), oscillators(5.0, 0.5), RANGE)


def test_similarity_knows_no_scaling_of_states_nor_of_eigenvectors():
    a, b = oscillators(0.9, 1.1, coupling=1.0), oscillators(0.95, 1.05, coupling=1.0)
    scaled = [oscillators(*f, coupling=1.0, scale=1e4) for f in ((0.9, 1.1), (0.95, 1.05))]
    assert similarities(*scaled) == pytest.approx(similarities(a, b), rel=1e-6)
    turned = ModeSet(a.eigenvalues, a.left * (3 + 4j), a.right * 1j, a.names)
    assert similarities(turned, b) == pytest.approx(similarities(a, b))
    assert similarities(a, a) == pytest.approx(np.eye(2), abs=1e-9)


def test_states_that_come_and_go_do_not_lose_the_modes():
    """A component that one point does not have counts as at rest there."""
    both = oscillators(0.5, 1.5)
    alone = mode_set(np.array([[0, 1], [-((2 * np.pi * 1.5) ** 2), -0.2]]), ("b.x", "b.v"))
    (link,) = match(both, alone)
    assert both.frequencies[link.source] == pytest.approx(1.5, abs=1e-3)


def shared(similarity):
    """Two sets of one mode each, whose product of eigenvectors is the similarity."""
    a = ModeSet(
        np.array([1j]), np.array([[1, 0]], complex), np.array([[1, 0]], complex), ("x", "y")
    )
    vector = np.array([[np.sqrt(similarity), np.sqrt(1 - similarity)]], complex)
    return a, ModeSet(np.array([1.01j]), vector, vector, ("x", "y"))


@pytest.mark.parametrize("alike", [0.35, 0.49, 0.51, 0.75])
def test_more_than_half_of_a_mode_is_the_mode(alike):
    a, b = shared(alike)
    assert similarities(a, b).item() == pytest.approx(alike)
    assert [link.similarity for link in match(a, b)] == (
        [pytest.approx(alike)] if alike > 0.5 else []
    )


@pytest.mark.parametrize(
    ("best", "other", "linked"), [(0.62, 0.30, True), (0.62, 0.34, False), (0.55, 0.2, True)]
)
def test_a_mode_with_a_rival_nearly_as_good_is_taken_for_neither(best, other, linked):
    a, _ = shared(1.0)
    vectors = np.sqrt(np.array([[best, 1 - best], [other, 1 - other]], complex))
    b = ModeSet(np.array([1.01j, 1.02j]), vectors, vectors, ("x", "y"))
    assert similarities(a, b)[0] == pytest.approx([best, other])
    assert bool(match(a, b)) == linked


def test_a_point_without_modes():
    nothing = mode_set(np.array([[-1.0]]), ("a.x",), (0.1, 2.0))
    assert match(nothing, oscillators(0.5, 1.5)) == []


def test_rows_are_linked_by_what_they_have_in_common():
    """Over two parameters a mode keeps its name from row to row, also one that enters its row late."""
    points = {
        (r, c): oscillators(0.5, 1.6 + 0.1 * r - 0.1 * c + 0.3) for r in range(3) for c in range(4)
    }
    route = [
        ((r, c), [place for place in ((r, c - 1), (r - 1, c)) if min(place) >= 0])
        for r in range(3)
        for c in range(4)
    ]
    result = number_trajectories(points, route)
    numbers = {frequency > 1: set() for frequency in (0.5, 1.5)}
    for place, modes in points.items():
        for number, frequency in zip(result.trajectory[place], modes.frequencies, strict=True):
            numbers[bool(frequency > 1)].add(number)
    assert [len(numbers[True]), len(numbers[False])] == [1, 1]
