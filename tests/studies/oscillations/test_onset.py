"""The begin of an oscillation from envelopes whose law is known."""

import numpy as np
import pytest

from orchestrator.studies.oscillations.onset import onset_of

FREQUENCY = 0.95  # [Hz]
TIMES = np.arange(0.0, 40.0, 1 / 30)  # of a phasor measurement unit [s]
HALF = 63  # samples on each side of the middle of a window of two periods


def onset(begin, decay=None):
    """Of an oscillation that is steady at once, or with a mode beside it that decays so fast [1/s]."""
    since = TIMES - begin
    amplitude = np.where(since >= 0, 1.0 if decay is None else 1 - np.exp(-decay * since), 0.0)
    window = np.hanning(2 * HALF + 3)[1:-1]
    envelope = np.convolve(amplitude, window / window.sum(), mode="valid") + 0j
    return onset_of(TIMES, envelope, HALF, FREQUENCY)


@pytest.mark.parametrize("begin", [1.0, 2.5, 20.0, 38.0, 39.0])
def test_a_begin_within_the_first_window_a_later_one_or_the_last(begin):
    found = onset(begin)
    assert found.earliest <= begin <= found.latest
    assert found.latest - found.earliest < 2 / FREQUENCY


@pytest.mark.parametrize("begin", [5.0, 20.0])
def test_a_slow_rise_begins_where_its_law_does(begin):
    """Half of the level is there three seconds later."""
    found = onset(begin, decay=0.2)
    assert found.earliest <= begin <= found.latest
    assert found.latest - found.earliest < 3 / FREQUENCY
