"""References of a RAW file (IDE = 3) without a machine in service: an infinite bus, another reference, or nothing."""

import math

import pytest

from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.studies.modes.modes import compute_modes
from tests.support.scenarios import prepare_one

RAW = """\
0, 100.0, 33, 0, 1, 60.0 / a machine at an infinite bus
THE RECORD OF THE INFINITE BUS IS LEFT OUT
LINE OF X = 0.3
1, 'FAR GRID', 20.0, {far}, 1, 1, 1, 1.0, 0.0
2, 'MACHINE', 20.0, {near}, 1, 1, 1, 1.02, 0.0
{bare}0 / END OF BUS DATA, BEGIN LOAD DATA
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
2, '1', 50.0, 0.0, 100.0, -100.0, 1.02, 0, 100.0, 0.0, 0.25, 0.0, 0.0, 1.0, 1, 100.0, 90.0, 0.0
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
1, 2, '1', 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
0 / END OF TRANSFORMER DATA
Q
"""
DYR = "2 'GENCLS' 1 3.5 2.0 /\n"
FAR, NEAR = "reference bus (IDE = 3) without a machine in service: an infinite bus", "ordinary bus"


@pytest.fixture
def prepared(tmp_path):
    """Codes IDE of both buses, further buses, the records of machines, and the slack of the case → its base."""

    def scenario(far=3, near=2, bare="", dyr=DYR, slack=None):
        files = [tmp_path / "grid.raw"]
        files[0].write_text(RAW.format(far=far, near=near, bare=bare))
        if dyr:
            files.append(tmp_path / "grid.dyr")
            files[1].write_text(dyr)
        out = tmp_path / "case.toml"
        out.write_text(write_case(WantedCase(tuple(files), out, slack=slack)).text, "utf-8")
        return prepare_one(out, "base")

    return scenario


def asked(scenario):
    return " ".join(question.text for question in scenario.questions)


@pytest.mark.parametrize("dyr", [DYR, ""])
def test_an_infinite_bus_stands_at_a_reference_without_a_machine(prepared, dyr):
    scenario = prepared(dyr=dyr)
    flow = scenario.power_flow
    assert flow.slack == "bus_1"
    assert flow.voltages["bus_1"] == pytest.approx(1.0)
    sine = 0.5 * 0.3 / 1.02  # P·X/(V1·V2)
    assert flow.voltages["bus_2"].imag / 1.02 == pytest.approx(sine, rel=1e-6)
    far = scenario.system.components["sg1"]
    assert far.number("machine.H") == 0
    assert far.number("P_0") * far.number("S_n") == pytest.approx(-50)
    assert FAR in asked(scenario)
    assert "X_d1" not in asked(scenario)


def test_its_mode_is_that_of_the_textbook(prepared):
    """s² + D/(2H)·s + ω_b·K/(2H) = 0 with K = E'·V·cos δ/(X'_d + X); GENCLS' power is no torque: P/(2H) besides."""
    modes = compute_modes(prepared()).modes
    (swing,) = [mode.eigenvalue for mode in modes if mode.eigenvalue.imag > 1]
    X = 0.25 + 0.3 + 1e-4
    v = 1.02 * complex(math.sqrt(1 - (0.5 * 0.3 / 1.02) ** 2), 0.5 * 0.3 / 1.02)
    emf = v + 0.25j * (v - 1.0) / 0.3j
    stiffness = emf.real / X
    assert abs(swing) == pytest.approx(math.sqrt(2 * math.pi * 60 * stiffness / 7), rel=1e-3)


def test_a_record_of_the_reference_counts(prepared):
    scenario = prepared(dyr=DYR + "1 'GENCLS' 1 9.0 0.0 /\n")
    assert scenario.system.components["sg1"].number("machine.H") == 9


def test_another_reference_with_a_machine_feeds_what_is_left(prepared):
    scenario = prepared(near=3)
    assert scenario.power_flow.slack == "bus_2"
    assert "sg1" not in scenario.system.components
    assert f"{NEAR} here, and 2, a reference too, feeds what is left" in asked(scenario)


def test_a_slack_of_the_case_needs_no_infinite_bus(prepared):
    scenario = prepared(slack="sg2")
    assert "sg1" not in scenario.system.components
    assert scenario.power_flow.slack == "bus_2"


def test_a_reference_with_nothing_at_it_is_none(prepared):
    bare = "9, 'NOTHING', 20.0, {}, 1, 1, 1, 1.0, 0.0\n"
    scenario = prepared(bare=bare.format(3))
    assert "bus_9" not in scenario.network.buses
    assert "nothing is connected to it, so it is none" in asked(scenario)
    assert 'such as slack = "bus_2"' in asked(prepared(far=1, bare=bare.format(3)))
    named = prepared(far=1, bare=bare.format(3), slack="sg2")
    assert named.power_flow.slack == "bus_2"
    assert "nothing is connected to the bus" in asked(prepared(bare=bare.format(1)))
