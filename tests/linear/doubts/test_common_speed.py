"""The drift of the common speed, by two machines whose eigenvalues are known: one is told, another growth is not."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.linear.doubts.common_speed import (
    is_common_speed,
    name_common_speed,
    tell_common_speed,
)
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.stability import judge
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.answer_of_modes import of_modes
from tests.support.scenarios import prepare_one

SPEEDS = ("sg1.omega", "sg2.omega")
INERTIA = 5.0
"""H of both machines [s]."""


def told_of(verdict):
    return tell_common_speed(name_common_speed(verdict, SPEEDS))


def two_machines(synchronising, falling, apart=0.0):
    """2H·dω_i/dt = −K·(δ_i − δ_j) + d·ω_i + c·(ω_i − ω_j), where c is ``apart``."""
    omega_b, a = 2 * np.pi * 50, 1 / (2 * INERTIA)
    K, d, c = synchronising * a, falling * a, apart * a
    A = np.array(
        [
            [0, omega_b, 0, 0],
            [-K, d + c, K, -c],
            [0, 0, 0, omega_b],
            [K, -c, -K, d + c],
        ]
    )
    names = ("sg1.delta", SPEEDS[0], "sg2.delta", SPEEDS[1])
    return LinearModel.from_matrix(A, names, None)


def test_a_torque_that_falls_with_speed_is_told_as_the_common_speed():
    """Its eigenvalue is d/(2H)."""
    verdict = judge(two_machines(synchronising=1.0, falling=0.4))
    assert verdict.mode.eigenvalue == pytest.approx(0.04, rel=1e-6)
    (told,) = told_of(verdict)
    assert "+0.04 1/s is the common speed" in told


def test_machines_that_lose_each_other_are_not_told_so():
    """A negative synchronising torque: δ_1 − δ_2 grows at √(2K·ω_b/2H) at any speed, here slowly."""
    verdict = judge(two_machines(synchronising=-0.001, falling=0.0))
    rate = np.sqrt(2 * 0.001 * 2 * np.pi * 50 / (2 * INERTIA))
    assert verdict.mode.eigenvalue == pytest.approx(rate, rel=1e-6)
    assert rate < 0.5
    assert told_of(verdict) == ()


def with_governor(gate):
    """Both machines with torque that falls with speed, and the first one's gate, which follows ``gate``·ω within
    1 s but moves no torque, so that the drift stays."""
    A = np.zeros((5, 5))
    A[:4, :4] = two_machines(1.0, 0.4).A
    A[4, [1, 4]] = gate, -1.0
    return LinearModel.from_matrix(
        A, ("sg1.delta", SPEEDS[0], "sg2.delta", SPEEDS[1], "sg1.governor.gate"), None
    )


@pytest.mark.parametrize(("gate", "told"), [(-20.0, False), (-3.0, False), (0.0, True)])
def test_a_governor_that_acts_is_not_passed_over(gate, told):
    """At rest within its dead band it moves by nothing, and the drift is that without a governor."""
    verdict = judge(with_governor(gate))
    assert verdict.stable is False
    assert bool(told_of(verdict)) is told


@pytest.mark.parametrize(("synchronising", "told"), [(0.0001, False), (1.0, True)])
def test_speeds_alike_do_not_hide_angles_that_part(synchronising, told):
    """Unlike torques part the angles by Δd/2K per unit of the common speed; speeds then differ by λ/ω_b times that."""
    A = two_machines(synchronising, 0.4).A.copy()
    A[3, 3] += 0.002
    verdict = judge(
        LinearModel.from_matrix(A, ("sg1.delta", SPEEDS[0], "sg2.delta", SPEEDS[1]), None)
    )
    first, second = (verdict.mode.shape[speed].real for speed in SPEEDS)
    assert abs(first - second) < 0.02 * abs(first)
    assert bool(told_of(verdict)) is told


@pytest.mark.slow
def test_a_line_near_its_limit_is_not_told_as_a_drift():
    """At 85.6° both governors act, and the angles part by 26° while the speed moves 0.1 %."""
    ready = prepare_one("two_area", "pod_pq", {"grid.load_2.scale": 0.655})
    result = compute_modes(ready)
    assert result.stability.mode.eigenvalue == pytest.approx(0.0142, abs=1e-4)
    assert not any("common speed" in text for text in result.warnings)
    assert "common speed" not in of_modes(result).remark


@pytest.mark.slow
@pytest.mark.parametrize(("case", "scenario"), [("kundur", "manual"), ("wscc9", "base")])
def test_a_drift_without_a_governor_is_told(case, scenario):
    result = compute_modes(prepare_one(case, scenario))
    assert any("No governor acts here" in text for text in result.warnings)
    answer = of_modes(result)
    assert (answer.good, answer.verdict) == (False, "UNSTABLE")
    assert answer.remark.startswith("swings damped; the common speed drifts (+0.0")
    assert answer.remark.count("no governor") == 1
    told = result.stability.as_json()  # of Kundur's system a bus voltage once stood first
    own = dict(result.stability.mode.participation)
    speeds = sorted(told["common_speed"], key=own.get, reverse=True)
    assert told["participation"] == [{"state": name, "factor": own[name]} for name in speeds]


def test_a_verdict_names_the_speeds_and_stays_one_of_growth():
    """A swing that grows besides is not called damped."""
    verdict = name_common_speed(judge(two_machines(1.0, 0.4, apart=-1.0)), SPEEDS)
    assert verdict.sentence().startswith(
        "UNSTABLE: every swing is damped, and the common speed drifts at +0.04 1/s without a governor "
        "(sg1.omega, sg2.omega); cause: the system"
    )
    assert verdict.as_json()["stable"] is False
    assert [row["state"] for row in verdict.as_json()["participation"]] == list(SPEEDS)
    besides = replace(verdict, growing=2)
    assert not besides.only_common_speed
    assert "damped" not in besides.sentence()
    assert "2 modes grow" in besides.sentence()


def test_a_swing_that_grows_and_a_stable_system_are_silent():
    assert told_of(judge(two_machines(1.0, 0.4)))
    for falling in (-0.4, 0.0):
        assert told_of(judge(two_machines(1.0, falling))) == ()
    growing = judge(two_machines(1.0, -0.4, apart=1.6))
    assert growing.stable is False
    assert growing.mode.is_oscillation
    assert told_of(growing) == ()


def test_one_machine_has_no_common_speed():
    mode = judge(two_machines(1.0, 0.4)).mode
    assert is_common_speed(mode, SPEEDS)
    assert not is_common_speed(mode, SPEEDS[:1])
    assert not is_common_speed(mode, ("nothing.omega", *SPEEDS))
