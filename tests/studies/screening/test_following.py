"""Modes made from a neighbour's, and the checks that none is lost: with mistakes that are planted."""

from functools import cache

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models import hub_elimination, linear_model
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.slope_linearization import _Point, linearize_slopes
from orchestrator.linear.spectra import mode_refinement
from orchestrator.linear.spectra.critical_modes import DENSE, find_critical_modes
from orchestrator.linear.spectra.mode_refinement import RefinedModes, misses_modes, refine
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import LOCAL_HZ, find_spectrum
from orchestrator.linear.spectra.shifted_equations import ShiftedEquations, count_growing
from orchestrator.studies.modes.modes import running
from orchestrator.studies.screening.modes import CriticalRegion, find_modes_here
from tests.support.scenarios import prepare_one

REGION = CriticalRegion(0.1, 2.0, 0.2)


@cache
def system(pairs, seed=0, n=DENSE + 40):
    """A model, by itself of more states than are computed densely, with these eigenvalues and their conjugates among
    others.
    """
    rng = np.random.default_rng(seed)
    A = np.diag(-np.linspace(20.0, 3000.0, n))
    for k, value in enumerate(pairs):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [
            [value.real, value.imag],
            [-value.imag, value.real],
        ]
    turn = np.eye(n) + 0.02 * rng.standard_normal((n, n))
    return LinearModel.from_matrix(
        turn @ A @ np.linalg.inv(turn), tuple(f"c.x{k}" for k in range(n)), None
    )


KNOWN = (-0.3 + 3j, -0.4 + 5j, -0.5 + 7j, -0.2 + 7.1j, -0.9 + 9j)


def modes_of(model):
    found = find_spectrum(model, 0.1, 2.0).modes
    return ModeSet.of([mode for mode in found if mode.is_oscillation], model.names)


@cache
def modes_of_known():
    return modes_of(system(KNOWN))


def without(modes, k):
    parts = (np.delete(x, k, axis=0) for x in (modes.eigenvalues, modes.left, modes.right))
    return ModeSet(*parts, names=modes.names)


def columns(modes):
    return RefinedModes(modes.eigenvalues, modes.left.T, modes.right.T, settled=True)


def test_a_neighbours_modes_become_those_of_the_model():
    there, here = (
        modes_of_known(),
        system(tuple(value * (1.02 + 0.01j) for value in KNOWN), seed=1),
    )
    start = columns(there)
    found = refine(here, ShiftedEquations(here), start.values, start.left, start.right)
    assert found.settled
    expected = modes_of(here).eigenvalues
    assert np.sort_complex(found.values) == pytest.approx(np.sort_complex(expected), rel=1e-8)


def test_modes_that_a_fast_state_shows_enlarged_are_refined_until_they_fit():
    """An amplifier of 1 ms and a gain of 200 has 1e5 of what the vectors lack, after the values stand still."""
    fast = np.zeros((DENSE + 41, DENSE + 41))
    there, here = system(KNOWN), system(tuple(value * (1.02 + 0.01j) for value in KNOWN), seed=1)
    models = []
    for model in (there, here):
        A = fast.copy()
        A[:-1, :-1] = model.A
        A[-1, :-1], A[-1, -1] = 2e5, -1e3
        models.append(LinearModel.from_matrix(A, (*model.names, "c.amplifier"), None))
    start = columns(modes_of(models[0]))
    found = refine(models[1], ShiftedEquations(models[1]), start.values, start.left, start.right)
    assert found.settled
    expected = modes_of(models[1]).eigenvalues
    assert np.sort_complex(found.values) == pytest.approx(np.sort_complex(expected), rel=1e-8)


def test_vectors_that_never_fit_are_not_taken_for_modes(monkeypatch):
    """Planted: no round more than the values need."""
    monkeypatch.setattr("orchestrator.linear.spectra.mode_refinement._REST", 1e-18)
    model = system(KNOWN)
    start = columns(modes_of(model))
    found = refine(model, ShiftedEquations(model), start.values, start.left, start.right)
    assert not found.settled


@pytest.mark.parametrize("k", range(5))
def test_a_mode_that_is_not_known_is_found(k):
    model = system(KNOWN)
    modes, equations = modes_of(model), ShiftedEquations(model)
    assert misses_modes(equations, columns(modes), 0.2 * np.pi, 4 * np.pi, 0.2) == []
    (found,) = misses_modes(equations, columns(without(modes, k)), 0.2 * np.pi, 4 * np.pi, 0.2)
    assert found == pytest.approx(modes.eigenvalues[k], rel=1e-2)


@pytest.mark.parametrize("k", range(5))
def test_a_mode_that_is_not_known_is_found_with_many_vectors_at_once(k, monkeypatch):
    """As in a large system; what is found has more digits there."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    model = system(KNOWN, seed=2)  # whose hub nobody asked for before
    assert model.is_searched_in_blocks
    modes, equations = modes_of(model), ShiftedEquations(model)
    monkeypatch.setattr(mode_refinement, "_unknown", None)  # not one vector at a time
    assert misses_modes(equations, columns(modes), 0.2 * np.pi, 4 * np.pi, 0.2) == []
    (found,) = misses_modes(equations, columns(without(modes, k)), 0.2 * np.pi, 4 * np.pi, 0.2)
    assert found == pytest.approx(modes.eigenvalues[k], rel=1e-6)


def test_a_crowd_outside_of_the_region_is_no_end_of_the_search(monkeypatch):
    """Twelve modes of 25 % damping that nobody knows, four at most around one point: parts are searched."""
    monkeypatch.setattr(mode_refinement, "_AT_A_TIME", (2, 4))
    crowd = tuple(complex(-0.26 * w, w) for w in np.linspace(7.2, 8.9, 12))
    model = system((*KNOWN, *crowd))
    modes = modes_of(model)
    critical = np.flatnonzero(-modes.eigenvalues.real < 0.2 * np.abs(modes.eigenvalues))
    assert len(critical) == len(KNOWN)
    parts = (x[critical[1:]] for x in (modes.eigenvalues, modes.left, modes.right))
    known = columns(ModeSet(*parts, names=modes.names))
    (found,) = misses_modes(ShiftedEquations(model), known, 0.2 * np.pi, 4 * np.pi, 0.2)
    assert found == pytest.approx(modes.eigenvalues[critical[0]], rel=1e-2)


@pytest.mark.parametrize("lost", [0.2 + 4j, 0.01 + 11j, -0.05 + 0.9j])
def test_a_lost_mode_is_searched_for(lost, monkeypatch):
    """The neighbour does not have it: it came in between. Of so few states, searched for as among many."""
    for module in ("linear.spectra.critical_modes", "studies.screening.modes"):
        monkeypatch.setattr(f"orchestrator.{module}.DENSE", 100)
    before, here = modes_of(system(KNOWN, n=140)), system((*KNOWN, lost), n=140)
    found = find_modes_here(here, np.linalg.eigvals(here.A), REGION, before, count=False)
    assert found.searched
    assert np.abs(found.modes.eigenvalues - lost).min() < 1e-6
    assert found.grows == (lost.real > 0)


@pytest.mark.parametrize("most_states", [0, 4000])
def test_what_is_found_anew_is_the_same_by_a_search_and_among_all_eigenvalues(
    most_states, monkeypatch
):
    here = system((*KNOWN, 0.02 + 4j))
    monkeypatch.setattr("orchestrator.studies.screening.modes.MOST_COUNTED", most_states)
    if most_states:
        monkeypatch.setattr("orchestrator.studies.screening.modes.find_critical_modes", None)
    found = find_modes_here(here, np.linalg.eigvals(here.A), REGION, None, count=True)
    expected = find_spectrum(here, 0.1, 2.0).modes
    held = [mode.eigenvalue for mode in expected if REGION.holds(mode.eigenvalue)]
    assert len(held) == 6
    assert found.searched
    assert not found.looked_above
    critical = [found.modes.eigenvalues[k] for k in found.critical(REGION)]
    # some have the same damping, and no order of their own
    assert sorted(critical, key=np.imag) == pytest.approx(sorted(held, key=np.imag))
    assert found.growing_elsewhere == 0


@pytest.mark.parametrize(("n", "looked"), [(40, True), (220, False)])
def test_swings_above_the_range_are_looked_for_where_they_are_told_alone(n, looked, monkeypatch):
    """Planted above the range: a small system tells it, a larger one does not look for it."""
    module = "orchestrator.studies.screening.modes"
    highest = []

    def spied(model, lowest_hz, highest_hz):
        highest.append(highest_hz)
        return find_spectrum(model, lowest_hz, highest_hz)

    monkeypatch.setattr(f"{module}.find_spectrum", spied)
    if not looked:
        monkeypatch.setattr(f"{module}.is_swing", None)
    model = system((*KNOWN, -0.1 + 18j), n=n)
    found = find_modes_here(model, np.zeros(0), REGION, None, count=False, speeds=["c.x*"])
    assert found.looked_above == looked
    assert highest == [LOCAL_HZ if looked else REGION.wider.highest_hz]
    assert (found.above is not None) == looked
    assert not looked or found.above.eigenvalue == pytest.approx(-0.1 + 18j)
    # all others within the region that is wider than what is asked for
    assert len(found.modes.eigenvalues) == len(KNOWN)


@pytest.fixture
def large(monkeypatch):
    """A system whose modes are searched for as in a large one, and never among all eigenvalues."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    for name in ("MOST_COUNTED", "DENSE"):
        monkeypatch.setattr(f"orchestrator.studies.screening.modes.{name}", 0)
    monkeypatch.setattr("orchestrator.studies.screening.modes._whole", None)
    return system(KNOWN, seed=3)  # whose hub nobody asked for before


@pytest.mark.slow
def test_many_modes_of_a_large_neighbour_are_searched_anew(large, monkeypatch):
    neighbour = modes_of(large)
    monkeypatch.setattr("orchestrator.studies.screening.modes.MOST_REFINED", len(KNOWN) - 1)
    monkeypatch.setattr("orchestrator.studies.screening.modes.refine", None)
    found = find_modes_here(large, np.zeros(0), REGION, neighbour, count=False)
    assert found.searched
    critical = [found.modes.eigenvalues[k] for k in found.critical(REGION)]
    assert sorted(critical, key=np.imag) == pytest.approx(sorted(KNOWN, key=np.imag))


def test_a_mode_that_the_search_of_a_large_system_misses_is_no_verdict(large, monkeypatch):
    """Planted: the search leaves out one mode. All eigenvalues would take hours."""
    search = "orchestrator.studies.screening.modes.find_critical_modes"

    def one_less(*arguments):
        return find_critical_modes(*arguments)[1:]

    monkeypatch.setattr(search, one_less)
    with pytest.raises(AnalysisError, match=r"missed some, the first near .* narrower range"):
        find_modes_here(large, np.zeros(0), REGION, None, count=False)


def test_nothing_is_searched_where_nothing_is_lost():
    found = find_modes_here(system(KNOWN), np.zeros(0), REGION, modes_of_known(), count=False)
    assert not found.searched
    assert found.growing_elsewhere is None


@pytest.mark.parametrize("most_states", [0, 4000])
@pytest.mark.parametrize("outside", [0.5 + 80j, 3 + 0.1j, 2 + 4000j])
def test_growth_at_other_frequencies_is_counted(outside, most_states, monkeypatch):
    """A full matrix of a few states takes the way of a large sparse one, and that of a middling one."""
    monkeypatch.setattr("orchestrator.studies.screening.modes.DENSE", 0)
    monkeypatch.setattr("orchestrator.studies.screening.modes.MOST_COUNTED", most_states)
    here = system((*KNOWN, outside), n=40)
    found = find_modes_here(
        here, -np.linspace(1.0, 900.0, len(here.names)), REGION, modes_of(here), count=True
    )
    assert found.growing_elsewhere == 2
    assert found.grows
    assert found.fastest == (pytest.approx(outside, rel=1e-6) if most_states else None)


def test_growth_within_the_range_is_not_counted_twice():
    before, here = modes_of_known(), system((0.3 + 3j, *KNOWN[1:], 1 + 80j))
    found = find_modes_here(here, np.zeros(0), REGION, before, count=True)
    assert (found.modes.eigenvalues.real > 0).sum() == 1
    assert found.growing_elsewhere == 2
    assert found.slowest == 0


def test_growing_eigenvalues_are_counted():
    for seed, growing in ((0, []), (1, [0.1 + 3j]), (2, [0.1 + 3j, 0.02 + 314j, 5 + 20j])):
        model = system((*KNOWN, *growing), seed, n=40)
        alone = -np.linspace(1.0, 500.0, len(model.names))
        assert count_growing(ShiftedEquations(model), alone) == 2 * len(growing)


MIRRORED = [*KNOWN, 0.1 + 3j, -0.0045 + 6.3j]
"""The last is damped where a mode grows, and so close to that mode that both are unseen from afar."""


@pytest.mark.parametrize("known", [[], [0.1 + 3j], MIRRORED, [4 + 3j, 9 + 0.1j]])
def test_what_is_thought_to_be_known_leaves_the_count_as_it_is(known):
    growing = [0.1 + 3j, 0.006 + 6.3j]
    model, pairs = system((*KNOWN, *growing), 3, n=40), [-20 + 1j, -20 - 1j] * len(MIRRORED)
    real = -np.linspace(1.0, 500.0, len(model.names) - len(pairs))
    alone = np.concatenate([real, pairs])
    assert count_growing(ShiftedEquations(model), alone, known) == 2 * len(growing)


def test_a_pattern_that_does_not_hold_is_noticed():
    """Planted: an effect that the pattern of another operating point did not have."""
    prepared = prepare_one("two_area", "gfor")
    with running(prepared) as master:
        exchange = master.exchanges["sg1"]
        full = linearize_slopes(exchange, 0.0, 1e-4)
        description = exchange.component.description
        names = (*description.states, *exchange.inputs.names)
        point = _Point(exchange.component, names, (*description.rates, *exchange.outputs.names))
        pattern = np.vstack([np.hstack([full.A_c, full.B_c]), np.hstack([full.C, full.D])]) != 0
        slopes = point.together(pattern)
        again = np.hstack([full.A_c, full.B_c])
        assert slopes.central[: len(again)] == pytest.approx(again, rel=1e-4, abs=1e-4)
        i, k = np.argwhere(np.abs(full.A_c) > 1)[0]
        pattern[i, k] = False
        assert point.together(pattern) is None
