"""Loads that are motors by their records: which ones, at what rating, what stays a load, and the modes of a case."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from fmus.grid.element_data import Load
from fmus.induction_machine.model import induction_motor_phasor
from orchestrator.cases.case import load_case
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.motor_loads import loads_without, motor_loads, motor_remarks
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.cases.scenario.facts import facts_of
from orchestrator.core.errors import InputError
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.run import run_scenario
from tests.models.test_induction_machine import behind_line
from tests.support.evaluated import Evaluated
from tests.support.scenarios import prepare_one

LOADS = [
    FileLoad("load_1", 1, "1", 10, 5, 7, 80.0, 20.0, 80 + 20j),
    FileLoad("load_2", 2, "1", 20, 5, 7, 60.0, 10.0, 60 + 10j),
    FileLoad("load_2", 2, "A-2", 20, 6, 8, 30.0, 5.0, 30 + 5j),
    FileLoad("load_3", 3, "1", 20, 6, 8, -10.0, 2.0, -10 + 2j),
]
ELEMENTS = [
    Load("load_1", "bus_1", 80.0, 20.0),
    Load("load_2", "bus_2", 90.0, 15.0),
    Load("load_3", "bus_3", -10.0, 2.0),
]
CIRCUIT = "1 0.013 0.067 3.8 0.02 0.17 0 0 0 0 0 0"
CIM5 = CIRCUIT + " {base} {times} 0.7 0 0 0 2 0"
CIM6 = CIRCUIT + " 0 1.2 0.7 0.6 20 5 0.3 0.2 0.4 1.5 0.1 0"
CIMW = CIRCUIT + " 0 1.2 0.7 0.6 20 5 0.3 0.2 0.4 1.5"


def cim5(base=0, times=1.25):
    return CIM5.format(base=base, times=times)


def motors(tmp_path, *records):
    path = tmp_path / "loads.dyr"
    path.write_text("".join(f"{text} /\n" for text in records))
    return motor_loads(read_dyr(path), LOADS, ELEMENTS)


def test_a_motor_draws_the_loads_power_at_its_rating(tmp_path):
    (by_load,) = motors(tmp_path, f"1 'CIM5BL' 1 {cim5()}")
    assert (by_load.name, by_load.bus, by_load.model) == (
        "motor1",
        "bus_1",
        "induction_motor_phasor",
    )
    p = by_load.parameters
    assert (p["S_n"], p["P_0"], p["Q_0"]) == pytest.approx((100.0, -0.8, -0.2))
    assert (p["RA"], p["XM"], p["R1"], p["H"], p["E"]) == (0.013, 3.8, 0.02, 0.7, 2.0)
    (by_base,) = motors(tmp_path, f"1 'CIM5BL' 1 {cim5(base=200)}")
    assert (by_base.parameters["S_n"], by_base.parameters["P_0"]) == (200.0, -0.4)


def test_the_torque_laws_of_cim6_and_cimw_are_told_apart(tmp_path):
    (six,) = motors(tmp_path, f"1 'CIM6BL' 1 {CIM6}")
    assert [six.parameters[k] for k in ("A", "B", "D", "E", "C0")] == [0.3, 0.2, 0.4, 1.5, 0.1]
    assert [six.parameters[k] for k in ("VI", "TI", "TB")] == [0.6, 20, 5]
    assert "C0_of_start" not in six.parameters
    (wide,) = motors(tmp_path, f"1 'CIMWBL' 1 {CIMW}")
    assert wide.parameters["C0_of_start"] is True


def test_the_narrower_record_goes_first_and_what_feeds_is_no_motor(tmp_path):
    found = motors(
        tmp_path,
        f"0 'CIM5AL' * {cim5()}",
        f"20 'CIM5AR' * {cim5(base=111)}",
        f"6 'CIM5ZN' * {cim5(base=222)}",
        f"2 'CIM5BL' 1 {cim5(base=333)}",
    )
    ratings = {motor.name: motor.parameters["S_n"] for motor in found}
    assert ratings == {"motor1": 100.0, "motor2_1": 333.0, "motor2_A_2": 222.0}


def test_what_no_motor_draws_stays_a_load(tmp_path):
    found = motors(tmp_path, f"1 'CIM5BL' 1 {cim5()}", f"2 'CIM5BL' A-2 {cim5()}")
    left = {load.name: (load.p_mw, load.q_mvar) for load in loads_without(ELEMENTS, found)}
    assert left == {"load_2": (60.0, 10.0), "load_3": (-10.0, 2.0)}


@pytest.mark.parametrize(
    ("record", "text"),
    [
        (cim5(times=0), "MBASE = 0 and PMULT = 0: one of them gives the rating"),
        ("3" + cim5()[1:], "IT = 3; only 1 or 2 can be modelled"),
        (cim5() + " 1", "has 21 values, and needs 20: IT, RA, XA, XM"),
        (cim5(times="'x'"), "PMULT = 'x'; it must be a number"),
    ],
)
def test_a_record_that_cannot_be_is_refused_by_its_line(tmp_path, record, text):
    with pytest.raises(InputError, match=r"loads\.dyr, line 1: CIM5BL") as refused:
        motors(tmp_path, f"1 'CIM5BL' 1 {record}")
    assert text in str(refused.value)


def test_what_motors_are_of_the_load_is_told(tmp_path):
    saturated = cim5().replace("0 0 0 0 0 0 0 1.25", "0 0 1.0 0.1 1.2 0.4 0 1.25")
    found = motors(tmp_path, f"1 'CIM5BL' 1 {saturated}", f"2 'CIM5BL' 1 {cim5()}")
    (remark,) = motor_remarks(found, 200.0)
    assert "CIM5BL: 2 induction motors for 140 MW of load (70 %; bus_1, bus_2)" in remark.text
    assert "dyr_leave_out = ['CIM5BL'] in [units]" in remark.text
    assert "their saturation (SE1, SE2) is left out" in remark.text
    (plain,) = motor_remarks(motors(tmp_path, f"1 'CIM5BL' 1 {cim5()}"), 200.0)
    assert "saturation" not in plain.text


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (cim5(base=670), "CIM5BL has MBASE = 670 MVA for 80 MW of load at bus_1: the motor draws"),
        (cim5(base=50), "draws 160 % of its rating"),
        (cim5(times=6.7), "CIM5BL has PMULT = 6.7, which gives 536 MVA for 80 MW"),
        (cim5(base=200), ""),
        (cim5(times=1.0), ""),
    ],
)
def test_a_rating_that_does_not_fit_the_load_is_asked_about(tmp_path, record, said):
    first, *others = motor_remarks(motors(tmp_path, f"1 'CIM5BL' 1 {record}"), 200.0)
    assert "induction motor" in first.text
    assert [said in " ".join(other.text.split()) for other in others] == [True] * bool(said)


RAW = """\
0, 100.0, 33, 0, 1, 60.0 / a motor behind a line
A STIFF BUS
AND A MOTOR
1, 'GRID', 138.0, 3, 1, 1, 1, 1.0, 0.0
2, 'MILL', 138.0, 1, 1, 1, 1, 1.0, 0.0
0 / END OF BUS DATA, BEGIN LOAD DATA
2, '1', 1, 1, 1, 80.0, 35.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
1, '1', 80.0, 40.0, 500.0, -300.0, 1.0, 0, 1000.0, 0.0, 0.2, 0.0, 0.0, 1.0, 1, 100.0, 900.0, 0.0
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
1, 2, '1', 0.01, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
0 / END OF TRANSFORMER DATA
Q
"""
STIFF = "1 'GENCLS' 1 0 0 /\n"
LINE = 0.01 + 0.1j
BEHIND = 0.02j  # ZSORCE on 100 MVA


@pytest.fixture
def case(tmp_path):
    """Records beside the stiff bus, and kind of models → the path of the case that gfor writes."""

    def written(record, models="phasor", change=("", "")):
        (tmp_path / "mill.raw").write_text(RAW)
        (tmp_path / "mill.dyr").write_text(f"{STIFF}{record}")
        out = tmp_path / "case.toml"
        files = (tmp_path / "mill.raw", tmp_path / "mill.dyr")
        text = write_case(WantedCase(files, out, models=models)).text
        out.write_text(text.replace(*change), encoding="utf-8")
        return out

    return written


def test_the_modes_of_a_case_are_those_of_its_motor_behind_the_line(case):
    prepared = prepare_one(case(f"2 'CIM5BL' 1 {cim5()} /\n"), "base")
    assert {*prepared.system.components} == {"grid", "sg1", "motor2"}
    assert prepared.network is not None
    assert not prepared.network.loads
    flow = prepared.power_flow
    assert flow is not None
    v = flow.voltages["bus_2"]
    assert v * np.conj((1.0 - v) / LINE) == pytest.approx(0.8 + 0.35j, abs=1e-6)
    own = {"R1": 0.02, "X1": 0.17, "RA": 0.013, "XA": 0.067, "XM": 3.8, "H": 0.7, "E": 2.0}
    at = {"P_0": -0.8, "Q_0": -0.35, "v_0": abs(v), "theta_0": np.angle(v), "f_n": 60.0}
    alone = Evaluated(induction_motor_phasor(), own | at)
    wanted = behind_line(alone, [v.real, v.imag], LINE + BEHIND)
    slow = wanted[np.abs(wanted) < 60]
    ours = np.array(compute_modes(prepared).eigenvalues)
    distance = np.abs(ours[:, None] - slow) / (1 + np.abs(slow))
    assert len(slow) == 3
    assert max(distance[linear_sum_assignment(distance)]) < 5e-3


def test_the_network_says_how_much_of_its_load_motors_are(case):
    prepared = prepare_one(case(f"2 'CIM5BL' 1 {cim5()} /\n"), "base")
    facts = facts_of(prepared)
    assert facts is not None
    assert "1 motor" in facts.sentence()
    assert "80 MW of load (motors for 80 MW)" in facts.sentence()
    assert prepared.basis["loads"] == "motors for 80 MW"
    (use,) = (use for use in prepared.records if use.kind == "CIM5BL")
    assert use.use is UseOfRecord.USED
    assert any("1 induction motor for 80 MW" in q.text for q in prepared.questions)


def test_the_remedy_of_the_question_leaves_motors_out(case):
    change = ('dyr = "mill.dyr"', "dyr_leave_out = ['CIM5BL']\ndyr = \"mill.dyr\"")
    prepared = prepare_one(case(f"2 'CIM5BL' 1 {cim5()} /\n", change=change), "base")
    assert "motor2" not in prepared.system.components
    assert prepared.network is not None
    assert [load.p_mw for load in prepared.network.loads] == [80.0]
    assert not any("CIM5BL" in q.text for q in prepared.questions)


def test_emt_models_ask_for_phasors_and_the_remedy_works(case):
    record = f"2 'CIM5BL' 1 {cim5()} /\n"
    path = case(record, models="emt")
    prepared = prepare_one(path, "base")
    (asked,) = (q.text for q in prepared.questions if "CIM5BL" in q.text)
    remedy = 'models = "phasor"'
    assert f"write {remedy} at the top of the case" in asked
    assert "motor2" not in prepared.system.components
    text = path.read_text()
    assert 'models = "emt"' in text
    path.write_text(text.replace('models = "emt"', remedy))
    assert "motor2" in prepare_one(path, "base").system.components


def test_a_value_that_the_case_gives_a_motor_acts(case):
    path = case(f"2 'CIM5BL' 1 {cim5()} /\n")
    (other,) = load_case(path).prepare(["base"], {"motor2.H": "2 s"})
    assert other.system.components["motor2"].number("H") == 2.0


def test_a_motor_beyond_its_pull_out_point_is_refused_with_its_name(case):
    leaky = cim5(base=60).replace("0.17", "0.6")
    prepared = prepare_one(case(f"2 'CIM5BL' 1 {leaky} /\n"), "base")
    with pytest.raises(Exception, match=r"motor2.*pull-out point"):
        compute_modes(prepared)


def resting_voltage():
    """The larger root of |V|⁴ + (2 (RP + XQ) − 1) |V|² + |Z|² |S|²: of the motor's bus."""
    S = 0.8 + 0.35j
    half = 0.5 - (LINE.conjugate() * S).real
    return np.sqrt(half + np.sqrt(half**2 - abs(LINE * S) ** 2))


def with_relay(VI, TI=6):
    return f"2 'CIM5BL' 1 {cim5().replace('0.7 0 0 0', f'0.7 {VI:.4f} {TI} 3')} /\n"


def test_a_motor_whose_relay_trips_at_once_is_refused_with_both_voltages(case):
    v = resting_voltage()
    with pytest.raises(InputError, match="the undervoltage relay of motor2") as refused:
        case(with_relay(v + 0.01, TI=0))
    told = f"rests at {v:.4g} pu, below VI = {v + 0.01:.4f} pu, so that it trips 0.05 s after the"
    assert told in str(refused.value)
    assert "mill.dyr, line 2" in str(refused.value)


def test_a_motor_about_to_trip_is_told_starts_and_trips_in_the_run(case):
    """Until its relay has counted for 6 + 3 cycles of 60 Hz the motor draws 80 MW, and its modes are as without it."""
    v = resting_voltage()
    path = case(with_relay(v + 0.01))
    prepared = replace(prepare_one(path, "base"), stop_time=0.3, events=())
    (asked,) = (q.text for q in prepared.questions if "undervoltage relay" in q.text)
    assert f"below VI = {v + 0.01:.4f} pu, so that it trips 0.15 s after the start" in asked
    found = run_scenario(prepared)
    (said,) = (text for text in found.modes.warnings if "about to trip" in text)
    assert f"rests at {v:.4g} pu; a run trips it 0.15 s after its start" in said
    voltage, times = found.dataset["grid.bus_2.v"].values, found.dataset["time"].values
    assert voltage[times < 0.149] == pytest.approx(v, abs=1e-6)
    assert times[np.argmax(voltage > v + 0.02)] == pytest.approx(0.15, abs=0.012)
    without = compute_modes(prepare_one(case(with_relay(v - 0.01)), "base"))
    states = [k for k, name in enumerate(without.model.names) if ".relay." not in name]
    assert len(states) == len(without.model.names) - 3
    theirs = np.array(without.eigenvalues)
    for value in found.modes.eigenvalues:
        assert np.abs(theirs - value).min() < 1e-6 * (1 + abs(value))


def test_a_record_of_a_load_is_no_record_of_the_machine_at_its_bus(case):
    """A machine and a load may have one bus and one identifier."""
    prepared = prepare_one(case(f"1 'CIM5BL' 1 {cim5()} /\n"), "base")
    (asked,) = (q.text for q in prepared.questions if "CIM5BL" in q.text)
    assert "the file has no load in service that it names" in asked
