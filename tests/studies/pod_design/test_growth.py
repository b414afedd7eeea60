"""Growth with a controller, beside what it was without: on a plant whose modes move as a formula says."""

import pytest

from orchestrator.linear.spectra.stability import judge
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.growth import growth_of
from tests.studies.pod_design.plant import NONE, Plant

SETTING = PodSetting(20.0, NONE)


def grown(mode, slope, bounds=(0.0, 100.0)):
    """Growth of a second mode that moves with the gain."""
    plant = Plant((-0.4 + 4j, mode), (-0.01, slope))
    return growth_of(plant, SETTING, judge(plant.model(SETTING)), bounds)


@pytest.mark.parametrize(
    ("slope", "words"),
    [
        (-0.001, "grows slower than without it, +0.2 1/s there; no gain from 0 to 100 pu"),
        (0.001, "grows faster than without it, +0.2 1/s there; no gain from 0 to 100 pu"),
        (-0.006, "grows slower than without it, +0.2 1/s there; with this lead/lag K = 37.5 pu"),
    ],
)
def test_growth_that_was_there_is_told_with_what_it_was(slope, words):
    found = grown(0.2 + 9j, slope)
    assert found.is_older
    assert found.with_it.real == pytest.approx(0.2 + 20 * slope)
    assert words in found.sentence()


def test_growth_that_the_controller_made_is_blamed_on_it():
    found = grown(-0.1 + 9j, 0.01)
    assert not found.is_older
    assert "UNSTABLE by the controller: the eigenvalue at +0.1 1/s (1.432 Hz" in found.sentence()
    assert "is at -0.1 1/s without it" in found.sentence()


def test_a_stable_system_has_none():
    assert grown(-0.1 + 9j, -0.01) is None
