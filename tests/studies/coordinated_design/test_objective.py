"""The objective of a coordinated design: bands of frequencies, damping that each keeps, residues."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eig

from orchestrator.studies.coordinated_design.objective import (
    ALLOWED,
    BANDS_HZ,
    RatedPoint,
    band_of,
    floors_of,
)
from orchestrator.studies.coordinated_design.open_loops import ClosedLoop


@pytest.mark.parametrize("place", range(len(BANDS_HZ)))
def test_a_band_begins_at_its_frequency(place):
    below, above = (
        complex(-0.1, 2 * np.pi * BANDS_HZ[place] * factor) for factor in (0.999, 1.001)
    )
    assert (band_of(below), band_of(above)) == (place, place + 1)


def test_a_band_keeps_the_damping_that_it_has_where_that_is_below_the_bound():
    weak = 2 * np.pi * complex(-0.01, np.sqrt(1 - 0.01**2))  # 1 Hz, 1 %
    floors = floors_of([weak], 0.05)
    assert floors.pop(band_of(weak)) == pytest.approx(0.01 - ALLOWED)
    assert set(floors.values()) == {0.05}


def test_a_residue_is_what_a_small_gain_moves():
    rng = np.random.default_rng(3)
    A, U, V = rng.normal(size=(4, 4)), rng.normal(size=(4, 1)), rng.normal(size=(1, 4))
    values, left, right = eig(A, left=True)
    point = SimpleNamespace(loops=SimpleNamespace(U=U, V=V))
    closed = ClosedLoop(values, 4, lambda places: (left[:, places], 3 * right[:, places]))
    ((residue,),) = RatedPoint._residues(point, [0], closed)
    moved = np.linalg.eigvals(A + 1e-6 * U @ V)
    assert residue == pytest.approx(
        (moved[np.argmin(abs(moved - values[0]))] - values[0]) / 1e-6, rel=1e-4
    )
