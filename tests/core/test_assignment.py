"""Partners by the least sum, against all orders and SciPy's own."""

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from orchestrator.core.assignment import least_assignment


def test_no_order_costs_less():
    cost = np.random.default_rng(1).uniform(0, 1, (5, 5))
    cost[2] = 0.0  # a pair that costs nothing is a pair
    rows, columns = least_assignment(cost)
    least = min(cost[range(5), order].sum() for order in permutations(range(5)))
    assert rows.tolist() == list(range(5))
    assert cost[rows, columns].sum() == pytest.approx(least, abs=1e-15)


@pytest.mark.parametrize("shape", [(3, 7), (7, 3), (1, 1)])
def test_each_of_the_fewer_has_its_partner(shape):
    cost = np.random.default_rng(2).standard_normal(shape)
    for mine, theirs in zip(least_assignment(cost), linear_sum_assignment(cost), strict=True):
        assert sorted(mine) == sorted(theirs)
    mine, theirs = (
        dict(zip(*of(cost), strict=True)) for of in (least_assignment, linear_sum_assignment)
    )
    assert mine == theirs


def test_a_cost_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="finite"):
        least_assignment(np.array([[1.0, np.nan]]))
