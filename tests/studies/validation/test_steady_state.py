"""A plant that moves before the event is told from instruments that scatter."""

import numpy as np
import pytest

from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases
from tests.studies.validation.test_rated_frequency import LENGTH, recorded


def scattering(times, size):
    """White noise as its mean over a period."""
    width = max(1, round(0.02 / (times[1] - times[0])))
    random = np.random.default_rng(4)
    noise = size * random.standard_normal(len(times) + width - 1)
    return np.convolve(noise, np.ones(width) / width, "valid")


MOVEMENTS = {
    "instruments that scatter by 5 % of the rating": (0.05, lambda times: 0 * times, False),
    "good instruments": (5e-4, lambda times: 0 * times, False),
    "a swing of 2 %": (5e-4, lambda times: 0.02 * np.sin(2 * np.pi * 0.7 * times), True),
    "a fast swing of 2 %": (5e-4, lambda times: 0.02 * np.sin(2 * np.pi * 3 * times), True),
    "a drift of 3 %": (2e-3, lambda times: 0.03 * times, True),
}


@pytest.mark.parametrize("frames", [50, 1000])
@pytest.mark.parametrize("name", MOVEMENTS)
def test_noise_is_a_steady_state_and_a_swing_is_none(name, frames):
    size, movement, is_asked = MOVEMENTS[name]
    times = np.arange(round(LENGTH * frames)) / frames
    power = 0.5 + scattering(times, size) + movement(times)
    event = prepare_event(recorded(frames, power), PortBases(100.0, 50.0))
    kinds = [one.kind for one in event.questions]
    assert (QuestionKind.NO_STEADY_STATE in kinds) is is_asked
