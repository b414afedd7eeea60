"""Tables of modes and ring-downs over the JSON of a scenario: which figure stands in which column."""

import math

import pytest

from orchestrator.output.report.mode_tables import named_modes, ring_downs
from orchestrator.output.results.mode_json import eigenvalue_json

MODE = {"real": -0.3892, "imag": 3.6551, "frequency_hz": 0.5817, "damping_percent": 10.59}
PAPERS = {"frequency_hz": 0.58, "damping_percent": 10.63}
SEEN = {"frequency_hz": 0.5821, "damping_percent": 10.41}
SCENARIO = {
    "title": "Base case",
    "modes": {"electromechanical": MODE},
    "references": {"electromechanical": PAPERS},
    "ring_down": SEEN,
    "ring_down_mode": MODE,
}


def test_a_mode_stands_before_the_papers_each_with_frequency_and_then_damping():
    table = named_modes([SCENARIO], "Paper")
    assert table.headings == [
        "Scenario",
        "Mode [rad/s]",
        "f [Hz]",
        "Damping [%]",
        "Paper: f [Hz]",
        "Damping [%]",
    ]
    assert [*map(list, table.rows)] == [
        ["Base case", "-0.3892 ± j3.6551", "0.582", "10.59", "0.58", "10.63"]
    ]


def test_a_ring_down_stands_before_the_mode_that_rings():
    table = ring_downs([SCENARIO])
    assert table.headings[1:] == [
        "f simulated [Hz]",
        "f mode [Hz]",
        "Damping simulated [%]",
        "Damping mode [%]",
    ]
    assert [*map(list, table.rows)] == [["Base case", "0.5821", "0.5817", "10.41", "10.59"]]


@pytest.mark.parametrize("without", ["ring_down", "ring_down_mode"])
def test_a_response_without_a_swing_or_its_mode_has_no_row(without):
    assert ring_downs([{**SCENARIO, without: None}]) is None


def test_an_eigenvalue_in_json_has_its_parts_its_frequency_and_its_damping():
    assert eigenvalue_json(-0.2 + 3.0j, 6.65) == {
        "real": -0.2,
        "imag": 3.0,
        "frequency_hz": 3.0 / (2 * math.pi),
        "damping_percent": 6.65,
    }
