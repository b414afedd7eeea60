"""Which place takes part in an oscillation, in signals that hold more than one."""

import numpy as np
import pytest

from orchestrator.oscillations.detection import find_oscillations, signals_of
from orchestrator.oscillations.location import dynamic_mode
from orchestrator.oscillations.measurements import Site, made_ready


@pytest.mark.parametrize(("frequency", "place"), [(0.5, "slow"), (1.2, "fast")])
def test_the_mode_at_the_frequency_that_was_found_is_taken(frequency, place):
    t = np.arange(0, 60, 0.05)
    rest = 1e-3 * np.random.default_rng(1).standard_normal((4, len(t)))
    sites = [
        Site(name, "unit", name, 1 + 0.01 * swing, 0.1 * swing, 5 + swing + rest[2 * k], 1 + rest[2 * k + 1])
        for k, (name, swing) in enumerate(
            ((name, 0.2 * np.sin(2 * np.pi * hertz * t)) for name, hertz in (("slow", 0.5), ("fast", 1.2)))
        )
    ]
    lines = find_oscillations(signals_of(made_ready("two", t, sites)))
    found = min(lines, key=lambda line: abs(line.frequency - frequency))
    assert dynamic_mode(sites, t, found).ranking[0][0] == place
