"""How a parameter moves a margin: slopes of known margins, doubts, and what a straight line may be used for."""

import numpy as np
import pytest

from orchestrator.studies.certification.codes.bench_point import BenchResult
from orchestrator.studies.certification.codes.change_point import (
    ChangedCriterion,
    ChangeResult,
    margins_with_time,
    mark_of,
)
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.row_verdict import RowVerdict, judge_row
from orchestrator.studies.certification.codes.sensitivity import MOST, sensitivity_of
from orchestrator.studies.sensitivities.parameters import Parameter

STEP = 0.05


def criterion(margin, name="settles", accepted=None, text="found"):
    good = margin is not None and margin >= 0 if accepted is None else accepted
    return ChangedCriterion(name, margin, good, text)


def found(margin_at, value=2.0, base="base", marks=("below", "above"), **bounds):
    """The sensitivity of a margin that is a function of the parameter."""
    p = Parameter("converter", "K", "pu", value, True, **bounds)
    sides = {
        sign: ChangeResult((criterion(margin_at(value + sign * STEP * p.scale)),), mark)
        for sign, mark in zip((-1, 1), marks, strict=True)
        if p.allows(sign * STEP * p.scale)
    }
    return sensitivity_of(p, criterion(margin_at(value)), base, sides, STEP)


@pytest.mark.parametrize("value", [2.0, -2.0])
def test_the_slope_of_a_straight_margin_is_exact_and_for_a_relative_change(value):
    s = found(lambda p: 0.3 * p - 1.0, value)
    assert s.slope == pytest.approx(0.3 * abs(value))
    assert s.per_percent == pytest.approx(0.003 * abs(value))
    assert not s.doubts


def test_a_parameter_that_is_0_is_moved_by_its_unit():
    s = found(lambda p: 0.3 * p - 1.0, 0.0)
    assert s.slope == pytest.approx(0.3)
    assert s.values == (-STEP, STEP)


def test_a_curved_margin_is_trusted_and_one_with_a_kink_or_a_jump_is_not():
    assert not found(lambda p: 1 / p - 1).doubts
    assert "not smooth: +0 points" in found(lambda p: min(p, 2.0) - 3).doubts[0]
    assert "not smooth" in found(lambda p: -abs(p - 2) - 1).doubts[0]
    assert "not smooth" in found(lambda p: -1.0 if p > 2.01 else -0.5).doubts[0]
    assert found(lambda p: min(p, 2.0) - 3).change_to_meet() is None


def test_a_margin_that_stays_is_told_from_a_response_that_stays():
    stays = found(lambda p: -0.5, marks=("base", "base"))
    assert stays.idle
    assert stays.doubts == ("no effect: the response is the same to the last bit",)
    moves = found(lambda p: -0.5)
    assert not moves.idle
    assert moves.doubts == ("no effect on this margin; the response does change",)
    # as a limit that acts on one side alone
    assert not found(lambda p: -0.5, marks=("base", "above")).idle
    assert stays.change_to_meet() is moves.change_to_meet() is None


def test_a_bound_leaves_one_side_and_a_doubt():
    s = found(lambda p: 0.3 * p - 1.0, maximum=2.0)
    assert s.slope == pytest.approx(0.6)
    assert s.doubts == ("above, its declared bound leaves no room",)
    assert (
        found(lambda p: p, minimum=2.0, maximum=2.0).reason
        == "its declared bounds leave no room on either side"
    )


def test_a_value_that_the_fmu_refuses_is_told_with_its_reason():
    p = Parameter("converter", "K", "pu", 2.0, True)
    refused = {s: ChangeResult(failure="K must be 2") for s in (-1, 1)}
    s = sensitivity_of(p, criterion(-0.5), "base", refused, STEP)
    assert s.slope is None
    assert s.reason == "below, it is refused: K must be 2; above, it is refused: K must be 2"


def test_a_run_that_ends_early_gives_no_slope_on_its_side():
    p = Parameter("converter", "K", "pu", 2.0, True)
    sides = {
        -1: ChangeResult((criterion(-0.7),), "x"),
        1: ChangeResult((criterion(None, "runs", text="it ended"),), "y"),
    }
    s = sensitivity_of(p, criterion(-0.5), "base", sides, STEP)
    assert s.slope == pytest.approx(4.0)
    assert s.doubts == ("above, it ended",)
    assert s.met == (False, None)


def test_a_side_that_meets_the_criterion_is_told():
    s = found(lambda p: 10 * (p - 2) - 0.1)
    assert s.met == (False, True)
    assert s.values_that_meet == [pytest.approx(2.1)]


def test_the_change_to_meet_goes_a_little_beyond_the_limit_and_never_far():
    near = found(lambda p: p - 2.2)
    assert near.change_to_meet() == pytest.approx(0.11)
    assert found(lambda p: -p + 1.8).change_to_meet() == pytest.approx(-0.11)
    assert found(lambda p: 0.1 * p - 5).change_to_meet() == MOST
    assert found(lambda p: p - 2.2, maximum=2.15).change_to_meet() == pytest.approx(0.055)


TIMES = np.arange(0, 11.0005, 1e-3)
ROW = next(row for row in ERCOT.rows if row.name == "phase_jumps")


def judged(findings=(), times=TIMES):
    signals = {name: np.full(times.shape, 0.5) for name in ("p", "v", "v_re", "v_im")}
    result = BenchResult(ROW.name, times, signals, list(findings))
    return judge_row(ROW, result, 60.0), result


def test_a_loss_of_synchronism_is_the_worse_the_earlier_it_comes():
    slips = [
        {"kind": "loss_of_synchronism", "time": time, "message": "slips"} for time in (8.0, 2.2)
    ]
    verdict, result = judged([{"kind": "active_limit", "time": 1.0, "message": "acts"}, *slips])
    stable = next(
        c for c in margins_with_time(verdict, result.findings, 60.0) if c.criterion == "stable"
    )
    assert stable.margin == pytest.approx(2.2 / 11 - 1)
    assert stable.timed
    verdict, result = judged()
    others = {c.criterion: c for c in margins_with_time(verdict, result.findings, 60.0)}
    assert others["stable"].margin is None
    assert others["stable"].accepted
    assert not others["opposes the jump at 1 s"].timed


def test_a_run_that_ended_is_the_worse_the_earlier_it_did():
    verdict, result = judged(times=TIMES[:3300])
    (runs,) = margins_with_time(verdict, result.findings, 60.0)
    assert runs.margin == pytest.approx(3.299 / 11 - 1, abs=1e-6)


def test_one_sample_tells_two_responses_apart():
    _, result = judged()
    mark = mark_of(result)
    assert mark_of(judged()[1]) == mark
    result.signals["v"][7] = np.nextafter(0.5, 1)
    assert mark_of(result) != mark


def test_a_row_that_was_not_judged_has_no_criteria():
    assert margins_with_time(RowVerdict(ROW, unknown="no licence"), (), 60.0) == ()
