"""Which effects of a controller on the other modes are prohibited."""

import pytest

from orchestrator.analysis.modes import Mode
from orchestrator.pod_design.guard import Surroundings, breach

LEAST = 0.05


def around(*dampings, growth=0.0):
    """Surroundings with modes at 5 rad/s of these damping ratios."""
    modes = [
        Mode(5 * complex(-z, (1 - z**2) ** 0.5), (("a.x", 1.0),), {"a.x": 1.0})
        for z in sorted(dampings)
    ]
    return Surroundings(tuple(modes), growth, None)


@pytest.mark.parametrize(
    ("before", "after", "harmed"),
    [
        ((0.10, 0.20), (0.06, 0.20), False),
        ((0.10, 0.20), (0.04, 0.20), True),
        ((0.02, 0.20), (0.02, 0.20), False),  # it was as weak before
        ((0.02, 0.20), (0.01, 0.20), True),
        ((0.02, 0.20), (0.02, 0.04), True),  # a second mode fell below, and the worst stayed
        ((0.02, 0.04), (0.03, 0.04), False),
        ((), (), False),
        ((), (0.04,), True),
    ],
)
def test_no_other_mode_may_fall_below_the_least_damping(before, after, harmed):
    text = breach(around(*before), around(*after), LEAST)
    assert (text is not None) == harmed
    assert text is None or f"has {100 * min(after):.2f} % of damping, below 5 %" in text


@pytest.mark.parametrize(
    ("before", "after", "harmed"),
    [(0.0, 0.1, True), (0.1, 0.1, False), (0.1, 0.2, True), (0.1, 0.0, False)],
)
def test_the_system_may_not_become_unstable_or_more_so(before, after, harmed):
    text = breach(around(0.2, growth=before), around(0.2, growth=after), LEAST)
    assert (text is not None) == harmed
    assert text is None or "the system becomes unstable" in text
