"""Lines close by: how much of several signals they leave does not depend on how often a signal is there."""

import numpy as np
import pytest

from orchestrator.studies.oscillations.close_lines import _explained


@pytest.mark.parametrize("free", [True, False])
def test_what_is_left_is_that_of_one_signal(free):
    times = np.linspace(0.0, 10.0, 200)
    noise = np.random.default_rng(3).standard_normal((200, 2)) @ np.array([1.0, 1.0j])
    z = np.exp(2j * np.pi * 0.05 * times) + 0.3 * noise
    z = (z / np.linalg.norm(z))[:, None]
    once, thrice = (
        _explained(times, np.repeat(z, n, axis=1), 1.0, 2, free=free).left for n in (1, 3)
    )
    assert 0.01 < once < 0.5
    assert thrice == pytest.approx(once, rel=1e-6)
