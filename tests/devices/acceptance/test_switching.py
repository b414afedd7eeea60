"""Runs of a relay and of what it controls, with steps of two lengths."""

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks.switching import switches_elsewhere


def run(step, first=2.0, late=0.0, level=1.0):
    """A relay that turns over every 2 s from ``first`` on, and a level that it moves, looked at once a step."""
    times = np.arange(0.0, 60.0 + step / 2, step)
    relay = np.floor((times - first - late) / 2.0 + 1.0 + 1e-9) % 2
    return np.column_stack([relay, level * np.abs((times / 2.0) % 2 - 1.0)]), step


@pytest.mark.parametrize("first", [2.0, 4.0])
def test_a_relay_that_turns_over_with_the_first_of_its_long_steps_is_the_same(first):
    assert switches_elsewhere(["relay", "level"], [(run(1.0, first), run(2.0, first))]) == ["relay"]


def test_a_level_that_differs_is_no_matter_of_moments():
    assert switches_elsewhere(["relay", "level"], [(run(0.1), run(0.2, level=1.5))]) == []


def test_another_order_of_values_is_no_matter_of_moments():
    assert switches_elsewhere(["relay", "level"], [(run(1.0), run(1.0, late=2.0))]) == []
