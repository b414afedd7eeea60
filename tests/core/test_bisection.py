"""Halving the distance between a value at which a condition holds and one at which it fails."""

import pytest

from orchestrator.core.bisection import halve_towards


@pytest.mark.parametrize(("holds_at", "fails_at"), [(0.0, 1.0), (1.0, 0.0)])
def test_it_ends_on_both_sides_of_the_place_where_the_condition_ends(holds_at, fails_at):
    def holds(x):
        return (x < 0.3) == (holds_at < 0.3)

    last, beyond = halve_towards(holds_at, fails_at, holds, most=20)
    assert abs(last - beyond) == pytest.approx(2.0**-20)
    assert holds(last)
    assert not holds(beyond)


def test_it_ends_where_it_goes_on_no_longer():
    last, beyond = halve_towards(0.0, 1.0, lambda x: x < 0.3, goes_on=lambda a, b: b - a > 0.2)
    assert (last, beyond) == (0.25, 0.375)


def test_the_value_in_the_middle_is_rounded_before_it_is_tried():
    tried = []
    last, _ = halve_towards(
        0.0, 1.0, lambda x: not tried.append(x), most=3, rounded=lambda x: round(x, 1)
    )
    assert tried == [0.5, 0.8, 0.9]
    assert last == 0.9


def test_what_nothing_ends_is_refused():
    with pytest.raises(ValueError, match="give goes_on, or most"):
        halve_towards(0.0, 1.0, bool)
