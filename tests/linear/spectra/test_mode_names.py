"""Names of modes: by groups that swing against each other, each to one mode, and none in doubt."""

from functools import partial

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.mode_names import name_modes, opposition
from orchestrator.linear.spectra.modes import Mode, find_modes


def mode(hertz, damping=0.05, **moving):
    """States by their participation and angle [degrees]."""
    rest = 1.0 - sum(factor for factor, _ in moving.values())
    factors = {name: factor for name, (factor, _) in moving.items()} | {"rest": rest}
    shape = {
        name: np.sqrt(factor) * np.exp(1j * np.radians(angle))
        for name, (factor, angle) in moving.items()
    }
    w = 2 * np.pi * hertz
    return Mode(complex(-damping * w, w), tuple(factors.items()), shape | {"rest": 1.0})


INTER = mode(0.63, 0.24, a=(0.03, 0), b=(0.02, 5), c=(0.14, 68), d=(0.14, 70))
"""Heavily damped: the two areas are 67 degrees apart."""
AREA_1 = mode(1.09, 0.14, a=(0.17, 0), b=(0.23, 176), c=(0.001, 100), d=(0.002, 100))
AREA_2 = mode(1.13, 0.14, a=(0.001, 0), b=(0.001, 0), c=(0.16, 0), d=(0.25, 175))
ALL = [AREA_1, AREA_2, INTER]
MEASURES = {
    "inter-area": partial(opposition, side="ab", other="cd"),
    "area 1": partial(opposition, side="a", other="b"),
    "area 2": partial(opposition, side="c", other="d"),
}


def names(modes, measures=MEASURES):
    return name_modes(modes, measures)


def test_an_inter_area_mode_less_than_90_degrees_apart_keeps_its_name():
    found = names(ALL)
    assert dict(found.named) == {"inter-area": INTER, "area 1": AREA_1, "area 2": AREA_2}
    assert found.doubts == ()


def test_a_local_mode_is_no_mode_of_two_areas():
    assert names([AREA_1, AREA_2], {"inter-area": MEASURES["inter-area"]}).named == {}
    together = mode(0.5, a=(0.2, 0), b=(0.2, 3), c=(0.2, 20), d=(0.2, 25))
    assert names([together]).named == {}


@pytest.mark.parametrize(("angle", "named"), [(44, False), (46, True), (180, True)])
def test_how_far_apart_two_groups_have_to_swing(angle, named):
    only = mode(0.5, a=(0.2, 0), b=(0.2, angle))
    assert ("x" in names([only], {"x": partial(opposition, side="a", other="b")}).named) is named


def test_a_mode_has_one_name_and_the_other_is_told():
    """The old rule gave both names to the one mode."""
    measures = {"one": MEASURES["inter-area"], "other": partial(opposition, side="c", other="a")}
    found = names(ALL, measures)
    assert dict(found.named) == {"one": INTER}
    (text,) = found.doubts
    assert text.startswith(
        "no mode is named 'other': the one that fits it best, at 0.63 Hz, is 'one'"
    )
    few = name_modes([INTER], measures)
    assert dict(few.named) == {"one": INTER}
    assert "'other'" in few.doubts[0]


def test_the_sum_decides_who_gets_a_mode_that_two_names_want():
    """'first' fits both modes, 'second' one alone: in whatever order they stand."""
    strong, weak = (
        mode(1.0, a=(0.3, 0), b=(0.3, 180), c=(0.01, 0)),
        mode(1.2, a=(0.2, 0), b=(0.2, 180), c=(0.2, 0)),
    )
    measures = {
        "first": partial(opposition, side="a", other="b"),
        "second": partial(opposition, side="c", other="b"),
    }
    for order in (measures, dict(reversed(measures.items()))):
        assert dict(names([weak, strong], order).named) == {"first": strong, "second": weak}


def test_two_modes_that_fit_alike_are_told_and_neither_is_named():
    one, two = mode(1.0, a=(0.30, 0), b=(0.30, 180)), mode(1.2, a=(0.28, 0), b=(0.28, 180))
    measure = {"x": partial(opposition, side="a", other="b")}
    found = names([one, two], measure)
    assert found.named == {}
    assert found.doubts[0].startswith(
        "no mode is named 'x': those at 1 Hz and 1.2 Hz fit it about equally"
    )
    assert found.fits["x"][0] is one
    assert found.contested == ("x",)
    clear = mode(1.2, a=(0.22, 0), b=(0.22, 180))
    assert dict(names([one, clear], measure).named) == {"x": one}


def _value_of(values, one):
    return values[id(one)]


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("columns", [1, 2, 4, 9])
def test_names_go_to_modes_so_that_no_other_way_fits_better(rows, columns):
    random = np.random.default_rng(10 * rows + columns)
    for _ in range(20):
        fit = random.random((rows, columns)) ** 3
        candidates = [mode(0.1 * (1 + k)) for k in range(columns)]
        values = [dict(zip(map(id, candidates), row.tolist(), strict=True)) for row in fit]
        measures = {str(row): partial(_value_of, values[row]) for row in range(rows)}
        best = fit[linear_sum_assignment(fit, maximize=True)]
        named = {name: one for name, (one, _) in name_modes(candidates, measures).fits.items()}
        got = [values[int(name)][id(one)] for name, one in named.items()]
        assert len({id(one) for one in named.values()}) == len(named)
        # Some names stay free because the only mode left fits much worse than their best one.
        poor = [value for value in best.tolist() if not any(np.isclose(value, got))]
        assert sum(got) + sum(poor) == pytest.approx(best.sum())


def test_no_modes_and_no_names():
    assert names([]).named == {}
    assert names(ALL, {}).named == {}


def test_the_mode_of_two_sides_is_the_one_in_which_they_swing_against_each_other():
    """Two equal masses on a wall, with a spring between: at 1 Hz they swing together, at 2 Hz against each other."""
    wall, between = (2 * np.pi) ** 2, ((4 * np.pi) ** 2 - (2 * np.pi) ** 2) / 2
    A = np.zeros((4, 4))
    A[[0, 2], [1, 3]] = 1.0
    A[[1, 3], [0, 2]] = -(wall + between)
    A[[1, 3], [2, 0]] = between
    A[[1, 3], [1, 3]] = -0.1
    A[1, 0] *= 1.001  # a little unlike, so that the modes are told apart whatever the solver does
    modes = find_modes(LinearModel.from_matrix(A, ("a.x", "a.v", "b.x", "b.v"), None), 0.1, 5.0)
    assert sorted(m.frequency_hz for m in modes) == pytest.approx([1.0, 2.0], abs=0.01)
    measure = {"x": partial(opposition, side=["a.x"], other=["b.x"])}
    found = names(modes, measure).named["x"]
    assert found.frequency_hz == pytest.approx(2.0, abs=0.01)
    assert names([m for m in modes if m is not found], measure).named == {}
