"""What the watch says of a signal without connection, and whole turns off the grid."""

import numpy as np
import pytest

from orchestrator.watch.seen import Seen
from orchestrator.watch.synchronism import _forget_turns_off_the_grid
from orchestrator.watch.watch import _not_finite


def test_one_look_that_is_no_number_is_told_with_its_time():
    seen = Seen(0.5 * np.arange(4), {"a.b.x": np.array([0.0, 1.0, np.nan, 2.0])}, {}, {}, {}, {})
    (found,) = _not_finite(seen)
    assert (found.time, found.component, found.variable) == (1.0, "a", "b.x")
    assert "(nan) at t = 1 s, and so in 1 of 4 looks" in found.message


def test_turns_off_the_grid_are_taken_away_from_the_moment_of_its_return():
    angles = np.array([[0.0, 0.0, 0.1, 0.1, 0.1], [0.2, 7.0, 13.0, 13.0, 13.2]])
    on = np.array([[True] * 5, [True, False, False, True, True]])
    _forget_turns_off_the_grid(angles, on)
    assert angles[1] == pytest.approx([0.2, 7.0, 13.0, 13.0 - 4 * np.pi, 13.2 - 4 * np.pi])
