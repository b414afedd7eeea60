"""Trips inside models as findings of a run: a motor's undervoltage relay, and shares of distributed generation."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.run import run_scenario
from tests.support.mill import mill_case

MOTOR = "2 'CIM5BL' 1 1 0.013 0.067 3.8 0.02 0.17 0 0 0 0 0 0 0 1.25 0.7 {VI} 6 3 2 0"
GRID = "1 'GENCLS' 1 0 0 /\n"
DISTRIBUTED = (
    "2 'DERA1' 1 1 0 0 1 1 1 0.02 0.02 -99 99 0 0 0.02 0.02 20 0 -0.0006 0.0006 99 -99 1.1 0 0.5 -0.5 0.02 0.1 "
    "10 1.2 {vl0} {vl1} 1.2 1.15 0.16 {tvl1} 0.16 2 {Vrfrac} 56.5 62 0.16 0.16 0.02 2 0.02 0.3 1 -1 /\n"
)


def fault(duration, X=0.1):
    return {"type": "bus_fault", "bus": "bus_2", "time": 1.0, "duration": duration, "X": X}


@pytest.fixture
def run(tmp_path):
    def made(event, stop=2.0, **parts):
        out = mill_case(tmp_path, events=[event], **parts)
        (ready,) = load_case(out).prepare(["tried"], None, None, stop)
        return run_scenario(ready)

    return made


def trips(result):
    return [finding for finding in result.findings if finding.kind == "trip"]


def test_a_motor_that_its_relay_takes_off_is_told_with_time_and_power(run):
    """Below 0.8 pu for 6 cycles of 60 Hz it decides; 3 cycles later its breaker is open: load '1' is 60 MW."""
    result = run(fault(0.15, X=0.0), records=[MOTOR.format(VI=0.8)])
    (told,) = trips(result)
    assert (told.component, told.variable) == ("motor2_1", "relay.latch")
    assert told.figures["decided"] == pytest.approx(1.1, abs=0.011)
    assert told.time == pytest.approx(told.figures["decided"] + 3 / 60)
    assert told.figures["power_mw"] == pytest.approx(60.0, rel=1e-6)
    assert of_run(result).remark.startswith("own trips of motor2_1 at 1.1")


@pytest.mark.parametrize(("VI", "duration"), [(0.8, 0.08), (0.0, 0.15)])
def test_a_motor_whose_voltage_is_back_or_without_a_limit_is_not(VI, duration, run):
    assert trips(run(fault(duration, X=0.0), records=[MOTOR.format(VI=VI)])) == []


def test_a_share_that_comes_back_is_told_as_back_and_one_that_stays_as_off(run):
    """Below vl1 longer than tvl1 half of what is lost at the least voltage stays off (Vrfrac = 0.5)."""
    values = {"vl0": 0.2, "vl1": 0.85}
    short = GRID + DISTRIBUTED.format(**values, tvl1=1.0, Vrfrac=0.5)
    (back,) = trips(run(fault(0.1), machines=short))
    assert back.component == "gfor2"
    assert back.figures["off_at_the_end_mw"] == pytest.approx(0.0, abs=0.01 * 40)
    assert back.message.endswith("at the end all of it is back")
    late = GRID + DISTRIBUTED.format(**values, tvl1=0.05, Vrfrac=0.5)
    (off,) = trips(run(fault(0.2), machines=late))
    most, left = off.figures["power_mw"], off.figures["off_at_the_end_mw"]
    assert 5 < most < 40
    assert left == pytest.approx(most / 2, rel=0.05)


def stalls(result):
    return [finding for finding in result.findings if finding.kind == "stall"]


def with_torque(power, VI=0.0):
    """Return the motor whose load's torque goes with a power of the speed."""
    return MOTOR.format(VI=VI).removesuffix("2 0") + f"{power} 0"


def test_a_motor_that_stalls_is_told_with_its_time_and_power(run):
    """The torque of its load is constant: after a fault of 1.5 s it stands still, and stays so."""
    result = run(fault(1.5, X=0.0), stop=4.0, records=[with_torque(0)])
    (told,) = stalls(result)
    assert (told.component, told.variable) == ("motor2_1", "speed")
    assert 1.0 < told.time < 2.5
    assert told.figures["power_mw"] == pytest.approx(60.0, rel=1e-6)
    assert told.figures["speed_at_the_end_pu"] == pytest.approx(0.0, abs=0.2)
    assert of_run(result).remark.startswith(f"motors that stall: motor2_1 at {told.time:.4g} s")


def test_a_motor_that_is_on_its_way_to_a_stall_at_the_end_is_told(run):
    """Planted: the run ends while it turns above half of its speed; the longer one shows that it stands still."""
    (told,) = stalls(run(fault(0.5, X=0.0), stop=1.8, records=[with_torque(0)]))
    assert 0.5 < told.figures["speed_at_the_end_pu"] < 0.7
    assert "its speed falls below 0.7 pu" in told.message
    assert "pu and falling at the end" in told.message
    (later,) = stalls(run(fault(0.5, X=0.0), stop=3.0, records=[with_torque(0)]))
    assert later.figures["speed_at_the_end_pu"] == pytest.approx(0.0, abs=1e-3)
    assert stalls(run(fault(0.3, X=0.0), stop=1.8, records=[with_torque(0)])) == []


@pytest.mark.parametrize(("duration", "VI"), [(0.1, 0.0), (1.5, 0.8)])
def test_a_motor_that_recovers_or_is_off_does_not_stall(duration, VI, run):
    assert stalls(run(fault(duration, X=0.0), stop=4.0, records=[with_torque(0, VI)])) == []


@pytest.mark.parametrize(("mva", "told"), [(75, False), (10000, True)])
def test_mvar_beside_a_motor_that_is_far_too_large_are_told(mva, told, tmp_path):
    record = MOTOR.format(VI=0).replace(" 0 1.25 ", f" {mva} 0 ")
    assert f" {mva} 0 " in record
    (ready,) = load_case(mill_case(tmp_path, records=[record])).prepare(["base"])
    found = [text for text in compute_modes(ready).warnings if "Mvar (B_shunt)" in text]
    assert len(found) == told
    for text in found:
        assert text.startswith("motor2_1: beside it a susceptance feeds ")
        assert "more than the 60 MW of the machine" in text
        assert "S_n = 1e+04 MVA" in text
