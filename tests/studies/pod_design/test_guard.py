"""Which effects of a controller on the other modes are prohibited."""

import numpy as np
import pytest

from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.pod_design.guard import Surroundings, breach

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
    fallen = [z for z in after if z < LEAST and z not in before]
    assert text is None or f"has {100 * fallen[0]:.2f} % of damping" in text
    assert text is None or text.endswith("below 5 %")


def shaped(percent, hertz, place):
    """A mode in which one of two machines moves, of a damping [%]."""
    zeta, others = percent / 100, {"sg1.speed": 0.05, "sg2.speed": 0.05}
    shape = others | {f"{place}.speed": 1.0}
    eigenvalue = 2 * np.pi * hertz * complex(-zeta, (1 - zeta**2) ** 0.5)
    return Mode(eigenvalue, ((f"{place}.speed", 1.0),), shape, shape)


def test_a_mode_that_falls_while_another_rises_is_not_missed():
    """The list's least damping is the same, and so is the number below 5 %; the modes have traded their dampings."""
    before = Surroundings((shaped(2.0, 1.0, "sg1"), shaped(20.0, 1.3, "sg2")), 0.0, None)
    after = Surroundings((shaped(2.05, 1.3, "sg2"), shaped(20.0, 1.0, "sg1")), 0.0, None)
    text = breach(before, after, LEAST)
    assert text is not None
    assert "1.300 Hz (sg2.speed) has 2.05 % of damping (before: 20.00 %), below 5 %" in text
    kept = Surroundings((shaped(2.05, 1.0, "sg1"), shaped(20.0, 1.3, "sg2")), 0.0, None)
    assert breach(before, kept, LEAST) is None


@pytest.mark.parametrize(
    ("before", "after", "harmed"),
    [(0.0, 0.1, True), (0.1, 0.1, False), (0.1, 0.2, True), (0.1, 0.0, False)],
)
def test_the_system_may_not_become_unstable_or_more_so(before, after, harmed):
    text = breach(around(0.2, growth=before), around(0.2, growth=after), LEAST)
    assert (text is not None) == harmed
    assert text is None or "the system becomes unstable" in text
