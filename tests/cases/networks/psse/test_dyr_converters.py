"""Converters in dynamics data: REGFM_A1 as a component of its own, grid-following ones at the user's word."""

import json

import pytest

from fmus.regfm_a1.dyr_records import REGFM_A1_RECORDS
from fmus.toolchain.catalogue import build_model
from orchestrator.cases.case import load_case
from orchestrator.cases.networks.psse.dyr_mistakes import records_unfit
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_dyr import CASE, DYR

REGFM = (
    "3 'REGFMA1' 1  1 0  0.02 0.03 0.04  1.8 1.15 0.0  0.95 -0.9  0.44 -0.4  0.02 0.06  "
    "0.05 0.2  3.0 20.0  0.0 5.86 /"
)
MACHINES = DYR.replace("3 'GENCLS' 1  2.35 0.0 /", REGFM)
PHASORS = CASE.replace('"grid"\n[network]', '"phasor_grid"\n[network]').replace(
    '"synchronous_generator"', '"synchronous_generator_phasor"'
)


@pytest.fixture
def tables(tmp_path):
    """Text of a DYR file and of a case → tables of the units, or the problems."""

    def build(dyr=MACHINES, case=PHASORS, overrides=None):
        found = records(33)
        found["GENERATOR"][2] = (
            "3,'1 ',85.0,0,300,-300,1.025,0,128.0,0.01,0.15,0,0,1,1,100,128.0,0,1,1"
        )
        (tmp_path / "grid.raw").write_text(raw(33, found))
        (tmp_path / "grid.dyr").write_text(dyr)
        (tmp_path / "case.toml").write_text(case)
        preparer = load_case(tmp_path / "case.toml")._preparer("plain", overrides, ())
        if preparer.problems:
            raise CaseError("case", preparer.problems)
        return preparer._everything

    return build


def test_regfm_a1_is_the_whole_unit_with_its_own_values(tables):
    found = tables()
    unit = found["gfor3"]
    assert "sg3" not in found
    assert (unit.model, unit.bus) == ("regfm_a1_phasor", "bus_3")
    assert (unit.parameters["RL"], unit.parameters["XL"]) == (0.01, 0.15)  # ZSORCE
    assert unit.parameters["VFlag"] is True
    assert [
        unit.parameters[name]
        for name in ("TPf", "TQf", "TVf", "ImaxF", "Pmax", "Pmin", "Qmin", "mp", "mq")
    ] == [0.02, 0.03, 0.04, 1.8, 0.95, -0.9, -0.4, 0.02, 0.06]
    assert [
        unit.parameters[name] for name in ("kppmax", "kipmax", "kpqmax", "kiqmax", "kpv", "kiv")
    ] == [0.05, 0.2, 3.0, 20.0, 0.0, 5.86]
    assert unit.parameters["S_n"] == 128.0
    assert found["sg1"].machine == "genrou"


def test_gridpack_s_record_is_the_same_unit(tables):
    """GDFORM has REGFMA1's values but for QVFlag, in the order of GridPACK's reader."""
    same = (
        "3 'GDFORM' 1  0.06 0.0 5.86 0.02 0.05 0.2 0.95 -0.9 1.15 0.0 0.02 1.8 0.44 -0.4 3.0 20.0 "
        "0.03 0.04 1 /"
    )
    found, wanted = tables(MACHINES.replace(REGFM, same))["gfor3"], tables()["gfor3"]
    assert (found.model, found.parameters) == (wanted.model, wanted.parameters)


@pytest.mark.parametrize(("name", "count"), [("REGFMA1", 20), ("GDFORM", 19)])
def test_every_field_sets_a_parameter_of_the_model(name, count):
    record = REGFM_A1_RECORDS[name]
    known = {v.name for v in build_model(record.part).parameters}
    assert {p for field in record.fields for p in field.parameters} <= known
    assert len(record.fields) == count


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "'REGFMA1' 1  1 0",
            "'REGFMA1' 1  1",
            r"REGFMA1 has 19 values, and needs 20: VFlag, QVFlag, TPf",
        ),
        (
            "'REGFMA1' 1  1 0",
            "'REGFMA1' 1  2 0",
            r"REGFMA1 has VFlag = 2; only 0 or 1 can be modelled",
        ),
        (
            "1 'TGOV1'",
            "3 'TGOV1'",
            r"machine '1' at bus 3 is a converter, and has records of its governor; remove",
        ),
        (
            "'REGFMA1'",
            "'REGCA1'",
            r"REGCA1 has 20 values, and needs 15: Lvplsw, Tg, Rrpwr",
        ),
        (
            "'REGFMA1'",
            "'WT4G2'",
            r"stands for WT4G2, a grid-following converter; write replace = ",
        ),
        (
            "'REGFMA1'",
            "'REGFM_C1'",
            r"of whose fields no public .* replace = \['3'\] .* converter = \"regfm_c1_phasor\"",
        ),
    ],
)
def test_what_cannot_be_taken_over(old, new, words, tables):
    assert old in MACHINES
    with pytest.raises(CaseError, match=words):
        tables(MACHINES.replace(old, new))


def test_the_remedy_for_a_record_of_no_public_order_works_as_it_is_typed(tables):
    typed = '[units]\nreplace = ["3"]\nconverter_parameters = { mp = 0.03 }'
    case = PHASORS.replace("[units]", typed).replace('"gfor"', '"regfm_c1_phasor"')
    found = tables(MACHINES.replace("'REGFMA1'", "'REGFM_C1'"), case)
    assert found["gfor3"].model == "regfm_c1_phasor"
    assert found["gfor3"].parameters["mp"] == 0.03
    assert "sg3" not in found


def test_the_share_of_a_converter_by_its_record_cannot_be_chosen(tables):
    assert tables(overrides={"units.alpha": 0.2})["gfor1"].model == "gfor"
    with pytest.raises(
        CaseError,
        match=r"units.alpha.3: the unit '3' is a converter by its record \(regfm_a1_phasor\)",
    ):
        tables(overrides={"units.alpha.3": 0.5})


def test_a_grid_following_unit_is_a_converter_of_the_case(tables):
    case = PHASORS.replace("[units]", '[units]\ndyr_leave_out = ["REGCA1", "REECA1"]').replace(
        '"gfor"', '"gfl_phasor"'
    )
    dyr = DYR.replace("3 'GENCLS' 1  2.35 0.0 /", "3 'REGCA1' 1 0.02 /\n3 'REECA1' 1 0 /")
    found = tables(dyr, case, {"units.alpha.3": 1.0})
    assert found["gfor3"].model == "gfl_phasor"
    assert "sg3" not in found
    with pytest.raises(CaseError, match="machine '1' at bus 3 has no record of a machine"):
        tables(dyr, case)


BARE = DYR.replace("3 'GENCLS' 1  2.35 0.0 /", "")
SHARE = "85 of 320 MW (26.6 %)"  # of 72, 163 and 85 MW
STATIC = '[units]\ndyr_leave_out = ["machine without record"]'


def test_a_machine_without_a_record_may_be_a_constant_current(tables, tmp_path):
    with pytest.raises(CaseError, match="machine '1' at bus 3 has no record") as refused:
        tables(BARE, PHASORS)
    assert f"no record of a machine, which feeds {SHARE}; add one" in str(refused.value)
    assert "dyr_leave_out = ['machine without record'] in [units]" in str(refused.value)
    assert '`gfor new --dyr-leave-out "machine without record"`' in str(refused.value)
    found = tables(BARE, PHASORS.replace("[units]", STATIC))
    unit = found["gfor3"]
    assert "sg3" not in found
    assert (unit.model, unit.bus) == ("static_generation_phasor", "bus_3")
    assert unit.parameters == {"S_n": 128.0, "P_0": 85.0 / 128.0, "v_0": 1.025}
    (asked,) = (
        str(q)
        for q in load_case(tmp_path / "case.toml").prepare(["plain"])[0].questions
        if "no record of the machine" in str(q)
    )
    assert "gfor3: no record of the machine, whose power is taken as a constant current" in asked
    assert f"adds no inertia; all such machines feed {SHARE}; add its records" in asked
    assert 'meant = ["gfor3.machine"]' in asked


def test_only_a_machine_without_any_record_may_be_one(tables):
    exciter = "3 'SEXS' 1 0.1 10.0 100.0 0.05 -5.0 5.0 /\n"
    with pytest.raises(CaseError, match="machine '1' at bus 3 has no record") as refused:
        tables(BARE + exciter, PHASORS)
    assert "machine without record" not in str(refused.value)
    with pytest.raises(CaseError, match="'machine without record', and every machine has"):
        tables(DYR, PHASORS.replace("[units]", STATIC))


def test_many_machines_without_a_record_are_one_problem_with_one_remedy():
    bare = {(bus, "1"): {} for bus in range(1, 12)}
    labels = {(bus, "1"): str(bus) for bus, _ in bare}
    powers = dict.fromkeys(bare, 10.0) | {(20, "1"): 330.0}
    (said,) = records_unfit(bare, (), labels, (), powers, bare)
    assert said.startswith("11 machines have no record of a machine ('1' at bus 1, '1' at bus 2, ")
    assert "'1' at bus 8 and 3 more), which feed 110 of 440 MW (25.0 %); add them, or write" in said
    assert said.endswith(
        '(`gfor new --replace "machine without record"`), and a converter of ours stands in the place of each'
    )


REPLACED = STATIC.replace("dyr_leave_out", "replace")


def test_all_machines_without_a_record_are_replaced_by_one_word(tables):
    found = tables(BARE, PHASORS.replace("[units]", REPLACED))
    assert "sg3" not in found
    assert (found["gfor3"].model, found["gfor3"].bus) == ("gfor", "bus_3")
    assert "gfor1" not in found


@pytest.mark.parametrize(
    ("dyr", "units", "words"),
    [
        (DYR, REPLACED, "units.replace: 'machine without record', and every machine has a record"),
        (
            BARE + "3 'SEXS' 1 0.1 10.0 100.0 0.05 -5.0 5.0 /\n",
            REPLACED,
            "units.replace: 'machine without record', and every machine has a record",
        ),
        (
            BARE,
            '[units]\nreplace = ["machines without records"]',
            "no unit 'machines without records'; did you mean machine without record?",
        ),
        (
            "",
            REPLACED,
            "units.replace: 'machine without record' is of a file of dynamics data, 'dyr'",
        ),
    ],
)
def test_a_word_for_machines_without_a_record_that_fits_none_is_refused(dyr, units, words, tables):
    case = PHASORS if dyr else PHASORS.replace('dyr = "grid.dyr"\n', "")
    with pytest.raises(CaseError, match=words):
        tables(dyr or DYR, case.replace("[units]", units))


@pytest.mark.slow
def test_the_system_with_regfm_a1_has_a_steady_state_and_modes(tables, tmp_path, gfor):
    tables(
        case=PHASORS.replace("[components.grid]", '[solver]\nstep_size = "2 ms"\n[components.grid]')
    )
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert any("gfor3" in str(mode) for mode in scenario["modes"])
