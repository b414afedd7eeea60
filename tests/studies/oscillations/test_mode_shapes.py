"""Which place takes part in an oscillation, in signals that hold more than one."""

import numpy as np
import pytest

from orchestrator.studies.oscillations.detection import (
    Signals,
    _describe_line,
    _is_multiple,
    find_oscillations,
    signals_of,
)
from orchestrator.studies.oscillations.location import dynamic_mode
from orchestrator.studies.oscillations.measurements import Site, made_ready


@pytest.mark.parametrize(("frequency", "place"), [(0.5, "slow"), (1.2, "fast")])
def test_the_mode_at_the_frequency_that_was_found_is_taken(frequency, place):
    t = np.arange(0, 60, 0.05)
    rest = 1e-3 * np.random.default_rng(1).standard_normal((4, len(t)))
    sites = [
        Site(
            name,
            "unit",
            name,
            1 + 0.01 * swing,
            0.1 * swing,
            5 + swing + rest[2 * k],
            1 + rest[2 * k + 1],
        )
        for k, (name, swing) in enumerate(
            (
                (name, 0.2 * np.sin(2 * np.pi * hertz * t))
                for name, hertz in (("slow", 0.5), ("fast", 1.2))
            )
        )
    ]
    lines = find_oscillations(signals_of(made_ready("two", t, sites)))
    found = min(lines, key=lambda line: abs(line.frequency - frequency))
    assert dynamic_mode(sites, t, found).ranking[0][0] == place


def test_an_oscillation_that_begins_later_is_measured_from_its_begin_on():
    t = np.arange(0, 60, 0.05)
    values = np.where(t >= 20, np.sin(2 * np.pi * 0.5 * t), 0.0)[:, None]
    found = _describe_line(Signals(t, ("x",), values), 0.5, {})
    assert found.begin == pytest.approx(20, abs=3)
    assert t[found.first] == found.begin


@pytest.mark.parametrize(
    ("hertz", "multiple"),
    [(1.0, True), (1.51, True), (0.5, False), (0.51, False), (1.25, False), (1.04, False)],
)
def test_a_multiple_is_at_least_twice_the_frequency_and_as_close_as_can_be_told(hertz, multiple):
    assert _is_multiple(hertz, 0.5, 60.0) is multiple
