"""What is asked of a converter and not of a machine: a limit of its current, and a swing damped alike everywhere."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import evenness, ride_through, windup

TIME = np.linspace(0, 2, 400)


def limits(kind, variables=None, **answer):
    """The verdict on one answer, of a mean current of 5 pu unless said otherwise."""
    event = ride_through.Disturbance("dip", 0.3, 1.0)
    answers = [
        ride_through.Answer(
            event,
            **{
                "peak": 5.0,
                "early": 5.0,
                "mean": 5.0,
                "away": 0.0,
                "blocked": 0.0,
                "gone": False,
                **answer,
            },
        )
    ]
    described = SimpleNamespace(kind=kind, variables=variables or {})
    subject = SimpleNamespace(description=described, is_machine=kind == "machine")
    return ride_through._judge(subject, answers, [], 0)


def test_a_machines_current_has_no_limit_unless_it_declares_one(monkeypatch):
    monkeypatch.setattr(ride_through, "_follows_at_once", lambda _: False)
    assert limits("machine").verdict == "pass"
    assert "a machine, whose current nothing limits" in limits("machine").evidence
    assert limits("").fault == limits("converter").fault == "no current limit"
    declared = {"I_max": SimpleNamespace(start=1.2, unit="pu", start_number=1.2)}
    assert limits("machine", declared).fault == "above its current limit"
    assert limits("machine", blocked=0.2).fault == "blocks"


@pytest.mark.parametrize(("machine", "fault"), [(True, None), (False, "uneven damping")])
def test_a_machines_swing_may_be_damped_less_elsewhere(machine, fault):
    usual, here = (np.exp(-rate * TIME) * np.sin(7 * TIME) for rate in (3.0, 1.2))
    found = evenness._other(usual, here, machine)
    assert (found and found[0]) == fault
    assert evenness._other(usual, -usual, machine)[0] == "uneven droop"


def test_a_machine_without_a_limit_of_its_current_cannot_wind_up_at_it(monkeypatch):
    monkeypatch.setattr(windup, "current_limit", lambda subject: None)
    machine = SimpleNamespace(starts=True, is_machine=True, memory={})
    assert windup.anti_windup(machine).verdict == "not applicable"


@pytest.mark.parametrize("ends", [True, False])
def test_what_an_fmu_with_an_end_leaves_unjudged_is_no_reason_to_refuse_it(ends):
    assert windup._summary(0, [], ends=ends).figures["reason"] is not ends
