"""Plays that are announced are made side by side, each with the bits that it has alone."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.core.errors import CosimError
from orchestrator.face.api import validation as face
from orchestrator.studies.black_box.bench import drive, drive_beside
from orchestrator.studies.validation import device as played_device
from orchestrator.studies.validation import instances
from orchestrator.studies.validation.device import Play, Played
from tests.studies.validation.test_instances import event, stranger

DROOPS = (0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3)
ROWS = (("v_re", "v_im"), ("i_re", "i_im"))


@pytest.fixture
def made(monkeypatch):
    """How many plays were made at once, call after call."""
    found = []
    run_beside = played_device.run_beside

    def counted(runs, components):
        outcomes = run_beside(runs, components)
        found.append((len(runs), len(outcomes)))
        return outcomes

    monkeypatch.setattr(played_device, "run_beside", counted)
    return found


@pytest.fixture
def opened(monkeypatch):
    found = []
    open_anew = instances.open_component

    def counted(*given, **named):
        found.append(open_anew(*given, **named))
        return found[-1]

    monkeypatch.setattr(instances, "open_component", counted)
    return found


def outcome(play):
    try:
        return play.device.play(play.recording, play.start)
    except CosimError as error:
        return str(error)


def same(one, other):
    if isinstance(one, Played) and isinstance(other, Played):
        return one.same_as(other) and one.over_limit == other.over_limit
    return one == other


def both_ways(device, plays):
    """The outcomes alone, and after they were announced."""
    with device.shelf.keeping():
        alone = [outcome(one) for one in plays]
        device.announce(plays)
        return alone, [outcome(one) for one in plays]


def plays_of(device, droops=DROOPS):
    seen = event()
    return [Play(device.with_values({"droop.R_f": x}), seen.recording, seen.start) for x in droops]


@pytest.mark.parametrize(
    ("model", "step", "count", "groups"),
    [("gfor", 1e-4, 4, [4]), ("gfor", 5e-4, 5, [5]), ("gfor_phasor", 1e-3, 11, [8])],
)
def test_they_are_the_same_to_the_last_bit(model, step, count, groups, made):
    device = face._alone(model, None, {"S_n": 100.0}, step)
    alone, beside = both_ways(device, plays_of(device, DROOPS[:count]))
    assert made == [(size, size) for size in groups]
    assert all(map(same, alone, beside))
    assert np.abs(beside[0].power - beside[-1].power).max() > 1e-4


def test_other_voltages_and_operating_points_go_side_by_side_as_well(made):
    device, seen = face._alone("gfor", None, {"S_n": 100.0}, 5e-4), event()
    deeper = [
        replace(seen.recording, voltage=seen.recording.voltage * part)
        for part in (1.0, 0.999, 0.99, 0.98)
    ]
    starts = [
        replace(seen.start, power=seen.start.power * part, voltage=seen.start.voltage * part)
        for part in (1.0, 0.999, 0.99, 0.98)
    ]
    alone, beside = both_ways(device, list(map(Play, [device] * 4, deeper, starts)))
    assert made == [(4, 4)]
    assert all(map(same, alone, beside))


def test_one_that_is_refused_says_why_and_leaves_the_others(made, opened):
    device, seen = face._alone("gfor", None, {"S_n": 100.0}, 5e-4), event()
    bad = [{"droop.R_f": -1.0}, {"droop.R_f": 0.1}, {"nothing": 1.0}, {}, {"droop.R_f": 0.2}]
    plays = [Play(device.with_values(x), seen.recording, seen.start) for x in bad]
    high = replace(seen.start, power=1e3 + 0j)
    plays.append(Play(device, seen.recording, high))
    alone, beside = both_ways(device, plays)
    assert made[0] == (6, 3)
    assert all(map(same, alone, beside))
    assert [isinstance(one, str) for one in beside] == [True, False, True, False, False, True]
    assert all(one._fmu is None for one in opened)


@pytest.mark.parametrize("wrong", [np.nan, 1e300])
def test_one_that_fails_on_its_way_answers_nothing_and_leaves_the_others(wrong):
    device = face._alone("gfor", None, {"S_n": 100.0}, 5e-4)
    start, inputs = event().start, [np.full((100, 2), (1.0, 0.01 * k)) for k in range(4)]
    inputs[2][50] = wrong
    with device.shelf.keeping(), device.shelf.side_by_side(device.description, 5) as components:
        for one in components:
            device._begin(one, device._values_at(start), start)
        *several, alone = components
        found = drive_beside(several, ROWS, inputs, 5e-4)
        expected = drive(alone, ROWS, inputs[3], 5e-4)
        late = drive_beside(several[:2], ROWS, inputs[:2], 5e-4, 100, inputs[2:])
    assert [one is None for one in found] == [False, False, True, False]
    np.testing.assert_array_equal(found[3], expected)
    assert [one is None for one in late] == [bool(np.isnan(wrong)), False]


def test_what_is_asked_for_in_another_order_or_not_at_all_is_the_same(made):
    device = face._alone("gfor_phasor", None, {"S_n": 100.0}, 1e-3)
    plays, (other,) = plays_of(device), plays_of(device, [0.07])
    with device.shelf.keeping():
        alone = {k: outcome(plays[k]) for k in (1, 5, 2, 9)}
        aside = outcome(other)
        device.announce(plays)
        assert same(outcome(plays[1]), alone[1])
        assert same(outcome(other), aside)
        assert same(outcome(plays[5]), alone[5])
        assert same(outcome(plays[2]), alone[2])
        assert same(outcome(plays[9]), alone[9])
    assert made == [(8, 8)]


def test_nothing_is_made_ahead_where_instances_are_not_kept_or_too_few_or_give_way(made, opened):
    device = face._alone("gfor_phasor", None, {"S_n": 100.0}, 1e-3)
    four = plays_of(device, DROOPS[:4])
    device.announce(four)
    outcome(four[0])
    with device.shelf.keeping():
        device.announce(four[:3])
        outcome(four[0])
        device.announce([replace(one, device=one.device.in_step) for one in four])
        outcome(replace(four[0], device=four[0].device.in_step))
    assert made == []
    assert len(opened) == 2


def test_a_strangers_fmu_is_stepped_alone(made, tmp_path):
    device, seen = stranger(tmp_path), event()
    values = [{"R_f": droop} for droop in (0.02, 0.05, 0.04, 0.03)]
    plays = [Play(device.with_values(x), seen.recording, seen.start) for x in values]
    alone, beside = both_ways(device, plays)
    assert made == []
    assert all(map(same, alone, beside))
