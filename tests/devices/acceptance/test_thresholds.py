"""Every threshold of the acceptance checks, from both sides: a defect a little above it, and one a little below."""

import re
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import points
from orchestrator.devices.acceptance.checks.subject import Use
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import Source, Variable, build
from tests.devices.acceptance.gallery.members import converter

LIMITS = Limits(seconds=10.0)
SLIGHT = (
    Variable("u", 0, "input", 0, "1"),
    Variable("y", 1, "output", unit="1"),
    Variable("k", 2, "parameter", 1, "1", variability="tunable"),
)


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    """The verdict of one check on an FMU, with its fault."""
    folder = tmp_path_factory.mktemp("slight")

    def run(source, check):
        report = check_fmu(build(source, folder), None, LIMITS, (check,), run_for=0.2)
        result = next(r for r in report.results if r.check == check)
        return result.verdict, result.fault

    return run


def slight(**defines):
    """A lag with a slight defect."""
    return Source("slight", "../slight.c", defines, SLIGHT)


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.025, ("pass", "")), (0.965, ("fail", "wrong base"))]
)
def test_a_power_is_as_asked_within_two_percent_of_the_rating(judged, factor, verdict):
    """The largest of the powers asked for is 0.71 pu of the rating."""
    assert judged(converter("slight", I_FACTOR=factor), "power_balance") == verdict


@pytest.mark.parametrize(
    ("angle", "verdict"), [(1e-7, "pass"), (3e-7, "remark"), (1.2e-4, "remark"), (1.7e-4, "fail")]
)
def test_a_current_that_moves_in_steady_state(judged, angle, verdict):
    """By seven times the angle [rad] by which the start is turned; 1e-6 pu is worth a remark, 1e-3 a fault."""
    assert judged(converter("slight", FAULT_DRIFT=angle), "steady_state")[0] == verdict


def test_a_start_that_fits_at_one_angle_alone_is_no_steady_state(judged):
    """At an angle of 0 it is exact; by 0.4 rad the angle behind its impedance is wrong by 0.01 rad."""
    assert judged(converter("slight", FAULT_SMALL_ANGLE=1), "steady_state") == (
        "fail",
        "no steady state",
    )


@pytest.mark.parametrize(
    ("leak", "verdict"),
    [
        (0.0, ("pass", "")),
        (1e-11, ("remark", "")),
        (4e-7, ("remark", "")),
        (4e-6, ("fail", "hidden state")),
    ],
)
def test_a_saved_state_is_exact_or_said_not_to_be(judged, leak, verdict):
    """What is forgotten moves the output by about ``leak`` of its range; 1e-12 is said, and 1e-6 is a fault."""
    assert judged(slight(LEAK=leak, FAULT_HIDDEN=1), "state") == verdict


@pytest.mark.parametrize(
    ("noise", "verdict"), [(1e-11, ("pass", "")), (3e-9, ("fail", "not repeatable"))]
)
def test_two_runs_are_equal_to_ten_digits(judged, noise, verdict):
    assert judged(slight(NOISE=noise), "repeatability") == verdict


@pytest.mark.parametrize("check", ["power_balance", "limits"])
def test_imported_power_that_the_file_forbids_is_not_tried_and_said(check, tmp_path):
    """P_0 is declared to be 0 or more, and its powers would be wrong below."""

    def at_least_0(text):
        return re.sub(
            rb'(name="P_0".*?<Real unit="pu")', rb'\1 min="0"', text, count=1, flags=re.DOTALL
        )

    source = replace(
        converter("gives_only", FAULT_IMPORTED_P=1.7, FAULT_IMPORTED_LIMIT=1), change=at_least_0
    )
    report = check_fmu(build(source, tmp_path), None, LIMITS, (check,), run_for=0.2)
    assert report.results[-1].verdict == "remark"
    assert "P_0 = -0.5 is outside of what the FMU declares" in report.results[-1].evidence


@pytest.mark.parametrize(("declared", "verdict"), [("1e-4", "remark"), ("4e-4", "fail")])
def test_steps_that_are_too_long_for_it_are_a_fault_where_it_declares_them(
    declared, verdict, tmp_path
):
    """What is beyond 300 µs is lost: 100 and 200 µs agree, 400 µs do not."""
    source = converter("longest_step", FAULT_LONGEST_STEP="3e-4", step_size=declared)
    report = check_fmu(
        build(source, tmp_path), None, LIMITS, ("step_invariance",), run_for=0.2, use=Use(1e-4)
    )
    assert report.results[-1].verdict == verdict
    assert "steps of 0.0001 and 0.0002 s differ by " in report.results[-1].evidence
    assert "0.0002 and 0.0004 s by " in report.results[-1].evidence


def test_the_last_digits_of_an_output_that_rests_are_no_clock():
    """As those of the power that a DLL shows: its circuit's angle is six million radians at a start at 20,000 s."""
    moving = np.linspace(0.0, 1.0, 5)
    first, late = (np.column_stack([moving, np.full(5, rest)]) for rest in (0.5, 0.5 + 5.3e-11))
    least = points._ROUNDED * np.abs(first).max(axis=0)
    assert points._differs(first, late, least) == 0
    late[3] += 2e-4
    assert points._differs(first, late, least) > points._SAME
