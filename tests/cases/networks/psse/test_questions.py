"""Mistakes in RAW and DYR files that a power flow survives: each is one question, and an honest file has none."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.networks.conversion import import_network
from orchestrator.cases.networks.data import misfit_of
from orchestrator.cases.networks.sources import read_pandapower
from orchestrator.core.errors import CaseError
from tests.support.scenarios import prepare_one

FILES = Path(__file__).parents[4] / ".docs" / "tutorials" / "psse"
RAW, DYR = ((FILES / name).read_text() for name in ("areas.raw", "areas.dyr"))
CASE = """\
name = "areas"
[solver]
step_size = "5 ms"
record_interval = "20 ms"
stop_time = "15 s"
[power_flow]
grid = "grid"
[components.grid]
model = "phasor_grid"
[network]
raw = "areas.raw"
keep_load_parts = true
load_model = { active = "power", reactive = "power" }
[units]
dyr = "areas.dyr"
generator = "synchronous_generator_phasor"
converter = "gfor_phasor"
"""
CHANGES = ("switched shunt: held", "tap changer or phase-shift control")
"""What is told of the honest file: it is taken over in another form."""


@pytest.fixture
def questions(tmp_path):
    """Questions about the two areas with changed files, as text."""

    def ask(raw=RAW, dyr=DYR, case=CASE):
        (tmp_path / "areas.raw").write_text(raw)
        (tmp_path / "areas.dyr").write_text(dyr)
        (tmp_path / "case.toml").write_text(case)
        prepared = prepare_one(tmp_path / "case.toml")
        return [str(q) for q in prepared.questions if not any(text in str(q) for text in CHANGES)]

    return ask


def changed(text, *pairs):
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def without(kind, *buses):
    return "\n".join(
        x for x in DYR.splitlines() if not any(x.startswith(f"{b} '{kind}'") for b in buses)
    )


SEXS = "3 'SEXS'   1  0.1 10.0 100.0 0.05 -5.0 5.0 /"
EXST1 = "3 'EXST1'  1  0.01  0.2 -0.2  1.0 1.0  200.0 0.0  5.0 -5.0  0.0  0.0 1.0 /"
TGOV1 = "3 'TGOV1'  1  0.05 0.5  1.0 0.0  2.1 7.0  0.0 /"
IEEEG1 = "3 'IEEEG1' 1 0 0 20 0 0 0.1 1 -10 1 0 0.3 0.3 0 7 0.3 0 0.6 0.4 0 0 0 0 /"
HYGOV = "3 'HYGOV'  1  0.05 0.3 5.0 0.05 0.5 0.2 1.0 0.0 1.0 1.2 0.5 0.08 /"
GAST = "3 'GAST'   1  0.05 0.4 0.1 3.0 1.2 2.0 1.0 -0.05 0.0 /"
STAB1 = "2 'STAB1' 1  1.0 10.0  2.5 0.02  0.5555556 5.4  0.1 /"
DYRS = {
    "no exciter": (
        without("EXST1", 3),
        "sg3: no record of an exciter, where 3 of 4 machines have one",
    ),
    "no governor at two": (
        without("TGOV1", 3, 4),
        "sg3, sg4: no record of a governor, where 2 of 4",
    ),
    "droop in percent": (
        changed(DYR, (TGOV1, TGOV1.replace("0.05", "5"))),
        "governor.R = 5 pu is outside",
    ),
    "droop of HYGOV in percent": (
        changed(DYR, (TGOV1, HYGOV.replace("0.05", "5", 1))),
        "governor.R = 5 pu",
    ),
    "droop of GAST in percent": (
        changed(DYR, (TGOV1, GAST.replace("0.05", "5", 1))),
        "governor.R = 5 pu",
    ),
    "droop for its inverse": (
        changed(DYR, (TGOV1, IEEEG1.replace(" 20 ", " 0.05 "))),
        "governor.K = 0.05 pu",
    ),
    "temporary droop in percent": (
        changed(DYR, (TGOV1, HYGOV.replace(" 0.3 ", " 30 "))),
        "governor.r = 30 pu",
    ),
    "gain of an exciter": (
        changed(DYR, (EXST1, SEXS.replace(" 100.0 ", " 0.01 "))),
        "exciter.K = 0.01 pu",
    ),
    "gain of a stabiliser": (
        changed(DYR, (STAB1, STAB1.replace("  1.0 ", "  1000 "))),
        "pss.K_S = 1000 pu",
    ),
    "least droop of a governor": (
        changed(DYR, (TGOV1, TGOV1.replace("0.05", "0.005"))),
        "governor.R = 0.005 pu is",
    ),
    "field's time constant": (
        changed(DYR, ("8.0 0.03", "0.8 0.03")),
        "machine.T_d10 = 0.8 s is outside",
    ),
    "gain of a tenth": (
        changed(DYR, (EXST1, EXST1.replace("200.0", "20.0"))),
        "exciter.K_A = 20, where the 3 other machines have 200 to 200: is it so?",
    ),
    "inertia of a tenth": (
        changed(DYR, (" 6.5 ", " 0.65 ")),
        "machine.H = 0.65, where the 3 other machines have 6.175 to",
    ),
    "lead for lag of a governor": (
        changed(DYR, (TGOV1, TGOV1.replace("2.1 7.0", "7.0 2.1"))),
        "are the two swapped?",
    ),
    "time constant of an exciter": (
        changed(DYR, (EXST1, SEXS.replace("0.05", "50"))),
        "exciter.T_E = 50 s is outside",
    ),
    "lead for lag": (
        changed(DYR, (EXST1, SEXS.replace("0.1 10.0", "10.0 0.1"))),
        "are the two swapped?",
    ),
    "no saturation": (
        changed(DYR, ("0.0392 0.2227", "0.0 0.0")),
        "sg1: the saturation is 0, where 3 of 4 machines",
    ),
    "saturation in percent": (
        changed(DYR, ("0.0392 0.2227", "3.92 22.27")),
        "machine.s_10 = 3.92 is outside",
    ),
}


@pytest.mark.parametrize("name", DYRS)
def test_a_mistake_in_the_dynamics_data_is_asked_about(questions, name):
    dyr, words = DYRS[name]
    asked = questions(dyr=dyr)
    assert any(words in question for question in asked), asked
    assert len(asked) <= 2  # S(1.0) and S(1.2) are two values


@pytest.mark.parametrize("record", [IEEEG1, HYGOV, GAST, TGOV1])
def test_honest_governors_are_not_asked_about(questions, record):
    assert questions(dyr=changed(DYR, (TGOV1, record))) == []


WSIEG1 = IEEEG1.replace("IEEEG1", "WSIEG1").replace("/", "0 0 0 0 0 0 0 0 0 0 0 0 0 0 /")


@pytest.mark.parametrize("record", [IEEEG1, WSIEG1])
@pytest.mark.parametrize(("times", "asked"), [("0 3.3", True), ("0 0", False), ("5 3.3", False)])
def test_a_lead_without_a_lag_is_asked_about(questions, record, times, asked):
    name = record.split("'")[1]
    found = questions(dyr=changed(DYR, (TGOV1, record.replace(" 20 0 0 ", f" 20 {times} "))))
    said = [q for q in found if f"{name} has T2 = 3.3 and T1 = 0: a lead without a lag" in q]
    assert len(said) == asked


@pytest.mark.parametrize(
    ("bands", "said"),
    [
        ("0 0.001 0", "WSIEG1 has err = 0.001: the hysteresis"),
        ("0 0 0.001", "WSIEG1 has db2 = 0.001: the backlash"),
        ("0.0006 0 0", "governor.db_1 = 0.0006: the operating point rests within this dead band"),
    ],
)
def test_bands_of_a_governor_of_wecc_are_asked_about(questions, bands, said):
    record = f"{WSIEG1.removesuffix('0 0 0 0 0 0 0 0 0 0 0 0 0 0 /')}{bands} {'0 ' * 11}/"
    (asked,) = questions(dyr=changed(DYR, (TGOV1, record)))
    assert said in asked


@pytest.mark.parametrize("gain", ["10", "0"])
def test_a_limiter_of_the_acceleration_that_is_left_out_is_asked_about(questions, gain):
    """GGOV1's Aset, Ka, Ta: no part of ours has them, and with Ka = 0 there is none in PSS/E either."""
    record = (
        "3 'GGOV1' 1 1 0 0.04 1 0.05 -0.05 10 2 0 1 1 0.15 0.5 1.5 0.2 0.1 0 0 3 2 0.67 1 0 0.1 -0.1 0"
        f" 0.01 {gain} 0.1 0 0 4 5 99 -99 /"
    )
    asked = [q for q in questions(dyr=changed(DYR, (TGOV1, record))) if "acceleration" in q]
    assert len(asked) == (gain != "0")
    assert all("GGOV1 has Ka = 10: the limiter of the acceleration" in q for q in asked)
    assert all("areas.dyr, line 11" in q for q in asked)


@pytest.mark.parametrize(("held", "asked"), [("0.75", True), ("1", False)])
def test_a_load_limit_below_the_operating_point_is_asked_about(questions, held, asked):
    """GGOV1's Ldref: it is no reason to refuse a network, as the turbine starts."""
    record = (
        "3 'GGOV1' 1 1 0 0.04 1 0.05 -0.05 10 2 0 1 1 0.15 0.5 1.5 0.2 0.1 0 0 3 2 0.67"
        f" {held} 0 0.1 -0.1 0 0.01 0 0.1 0 0 4 5 99 -99 /"
    )
    found = [q for q in questions(dyr=changed(DYR, (TGOV1, record))) if "ld_ref" in q]
    assert len(found) == asked
    assert all(f"ld_ref = {held} pu, the load that the turbine's limiter holds" in q for q in found)
    assert all('meant = ["sg3.governor.ld_ref"]' in q for q in found)


@pytest.mark.parametrize(("held", "asked"), [("0.75", True), ("1", False)])
def test_a_load_limit_of_a_gas_turbine_is_asked_about_likewise(questions, held, asked):
    record = f"3 'GAST' 1 0.05 0.4 0.1 3 {held} 2 1.2 -0.05 0 /"
    found = [q for q in questions(dyr=changed(DYR, (TGOV1, record))) if "A_T" in q]
    assert len(found) == asked
    assert all('meant = ["sg3.governor.A_T"]' in q for q in found)


@pytest.mark.parametrize("kind", ["TGOV1", "EXST1", "STAB1"])
def test_parts_that_no_machine_has_are_a_choice(questions, kind):
    dyr = without(kind, 1, 2, 3, 4)
    dyr = "\n".join(x for x in dyr.splitlines() if "STAB1" not in x)
    asked = questions(dyr=dyr)
    assert len(asked) == (
        kind == "TGOV1"
    )  # a study may leave out exciters; nothing holds the frequency without governors
    assert all(
        "no record of a governor, where every machine has its exciter's" in text for text in asked
    )


FLAT = "\n".join(
    ",".join([*line.split(",")[:7], "1.0", "0.0"]) if 3 < number < 15 else line
    for number, line in enumerate(RAW.splitlines(), start=1)
)
RAWS = {
    "not solved": (FLAT, "the file is not solved"),
    "transformer on the machine's base": (
        changed(RAW, ("5,  1, 0, '1 ', 1, 2, 1", "5,  1, 0, '1 ', 1, 1, 1")),
        "X_line_5_1 = 0.15 pu on 100 MVA is 1.35 pu on the 900 MVA behind it",
    ),
    "transformer in percent": (
        changed(RAW, ("'T3', 1\n0.0, 0.15, 900.0", "'T3', 1\n0.0, 15, 900.0")),
        "is 15 pu on the 900 MVA behind it, and step-up transformers have 0.03 to 0.35 pu there; is it in percent?",
    ),
    "transformer on 100 MVA": (
        changed(RAW, ("'T3', 1\n0.0, 0.15, 900.0", "'T3', 1\n0.0, 0.0167, 900.0")),
        "step-up transformers have 0.03 to 0.35 pu there; if 0.0167 pu is on 100 MVA, CZ = 1 says so",
    ),
    "load at another bus": (
        changed(RAW, (" 7, '1 ', 1, 1, 1,  967", " 6, '1 ', 1, 1, 1,  967")),
        "beyond what the network takes away, +967 MW +99.99 Mvar at bus_7, -967 MW -99.99 Mvar at bus_6",
    ),
    "sign of a shunt": (
        changed(RAW, ("0.0, 200.0", "0.0, -200.0")),
        "-371.7 Mvar at bus_7; look at its load, its shunt",
    ),
    "branch out of service": (
        changed(
            RAW,
            (
                "8,  9, '2 ', 0.011, 0.11, 0.1925, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1",
                "8,  9, '2 ', 0.011, 0.11, 0.1925, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0",
            ),
        ),
        "Mvar at bus_8; look at a branch between these buses (its status",
    ),
    "shift of a transformer": (
        changed(RAW, ("1.0, 230.0, 0.0, 0.0", "1.0, 230.0, 30.0, 0.0")),
        "Mvar at bus_5; look at its load, its shunt, its unit's power or a branch",
    ),
    "shift in radians": (
        changed(RAW, ("1.0, 230.0, 0.0, 0.0", "1.0, 230.0, 0.52, 0.0")),
        "ANG is 0.52 degrees: is it in radians? 30",
    ),
    "load loss in pu": (
        changed(
            RAW,
            ("5,  1, 0, '1 ', 1, 2, 1", "5,  1, 0, '1 ', 1, 3, 1"),
            ("0.0, 0.15, 900.0", "0.003, 0.15, 900.0"),
        ),
        "R below 1 is a load loss in W by CZ = 3",
    ),
    "angles in radians": (
        "\n".join(
            ",".join([*line.split(",")[:8], f" {float(line.split(',')[8]) * 0.0174533:.4f}"])
            if 3 < n < 15
            else line
            for n, line in enumerate(RAW.splitlines(), start=1)
        ),
        "look at voltages of another case, or angles that are not in degrees",
    ),
    "setpoint a little off": (
        changed(RAW, ("-300.0, 1.03, 0, 900.0", "-300.0, 1.05, 0, 900.0")),
        "VS is 1.05 pu, where the solved file has",
    ),
    "setpoint that the solution does not hold": (
        changed(RAW, ("719.000, 0.0, 500.0, -300.0, 1.03", "719.000, 0.0, 500.0, -300.0, 0.83")),
        "line 24: VS is 0.83 pu, where the solved file has VM = 1.03 pu",
    ),
    "load of the wrong sign": (
        changed(RAW, ("967.000, 100.000", "-96.7, 10.000")),
        "load at bus_7 is -96.7 MW",
    ),
    "rating": (
        changed(RAW, ("1.03, 0, 900.0, 0.0025", "1.03, 0, 9000.0, 0.0025")),
        "1.5 pu on the 9000 MVA behind it, and step-up transformers have 0.03 to 0.35 pu there; is the machine",
    ),
    "line of ten times": (
        changed(RAW, ("6,  7, '1 ', 0.001, 0.01,", "6,  7, '1 ', 0.001, 0.1,")),
        "line_6_7 = 0.1 pu: its X/R is 10 times and its X/B 10 times that of the middle line; has X a digit too many?",
    ),
    "line of a tenth": (
        changed(RAW, ("5,  6, '1 ', 0.0025, 0.025,", "5,  6, '1 ', 0.0025, 0.0025,")),
        "has X a digit too few?",
    ),
    "circuit of a tenth": (
        changed(RAW, ("7,  8, '2 ', 0.011, 0.11,", "7,  8, '2 ', 0.011, 0.011,")),
        "X_line_7_8_2 = 0.011 pu, and the parallel line_7_8 has 0.11 pu, with like other data",
    ),
    "charging of one circuit": (
        changed(RAW, ("7,  8, '2 ', 0.011, 0.11, 0.1925", "7,  8, '2 ', 0.011, 0.11, 0.0")),
        "B_line_7_8_2 = 0 pu, and the parallel line_7_8 has 0.1925 pu",
    ),
    "load in pu": (
        changed(RAW, ("967.000, 100.000", "9.67, 1.0")),
        "load at bus_7 has 9.67 MW, where the others have",
    ),
    "power in pu": (
        changed(RAW, (" 2, '1 ', 700.000", " 2, '1 ', 7.00")),
        "more than the rating of the machine",
    ),
    "conductance for a capacitor": (
        changed(RAW, ("0.0, 200.0", "200.0, 0.0")),
        "line 20: shunt that draws GL = 200 MW",
    ),
    "small shunt": (
        changed(RAW, ("7, '1 ', 1, 0.0, 200.0", "7, '1 ', 1, 0.0, 3.5")),
        "shunt at bus_7 has 3.5 Mvar",
    ),
}


@pytest.mark.parametrize("name", RAWS)
def test_a_mistake_in_the_power_flow_data_is_asked_about(questions, name):
    raw, words = RAWS[name]
    try:
        asked = questions(raw=raw)
    except CaseError as error:  # without a power flow, the question may be its reason
        asked = [str(problem) for problem in error.problems]
    assert any(words in question for question in asked), asked


def test_an_honest_file_is_asked_about_nothing(questions):
    assert questions() == []


def test_a_gate_and_water_that_no_plant_has_are_asked_about(questions):
    """HYGOV as some public files have it for every machine: T_g = 20.5 s, T_w = 15 s."""
    assert questions(dyr=changed(DYR, (TGOV1, HYGOV))) == []
    placeholder = HYGOV.replace("0.05 0.5 0.2 1.0 0.0 1.0", "0.05 20.5 0.2 1.0 0.0 15.0")
    asked = questions(dyr=changed(DYR, (TGOV1, placeholder)))
    for told in ("T_g = 20.5", "T_W = 15"):
        assert any(told in question for question in asked), asked


def with_shifts(*shifts):
    """The file with transformers beside line 5-1, of no current as good as none, with these shifts [degrees]."""
    end = "0 / END OF TRANSFORMER DATA"
    beside = "".join(
        f" 5,  1, 0, 'A{k}', 1, 2, 1, 0.0, 0.0, 2, 'T{k}', 1\n0.0, 5000, 900.0\n"
        f"1.0, 230.0, {shift}, 0.0, 0.0, 0.0, 0, 0, 1.1, 0.9, 1.02, 0.98, 33\n1.0, 20.0\n"
        for k, shift in enumerate(shifts, start=10)
    )
    return changed(RAW, (end, beside + end))


def about_radians(asked):
    return [str(question) for question in asked if "radians" in str(question)]


SPREAD = [round(-0.79 - 0.0323 * k, 2) for k in range(40)]
"""Shifts of a real network's kind [degrees], of which -1.05 and -1.57 are multiples of 30 degrees by chance."""


def test_shifts_that_are_usual_in_radians_by_chance_are_not_asked_about(questions):
    assert about_radians(questions(raw=with_shifts(*SPREAD))) == []


def test_shifts_in_radians_are_asked_about_once(questions):
    (asked,) = about_radians(questions(raw=with_shifts(0.52, -0.52, 1.05, 0.52, 2.62)))
    assert "is it in radians? 30, -30, 60 and 1 more degrees are usual" in asked


def test_an_answer_is_taken(questions):
    meant = 'meant = ["sg3.exciter", "sg3.governor"]\n'
    assert questions(dyr=without("EXST1", 3), case=meant + CASE) == []


@pytest.mark.parametrize(
    "head", ["0,   100.00, 33, 0, 1, 0.0", "0,   100.00, 33, 0, 1", "0,   100.00, 33"]
)
def test_a_frequency_that_the_file_does_not_have_is_the_cases(questions, head):
    raw = changed(RAW, ("0,   100.00, 33, 0, 1, 60.00", head))
    (asked,) = questions(raw=raw)
    assert "BASFRQ, the sixth value, is missing or 0: 60 Hz are taken" in str(asked)
    assert (
        questions(raw=raw, case=CASE.replace("[network]", '[network]\nfrequency = "60 Hz"')) == []
    )


SWAPPED = {
    "exciter.E_MIN = 5 pu must be less than exciter.E_MAX = -5 pu": (
        EXST1,
        SEXS.replace("-5.0 5.0", "5.0 -5.0"),
    ),
    "exciter.V_RMIN = 5 pu must be less than exciter.V_RMAX = -5 pu": (
        EXST1,
        EXST1.replace("5.0 -5.0", "-5.0 5.0"),
    ),
    "governor.V_MIN = 1 pu must be less than governor.V_MAX = 0 pu": (
        TGOV1,
        TGOV1.replace("1.0 0.0", "0.0 1.0"),
    ),
}


@pytest.mark.parametrize("words", SWAPPED)
def test_swapped_limits_are_said_as_such(questions, words):
    with pytest.raises(CaseError) as caught:
        questions(dyr=changed(DYR, SWAPPED[words]))
    (problem,) = (p for p in caught.value.problems if "questioned besides" not in str(p))
    assert words in str(problem)
    assert "are the two swapped?" in str(problem)


def test_the_table_of_units_chooses_the_machines_variant(tmp_path, questions):
    case = CASE.replace("[units]", '[units]\nmachine = "genrou_rated_speed"')
    assert questions(case=case) == []
    tables = load_case(tmp_path / "case.toml")._preparer("areas", None, ())._everything
    assert {tables[f"sg{n}"].machine for n in (1, 2, 3, 4)} == {"genrou_rated_speed"}


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "machine",
            "nonsense",
            "machine = 'nonsense' in .units. acts on no machine: the records .*genrou_rated_speed",
        ),
        ("machine", "gensal", "machine = 'gensal' in .units. acts on no machine"),
        (
            "exciter",
            "dc1a",
            "exciter = 'dc1a' in .units. acts on no machine: the DYR file has a record of it",
        ),
        ("governor", "hygov", "governor = 'hygov' in .units. acts on no machine"),
    ],
)
def test_a_choice_beside_records_acts_or_is_refused(questions, key, value, words):
    with pytest.raises(CaseError, match=words):
        questions(case=CASE.replace("[units]", f'[units]\n{key} = "{value}"'))


def test_a_choice_fills_a_missing_record(questions, tmp_path):
    case = CASE.replace("[units]", '[units]\nexciter = "sexs"\ngovernor = "hygov"')
    dyr = "\n".join(x for x in DYR.splitlines() if not x.startswith(("3 'EXST1", "3 'TGOV1")))
    assert questions(dyr=dyr, case=case) == []
    tables = load_case(tmp_path / "case.toml")._preparer("areas", None, ())._everything
    assert (tables["sg3"].exciter, tables["sg3"].governor, tables["sg1"].exciter) == (
        "sexs",
        "hygov",
        "st1a",
    )
    with pytest.raises(CaseError, match="there is no exciter 'nonsense'"):
        questions(dyr=dyr, case=case.replace("sexs", "nonsense"))


EVENT = '[[events]]\ntype = "bus_fault"\ntime = "1 s"\nbus = "bus_8"\ncleared_by = "line_7_8"\nduration = '


@pytest.mark.parametrize(
    ("duration", "words"),
    [
        (
            "100",
            "the fault is not cleared before the run stops at 15 s; if 100 ms is meant, write '100 ms'",
        ),
        (
            "12",
            "duration = 12 s, without a unit: a fault is cleared within a second; if 12 ms is meant",
        ),
        ('"20 s"', "duration = 20 s: the fault is not cleared before the run stops at 15 s"),
        ('"12 s"', None),
        ('"100 ms"', None),
        ("0.1", None),
    ],
)
def test_the_duration_of_a_fault_is_asked_about(questions, duration, words):
    asked = questions(case=CASE + EVENT + duration)
    assert (words in asked[0] and len(asked) == 1) if words else asked == []


def test_a_long_step_is_asked_about(questions):
    (asked,) = questions(case=CASE.replace('step_size = "5 ms"', 'step_size = "20 ms"'))
    assert "solver.step_size: 20 ms are long for phasor models" in asked


def test_that_no_machine_is_governed_stands_in_the_facts(questions, tmp_path, gfor):
    questions(dyr=without("TGOV1", 1, 2, 3, 4))
    facts = json.loads(gfor("modes", tmp_path / "case.toml", "--json")[1])["facts"]
    assert ", 4 machines, no governor, " in facts


OPEN = CASE.replace('load_model = { active = "power", reactive = "power" }\n', "")


def test_an_open_load_model_is_asked_about(questions):
    (asked,) = questions(case=OPEN)
    assert "the load model is open" in asked


@pytest.mark.parametrize(("parts", "is_open"), [((1.0, 1.0), False), ((0.9, 1.0), True)])
def test_a_load_model_that_the_file_says_part_by_part_is_not_asked_about(questions, parts, is_open):
    """P as constant current and Q as constant admittance, as in WECC's reduced system; with a rest it is open."""
    at, written, section = {}, [], "bus"
    for line in RAW.splitlines():
        cells = line.split(",")
        if line.startswith("0 /"):
            section = line.partition("BEGIN")[2].strip()
        elif section == "bus" and len(cells) > 8 and cells[0].strip().isdigit():
            at[int(cells[0])] = float(cells[7])
        elif section.startswith("LOAD") and float(cells[5]):
            v, (p, q) = at[int(cells[0])], map(float, cells[5:7])
            current, admittance = parts[0] * p / v, -parts[1] * q / v**2
            rest = [(1 - parts[0]) * p, (1 - parts[1]) * q]
            cells[5:11] = map(repr, [*rest, current, 0.0, 0.0, admittance])
        written.append(",".join(cells))
    asked = questions(raw="\n".join(written) + "\n", case=OPEN)
    assert ["the load model is open" in text for text in asked] == ([True] if is_open else [])


@pytest.mark.parametrize("law", ["impedance", "current", "power"])
def test_a_load_model_that_the_case_says_is_not_asked_about(questions, law):
    assert questions(case=CASE.replace('"power"', f'"{law}"')) == []


def test_the_question_tells_what_the_load_model_moves_and_facts_come_first(
    questions, tmp_path, gfor
):
    questions(case=OPEN)
    code, out, err = gfor("modes", tmp_path / "case.toml")
    assert code == 0, err
    assert out.startswith(
        "areas.raw, areas.dyr: phasor models, 60 Hz, 11 buses, 4 machines, 2723.5 MW of load (several models), slack"
    )
    assert "voltages 0.953 to 1.03 pu" in out.splitlines()[0]
    told = next(line for line in err.splitlines() if "moves the least damped mode" in line)
    found = json.loads(gfor("modes", tmp_path / "case.toml", "--json", "--out", tmp_path / "m")[1])
    written = json.loads((tmp_path / "m" / "modes.json").read_text(encoding="utf-8"))
    assert found["questions"] == written["questions"]
    assert told.removeprefix("question: ") in found["questions"]
    assert found["facts"] == out.splitlines()[0]
    questions(case=CASE.replace("keep_load_parts = true\n", ""))
    power = json.loads(gfor("modes", tmp_path / "case.toml", "--json")[1])
    assert not any("load model" in question for question in power["questions"])
    assert "(constant power)" in power["facts"]


def test_the_weight_is_that_of_the_case_that_says_so(questions, tmp_path, gfor):
    figures = {}
    for law in ("impedance", "power"):
        questions(case=CASE.replace('"power"', f'"{law}"'))
        modes = json.loads(gfor("modes", tmp_path / "case.toml", "--json")[1])["scenarios"][0][
            "modes"
        ]
        figures[law] = min(m["damping_percent"] for m in modes if m["frequency_hz"] > 0)
    questions(case=OPEN)
    asked = json.loads(gfor("modes", tmp_path / "case.toml", "--json")[1])["questions"]
    assert any(
        f"impedance {figures['impedance']:.2f} % at" in q
        and f"power {figures['power']:.2f} % at" in q
        for q in asked
    )


@pytest.mark.parametrize("switch", ["sg4.connected", "grid.sg4.connected"])
def test_a_unit_that_is_out_is_not_asked_to_start(questions, tmp_path, gfor, switch):
    questions()
    lighter = ["--set", "grid.load_9.P=700"]
    code, out, err = gfor(
        "modes",
        tmp_path / "case.toml",
        *lighter,
        "--set",
        f"{switch}=false",
        "--sharing",
        "slack",
        "--json",
    )
    assert code == 0, err
    assert json.loads(out)["scenarios"][0]["stable"] is True
    assert "3 machines" in json.loads(out)["facts"]
    assert '"sg4.' not in out  # its own modes are none of the network's
    back = '[[events]]\ntype = "unit_reconnection"\ntime = "1 s"\nunit = "sg4"\n'
    (tmp_path / "case.toml").write_text(CASE + back)
    values = {"grid.load_9.P": 700.0, switch: False}
    alone = CASE.replace("[power_flow]\n", '[power_flow]\nsharing = "slack"\n')
    for text, least in (
        (alone, -0.1),
        (alone + back, 0.0),
    ):  # of a unit that comes back, the limit stays
        (tmp_path / "case.toml").write_text(text)
        prepared = prepare_one(tmp_path / "case.toml", None, values)
        assert prepared.system.components["sg4"].value("governor.V_MIN") == least


def test_a_solution_is_compared_with_all_kinds_of_elements(tmp_path):
    pytest.importorskip("pandapower")
    tables = read_pandapower("case300", tmp_path)
    network, rounded = import_network(tables), tables.bus.copy()
    rounded[:, 7:9] = np.round(rounded[:, 7:9], 4)
    assert misfit_of(network, rounded, tables.labels) == ""
    most = max(network.shunts, key=lambda x: abs(x.b_mvar))
    wrong = replace(
        network,
        shunts=tuple(
            replace(x, b_mvar=-x.b_mvar if x is most else x.b_mvar) for x in network.shunts
        ),
    )
    assert f"Mvar at {most.bus}; look at its load, its shunt" in misfit_of(
        wrong, rounded, tables.labels
    )


def test_a_load_that_feeds_beside_a_machine_counts(questions, tmp_path):
    line = " 7, '1 ', 1, 1, 1,  967.000"
    beside = " 2, '1 ', 1, 1, 1, -100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 1, 0\n"
    slack = []
    for raw in (RAW, changed(RAW, (line, beside + line))):
        asked = questions(raw=raw)
        prepared = prepare_one(tmp_path / "case.toml")
        slack.append(900 * prepared.power_flow.powers["sg1"].real)
    assert any("MW +0 Mvar at bus_2" in question for question in asked)
    assert slack[0] - slack[1] == pytest.approx(100, abs=5)  # but for losses


CONVERTER = """
[components.gfor]
model = "gfor_phasor"
bus = "bus_8"
parameters = { S_n = "300 MVA", P_0 = 0.666667, v_0 = 0.97 }
[scenarios.less]
set = { "sg3.P_0" = 0.576667 }
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.666667", "0.666667", None),
        ("0.576667", "0.798889", None),  # the slack feeds less
        (
            "0.576667",
            "0.687778",
            "the case's converters feed 200 MW, and the file's units 100 MW less",
        ),
        ("0.666667", "-0.666667", "P_0 = -0.666667 pu: it draws 200 MW; is it so?"),
        (
            "300 MVA",
            "150 MVA",
            "the case's converters feed 100 MW, and the file's units 200 MW less than in the file",
        ),
        ("0.666667", "0.0067", "it feeds 2.01 MW with S_n = 300 MVA; is it so?"),
        ("0.666667", "0.0", "converters feed 0 MW, and the file's units 200 MW less"),
        ("0.666667", "1.2", "more than the rating of the converter"),
    ],
)
def test_a_converters_power_is_compared_with_its_rating_and_the_files(questions, old, new, words):
    asked = questions(case=CASE + changed(CONVERTER, (old, new)))
    assert any(words in question for question in asked) if words else asked == [], asked
