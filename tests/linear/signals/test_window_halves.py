"""What a part of a signal can tell of a mode."""

import pytest

from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.linear.signals.mode_doubts import WindowPart


@pytest.mark.parametrize("amplitude", [0.01, 1.0, 100.0])
@pytest.mark.parametrize(("noise", "shown"), [(0.1, True), (100.0, None)])
def test_noise_hides_a_mode_by_its_size_beside_the_amplitude(amplitude, noise, shown):
    mode = IdentifiedMode(-0.1 + 6j, amplitude)
    assert WindowPart([mode], 10.0, 1000, noise * amplitude, True).shows(mode) is shown
