"""Where outputs went, beside rows that only a compiled loop uses."""

import numpy as np
import pytest

from orchestrator.systems.coupling.tracks import Tracks


@pytest.mark.parametrize("more", [0, 3])
def test_rows_that_are_added_stand_behind_those_of_the_outputs(more):
    tracks = Tracks(2, more)
    tracks.look(np.array([1.0, -2.0]))
    assert (tracks.low.tolist(), tracks.high.tolist()) == ([1.0, -2.0], [1.0, -2.0])
    assert tracks.address(2 + more) - tracks.address(0) == 5 * 8 * (2 + more)
    assert len(tracks._whole) == 2 + more
