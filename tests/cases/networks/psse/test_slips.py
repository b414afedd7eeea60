"""Slips of a planner in RAW, DYR and case: each is refused or questioned, in words that say what is likely wrong."""

import re

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_dyr import CASE, DYR
from tests.support.scenarios import prepare_one

LATE = '[scenarios.late]\n[[scenarios.late.events]]\ntype = "line_trip"\nline = "line_4_5"\ntime = "60 s"\n'
UNKNOWN = '[scenarios.other]\n[[scenarios.other.events]]\ntype = "line_trip"\nline = "line_4_7"\ntime = "1 s"\n'
FAULT = '[scenarios.other]\n[[scenarios.other.events]]\ntype = "bus_fault"\nbus = 7\ntime = "1 s"\nduration = "80 ms"\n'


def with_records(section, old, new):
    """A RAW file with a change in the first record of a section that has the text."""
    found = records(33)
    index = next(k for k, line in enumerate(found[section]) if old in line)
    found[section][index] = found[section][index].replace(old, new, 1)
    return raw(33, found)


def texts(tmp_path, network=None, dynamics=DYR, case=CASE):
    """Problems of the scenario `plain`, else its questions."""
    (tmp_path / "grid.raw").write_text(network or raw(33))
    (tmp_path / "grid.dyr").write_text(dynamics)
    (tmp_path / "case.toml").write_text(case)
    try:
        prepared = prepare_one(tmp_path / "case.toml", "plain")
    except CaseError as error:
        return [str(problem) for problem in error.problems]
    return [str(question) for question in prepared.questions]


RAWS = [
    (
        "BUS",
        "2,'BUS 2     ',18.0,2",
        "1,'BUS 2     ',18.0,2",
        "line 5: the bus 1 stands in line 4 as well",
    ),
    (
        "BUS",
        "1,1,1,1.04,0.0",
        "1,1,1,104,0.0",
        "line 4: VM is 104 pu; it must exceed 0 and be at most 2",
    ),
    (
        "GENERATOR",
        "1,1,100,192.0,0",
        "1,1,100,0,192",
        "the limit PB is 192 MW, more than PT of 0 MW: neither limits the machine here",
    ),
    (
        "GENERATOR",
        "300,-300,1.04",
        "-400,-300,1.04",
        "the limit QB is -300 Mvar, more than QT of -400 Mvar: neither limits the machine here",
    ),
    (
        "GENERATOR",
        "1,1,100,192.0,0",
        "1,1,100,150,0",
        "line 20: PG is 163 MW, beyond the machine's limits",
    ),
    ("BRANCH", "0.0085,0.072", "4.5,38.1", "is it in ohms? On 230 kV these are 0.072 pu"),
    (
        "BUS",
        "7,'BUS 7     ',230.0",
        "7,'BUS 7     ',23.0",
        "line between buses of BASKV = 230 and 23 kV",
    ),
]
DYRS = [
    ("9.55 0.0", "-9.55 0.0", "grid.dyr, line 2, sg1.machine.H: machine.H = -9.55 s"),
    ("0.08 0.0 0.0 /", "0.08 0.3 0.1 /", "saturation rises with the flux; are the two swapped?"),
    ("'TGOV1' 1  0.05", "'TGOV1' 1  5", "is it in percent? 0.05 pu would be usual"),
    ("-5.0 5.0 /", "5.0 -5.0 /", "the lower limit exceeds the upper one; are the two swapped?"),
    ("-5.0 5.0 /", "0.0 0.0 /", "the limits are equal, so that nothing can move between them"),
    ("100.0 0.05", "0.01 0.05", "is it the inverse? 100 pu would be usual"),
    ("9.55 0.0", "9.55 40.0", "machine.D = 40 pu is outside of"),
    ("0.5 1.0 0.0 2.1", "0.5 95 0.0 2.1", "governor.V_MAX = 95 pu is outside of 0.1 to 3 pu"),
]
CASES = [
    (
        "[units]",
        "[units]\nalpha = 30",
        "alpha: it must be less than or equal to 1 (value seen: 30); it is a part",
    ),
    (
        'name = "wscc"',
        'name = "wscc"\n[solver]\nstep_size = 5',
        "must be less than or equal to 0.1 s (value seen: 5",
    ),
    (
        "stray_B",
        "frequency = 50\nstray_B",
        "line 1: BASFRQ is 60 Hz, and the case's frequency = 50 Hz counts",
    ),
    ("[power_flow]", "[powerflow]", "powerflow: this key is unknown; did you mean power_flow?"),
    ('grid = "grid"', 'grid = "grid"\nslack = 3', ""),
    (
        'grid = "grid"',
        'grid = "grid"\nslack = 7',
        "'7' is neither a unit of this scenario nor a bus with one",
    ),
    (
        "[scenarios.plain]",
        f"[scenarios.plain]\n{LATE}",
        "scenario 'late', which was not asked for: the event at 60 s",
    ),
    (
        "[scenarios.plain]",
        f"[scenarios.plain]\n{UNKNOWN}",
        "'other', which was not asked for: component 'grid'",
    ),
    ("[scenarios.plain]", f"[scenarios.plain]\n{FAULT}", "has no bus '7'; did you mean bus_7?"),
    (
        "stray_B",
        'load_model = { active = "constant" }\nstray_B',
        "it must be 'impedance', 'current' or 'power'",
    ),
]


@pytest.mark.parametrize(("section", "old", "new", "words"), RAWS)
def test_a_slip_in_the_network_is_named_with_its_line(tmp_path, section, old, new, words):
    assert words not in "\n".join(texts(tmp_path))
    assert words in "\n".join(texts(tmp_path, network=with_records(section, old, new)))


@pytest.mark.parametrize(("old", "new", "words"), DYRS)
def test_a_slip_in_the_dynamics_is_named_with_its_line_and_likely_cause(tmp_path, old, new, words):
    assert old in DYR
    found = texts(tmp_path, dynamics=DYR.replace(old, new))
    assert words in "\n".join(found)
    assert all("cannot start" not in text for text in found)


@pytest.mark.parametrize(("old", "new", "words"), CASES)
def test_a_slip_in_the_case_is_one_error_or_a_question(tmp_path, old, new, words):
    assert old in CASE
    found = texts(tmp_path, case=CASE.replace(old, new))
    if words:
        assert words in "\n".join(found)
    assert all("Input should be" not in text and "ZipTable" not in text for text in found)


def test_a_scenario_that_is_asked_for_is_not_told_of_as_another(tmp_path):
    case = CASE.replace("[scenarios.plain]", f"[scenarios.plain]\n{LATE}")
    (tmp_path / "grid.raw").write_text(raw(33))
    (tmp_path / "grid.dyr").write_text(DYR)
    (tmp_path / "case.toml").write_text(case)
    with pytest.raises(CaseError, match="the event at 60 s never happens") as caught:
        load_case(tmp_path / "case.toml").prepare(["late"])
    assert "not asked for" not in str(caught.value)


def test_the_reference_may_be_named_in_the_case(tmp_path):
    network, none = with_records("BUS", "16.5,3", "16.5,2"), "no bus of the network that is studied"
    assert none in "\n".join(texts(tmp_path, network=network))
    case = CASE.replace('grid = "grid"\n', 'grid = "grid"\nslack = "bus_1"\n')
    assert none not in "\n".join(texts(tmp_path, network=network, case=case))


def test_a_slack_that_values_bring_beyond_its_limits_is_questioned(tmp_path):
    for name, text in (("grid.raw", raw(33)), ("grid.dyr", DYR), ("case.toml", CASE)):
        (tmp_path / name).write_text(text)
    case = load_case(tmp_path / "case.toml")
    less, none = ({f"sg{n}.P_0": 0.0 for n in units} for units in ((3,), (2, 3)))
    within, beyond = (
        "\n".join(map(str, case.prepare(["plain"], v)[0].questions)) for v in (less, none)
    )
    assert "sg1 is the slack and feeds 324.5 MW" in beyond
    assert "beyond its limits, 0 to 247.5 MW" in beyond
    assert "beyond its limits" not in within
    for most, asked in (
        ("71.64", False),
        ("70", True),
    ):  # PG is 60 MW, and the slack feeds what is left
        record = with_records(
            "GENERATOR",
            "1,'1 ',71.64,0,300,-300,1.04,0,247.5,0,0.12,0,0,1,1,100,247.5",
            f"1,'1 ',60,0,300,-300,1.04,0,247.5,0,0.12,0,0,1,1,100,{most}",
        )
        said = "\n".join(texts(tmp_path, network=record))
        assert (f"feeds 71.64 MW, beyond its limits, 0 to {most} MW" in said) is asked


def test_a_misspelt_model_of_the_grid_is_one_error(tmp_path):
    (problem,) = texts(tmp_path, case=CASE.replace('model = "grid"', 'model = "gird"'))
    assert "there is no model 'gird'; did you mean grid" in problem


def test_an_unusual_system_base_is_asked_about(tmp_path):
    asked = "SBASE is 1000 MVA, on which all impedances count; nearly all files have 100 MVA: is it meant?"
    assert any(
        asked in text for text in texts(tmp_path, raw(33).replace("0,100.0,33", "0,1000.0,33"))
    )
    assert not any("SBASE" in text for text in texts(tmp_path))


def test_questions_besides_a_problem_are_told_by_kind(tmp_path):
    dyr = re.sub(r"(9\.55|3\.33|2\.35)([ ,]+)0\.0", r"\1\g<2>40.0", DYR)
    case = CASE.replace('grid = "grid"', 'grid = "grid"\nslack = 7')
    found = texts(tmp_path, dynamics=dyr, case=case)
    (told,) = [text for text in found if "machine.D = 40 pu" in text]
    assert "questioned besides" in told
    assert told.endswith("[and 2 more of this kind (sg2, sg3)]")
