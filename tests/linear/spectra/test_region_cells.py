"""Cells of a region: what a disc holds of one, and what is left."""

import numpy as np
import pytest

from orchestrator.linear.spectra.region_cells import RegionCell

CELL = RegionCell(2.0, 9.0, -0.1, 0.1)


def points(count=400):
    rng = np.random.default_rng(1)
    for omega, ratio in zip(
        rng.uniform(1.5, 10, count), rng.uniform(-0.12, 0.12, count), strict=True
    ):
        yield complex(-ratio / np.sqrt(1 - ratio**2) * omega, omega)


@pytest.mark.parametrize("centre", [CELL.centre, CELL.centre + 0.3, 6j])
@pytest.mark.parametrize("radius", [1.0, 2.0, 3.0])
def test_each_point_of_a_cell_is_in_the_part_that_a_disc_holds_or_beside_it(centre, radius):
    part = CELL.within(centre, radius)
    assert part is not None
    for point in points():
        assert part.holds(point) + sum(c.holds(point) for c in CELL.beside(part)) == CELL.holds(
            point
        )
        if part.holds(point):
            assert abs(point - centre) <= radius


def test_the_part_is_as_large_as_it_can_be():
    part = CELL.within(CELL.centre, 2.0)
    farthest = [max(abs(c - CELL.centre) for c in part.corners[k : k + 2]) for k in (0, 2)]
    assert farthest == pytest.approx([2.0, 2.0], rel=1e-12)
    assert CELL.within(CELL.centre, 1.0001 * CELL.radius) == CELL


@pytest.mark.parametrize(("centre", "radius"), [(5j, 0.3), (50j, 5.0)])
def test_a_disc_that_is_too_small_or_elsewhere_holds_no_part(centre, radius):
    assert CELL.within(centre, radius) is None


def test_cells_are_cut_and_joined_again():
    upper, lower = CELL.highest(1.5)
    assert (upper.high, upper.low) == (9.0, pytest.approx(6.0))
    assert lower.joined(upper) == CELL
    assert upper.joined(lower) is None
    assert lower.joined(RegionCell(upper.low, 9.0, 0.0, 0.1)) is None
    assert CELL.highest(5.0) == (CELL,)
    assert CELL.highest(4.0, 1.2) == (CELL,)  # 4.8 holds its ratio of 4.5
    assert len(CELL.highest(3.0, 1.2)) == 2
