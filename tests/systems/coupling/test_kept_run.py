"""A run that is kept between two looks of its observers and taken up again."""

from functools import partial

import numpy as np

from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.run import state_of, take_up
from orchestrator.systems.coupling.schedule import gauss_seidel
from tests.systems.coupling.test_master import H, oscillator


def test_where_the_outputs_went_since_the_last_look_is_taken_up():
    """Nobody looks: extremes and turns are those of the whole run, also where it went on in another process."""
    running = partial(Master, oscillator(), gauss_seidel((("a",), ("b",))), H)
    with running() as master:
        master.run(200 * H, [])
        kept = state_of(master, [], None, False, 0.0, np.zeros(2))
        half = master.tracks.saved()
        master.run(260 * H, [])
        whole = master.tracks.saved()
    with running() as master:
        take_up(master, kept)
        assert np.array_equal(master.tracks.saved(), half)
        master.run(260 * H, [])
        assert np.array_equal(master.tracks.saved(), whole)
    assert not np.array_equal(half, whole)
