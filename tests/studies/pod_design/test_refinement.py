"""The search on the closed loop, on a plant whose modes move as a formula says."""

import math

import pytest

from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import LeadLag
from orchestrator.studies.pod_design.refinement import Judgement, refine
from tests.studies.pod_design.plant import NONE, Plant, gain_for


def content(placed):
    """No other mode is harmed."""
    return Judgement(placed.damping_ratio, None)


def refined(
    plant, required=0.2, filters=NONE, bounds=(0.0, 100.0), judge=content, search=lambda: []
):
    return refine(plant, plant.off, filters, required, bounds, judge, search)


def test_the_smallest_gain_that_meets_the_requirement():
    found = refined(Plant())
    assert found.met
    assert found.chosen.setting.gain == pytest.approx(gain_for(-0.4 + 4j, -0.01, 0.2), rel=0.01)
    assert 0.2 - 1e-9 <= found.chosen.damping_ratio <= 0.2004
    assert [sweep.why for sweep in found.sweeps] == ["as designed"], "nothing else is tried"


def test_a_requirement_that_the_lowest_gain_meets_takes_the_lowest():
    found = refined(Plant(), required=0.12, bounds=(50.0, 100.0))
    assert (found.met, found.chosen.setting.gain) == (True, 50.0)


def test_a_requirement_out_of_reach_gets_the_best_within_the_bounds():
    found = refined(Plant(), required=0.9)
    assert not found.met
    assert found.chosen.setting.gain == 100.0
    assert found.score == pytest.approx(1.4 / abs(-1.4 + 4j))


def test_the_gain_stops_where_another_mode_is_harmed():
    def judge(placed):
        return Judgement(
            placed.damping_ratio, "another mode grows" if placed.setting.gain > 20 else None
        )

    found = refined(Plant(), judge=judge)
    assert not found.met
    assert 18 <= found.chosen.setting.gain <= 20
    assert any("another mode grows" in note for note in found.notes)


def test_where_every_gain_harms_nothing_is_chosen():
    found = refined(
        Plant(), judge=lambda placed: Judgement(placed.damping_ratio, "another mode grows")
    )
    assert (found.met, found.chosen) == (False, None)
    assert found.best.setting.gain > 0


def test_a_mode_that_takes_the_targets_name_counts_and_is_said():
    found = refined(Plant(), judge=lambda placed: Judgement(0.05, None))
    assert (found.met, found.score) == (False, 0.05)
    assert any(
        "trades places with another mode" in note and "5.00 %" in note for note in found.notes
    )


def test_a_sensitivity_that_points_aside_is_turned_by_the_lead_lag():
    """By itself the mode moves along the imaginary axis; with a turned lead/lag it moves to the left."""
    plant = Plant(slopes=(-0.01j,))
    found = refined(plant, required=0.175, filters=LeadLag(0.0, 0.0, 2))
    assert found.met
    assert found.sweeps[0].chosen.damping_ratio < 0.15
    assert found.chosen.setting.filters.T_S1 > 0
    turned = plant.eigenvalues(found.chosen.setting)[0] - plant.modes[0]
    assert math.degrees(abs(math.atan2(turned.imag, -turned.real))) < 65


def test_where_nothing_near_meets_it_the_settings_of_a_search_are_tried():
    found = refined(Plant(), required=0.9, search=lambda: [("searched", PodSetting(60.0, NONE))])
    assert not found.met
    assert found.sweeps[-1].why == "searched"
    assert 60.0 in [point.setting.gain for point in found.sweeps[-1].points]


def test_gains_that_leave_the_system_unstable_are_listed():
    plant = Plant(modes=(-0.4 + 4j, -0.3 + 8j), slopes=(-0.01 + 0j, 0.01 + 0j))
    found = refined(plant, required=0.9)
    swept = found.sweeps[0]
    assert swept.unstable
    assert swept.unstable == tuple(
        p.setting.gain for p in (*swept.points, swept.chosen) if p.setting.gain > 30
    )


@pytest.mark.parametrize("evenly", [True, False])
def test_where_nothing_meets_it_the_least_of_all_modes_decides_if_no_mode_is_named(evenly):
    """The gain damps the target and takes from another mode; at 8.33 both have the same."""
    plant = Plant(modes=(-0.4 + 4j, -1.0 + 8j), slopes=(-0.01 + 0j, 0.004 + 0j))

    def judge(placed):
        return Judgement(
            placed.damping_ratio,
            None,
            min(-z.real / abs(z) for z in plant.eigenvalues(placed.setting)),
        )

    found = refine(
        plant,
        plant.off,
        NONE,
        0.9,
        (0.0, 100.0),
        judge,
        lambda: [("searched", PodSetting(8.33, NONE))],
        evenly=evenly,
    )
    assert not found.met
    assert found.chosen.setting.gain == pytest.approx(8.33 if evenly else 100.0)
    assert found.score == pytest.approx(found.chosen.damping_ratio)
    for sweep in found.sweeps:
        assert sweep.least == pytest.approx([judge(point).least for point in sweep.points])
        assert sweep.chosen_least == pytest.approx(judge(sweep.chosen).least)


def test_a_direction_that_brings_nothing_is_left_after_one_turn():
    plant = Plant(slopes=(-0.003 - 0.01j,))
    found = refined(plant, required=0.9, filters=LeadLag(0.2, 0.2, 1), bounds=(0.0, 50.0))
    turns = [sweep.why for sweep in found.sweeps if sweep.why.startswith("turned")]
    assert [turn for turn in turns if "+" in turn] == ["turned by +15°"]
    assert len(turns) > 2, "the other direction helps"
