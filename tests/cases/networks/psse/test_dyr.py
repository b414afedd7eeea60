"""Dynamics data of PSS/E: from records to machines of a case, and what is refused."""

import json
import re

import pytest

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from orchestrator.cases.case import load_case
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.core.errors import CaseError, InputError
from tests.cases.networks.psse import raw, records

DYR = """\
// WSCC, figures of Sauer and Pai on the machines' own ratings
1 'GENROU' 1  8.96 0.04 0.31 0.06  9.55 0.0
   0.3614 0.2398 0.1505 0.15 0.12 0.08 0.0 0.0 / hydro in the book
2,'GENROU','1', 6.0,0.04,0.535,0.06, 3.33,0.0, 1.72,1.66,0.23,0.378,0.2,0.1, 0.0,0.0 /
3 'GENCLS' 1  2.35 0.0 /
1 'SEXS' 1  0.1 10.0 100.0 0.05 -5.0 5.0 /
1 'TGOV1' 1  0.05 0.5 1.0 0.0 2.1 7.0 0.0 /
"""
CASE = """\
name = "wscc"
[components.grid]
model = "grid"
[network]
raw = "grid.raw"
stray_B = 0.05
[power_flow]
grid = "grid"
[units]
dyr = "grid.dyr"
generator = "synchronous_generator"
converter = "gfor"
[scenarios.plain]
"""


@pytest.fixture
def tables(tmp_path):
    """Text of a DYR file → the units' tables of the case, or its problems."""

    def build(dyr=DYR, case=CASE, network=None):
        (tmp_path / "grid.raw").write_text(network or raw(33))
        (tmp_path / "grid.dyr").write_text(dyr)
        (tmp_path / "case.toml").write_text(case)
        preparer = load_case(tmp_path / "case.toml")._preparer("plain", None, ())
        if preparer.problems:
            raise CaseError("case", preparer.problems)
        return preparer._everything

    return build


def test_records_become_parts_and_parameters(tables):
    found = tables()
    first, second, third = (found[f"sg{n}"] for n in (1, 2, 3))
    assert (first.machine, first.exciter, first.governor, first.stabilizer) == (
        "genrou",
        "sexs",
        "tgov1",
        "none",
    )
    assert (second.exciter, second.governor) == ("manual", "constant_power")
    assert third.machine == "classical"
    assert first.parameters["machine.H"] == 9.55
    assert first.parameters["machine.X_d"] == 0.3614
    # PSS/E gives the lead as T_A/T_B
    assert first.parameters["exciter.T_A"] == pytest.approx(0.1 * 10.0)
    assert first.parameters["S_n"] == 247.5
    assert third.parameters["machine.X_d1"] == 0.2  # ZX of the RAW file
    assert first.parameters["transformer.X_t"] == 0
    # ZR of the RAW file, and not what the part has by itself
    assert first.parameters["machine.R_s"] == 0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "2.35 0.0 /",
            "2.35 0.0 0.05 /",
            "GENCLS has 3 values, and needs 2: what follows them (0.05)",
        ),
        (
            "2.1 7.0 0.0 /",
            "2.1 7.0 /",
            "TGOV1 has 6 values, and needs 7: the others (Dt) are taken",
        ),
        (
            "2.1 7.0 0.0 /",
            "2.1 7.0 0,0 /",
            "is it so in 0,0? Write 0.0 for 0,0",
        ),
    ],
)
def test_a_record_with_a_value_more_or_less_is_read_and_asked_about(
    old, new, said, tables, tmp_path
):
    whole = tables()
    found = tables(DYR.replace(old, new))
    assert [each.parameters for each in found.values()] == [
        each.parameters for each in whole.values()
    ]
    (ready,) = load_case(tmp_path / "case.toml").prepare(["plain"])
    (asked,) = (str(question) for question in ready.questions if "and needs" in str(question))
    assert said in asked


def test_a_machine_out_of_service_may_have_records(tables, tmp_path):
    found = records(33)
    found["GENERATOR"].append(
        found["GENERATOR"][0].replace("1,'1 '", "1,'2 '").replace(",1,1,100,", ",1,0,100,")
    )
    dyr = DYR + "1 'GENCLS' 2  1.0 0.0 /\n"
    assert set(tables(dyr, network=raw(33, found))) == set(tables())


def test_records_over_lines_with_commas_or_blanks(tmp_path):
    (tmp_path / "grid.dyr").write_text(DYR)
    records = read_dyr(tmp_path / "grid.dyr")
    assert [(r.bus, r.name, len(r.values)) for r in records] == [
        (1, "GENROU", 14),
        (2, "GENROU", 14),
        (3, "GENCLS", 2),
        (1, "SEXS", 6),
        (1, "TGOV1", 7),
    ]
    assert records[0].place.endswith("grid.dyr, line 2")


def test_a_blank_text_among_numbers_is_none(tmp_path):
    """As in the public IEEE39.dyr, where IEEEG1 has no second machine."""
    (tmp_path / "grid.dyr").write_text("1 'IEEEG1' 1 0 '' 20.0 0.25 /\n1 'SEXS' ' ' 0.1 10.0 /\n")
    governor, exciter = read_dyr(tmp_path / "grid.dyr")
    assert governor.values == ("0", "0", "20.0", "0.25")
    assert exciter.values == ("0.1", "10.0")


@pytest.mark.parametrize("comma", [" , ", ",\n  ", "\n  , "])
def test_a_comma_with_blanks_or_the_end_of_a_line_is_one_separator(comma, tmp_path):
    (tmp_path / "grid.dyr").write_text(f"1 'SEXS' 1 0.1 10.0{comma}100.0 0.05 -5.0 5.0 ,, /\n")
    (record,) = read_dyr(tmp_path / "grid.dyr")
    assert record.values == ("0.1", "10.0", "100.0", "0.05", "-5.0", "5.0")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "'SEXS'",
            "'OLDEXC'",
            r"(?s)for these models.*\n +OLDEXC +1 +72 +line 6 .*gfor new --dyr-leave-out OLDEXC",
        ),
        ("3 'GENCLS'", "8 'GENCLS'", r"machine '1' at bus 3 has no record of a machine"),
        ("100.0 0.05", "100.0,, 0.05", r"line 6: SEXS: field 4 \(TE\) is empty: PSS/E's default"),
        ("0.5 1.0 0.0 2.1", "0.5,,0.0 2.1", r"line 7: TGOV1: field 3 \(VMAX\) is empty"),
        ("0.06  9.55", "0.06,\n, 9.55", r"line 2: GENROU: field 5 \(H\) is empty"),
        ("'GENROU' 1  8.96", "'GENROU',, 8.96", r"line 2: .* '1 GENROU' has two commas"),
        ("9.55", "x", r"line 2: GENROU has H = 'x'; it must be a number"),
        ("2.35 0.0 /", "2.35 /", r"line 5: GENCLS has 1 value, and needs 2: H, D"),
        ("7.0 0.0 /", "7.0 0.0", r"grid.dyr, line 7: the record does not end with a slash"),
        ("3 'GENCLS'", "three 'GENCLS'", r"line 5: .* is no record; one is bus 'MODEL' id values"),
        ("3 'GENCLS' 1  2.35 0.0", "3 'TGOV1' 1", r"line 5: TGOV1 has 0 values, and needs 7: R, "),
        (
            "2.35 0.0 /",
            "2.35 0.0",
            r"line 5: the record GENCLS has no slash at its end, and runs into the next, SEXS",
        ),
        (
            "1 'TGOV1'",
            "1 'SEXS'",
            r"line 7: a second exciter of machine '1' at bus 1; the first is SEXS in line 6; remove",
        ),
    ],
)
def test_what_cannot_be_taken_over(old, new, words, tables):
    assert old in DYR
    with pytest.raises((CaseError, InputError), match=words):
        tables(DYR.replace(old, new, 1))


SEXS_AT_3 = "3 'SEXS' 1  0.1 10.0 100.0 0.05 -5.0 5.0 /\n"
UNFINISHED = ("0.08 0.0 0.0 / hydro in the book", "0.08 0.0 0.0")
"""The end of the first record, and the same without its slash."""


def problems_of(tables, dyr, case=CASE):
    with pytest.raises(CaseError) as refused:
        tables(dyr, case)
    return [str(problem) for problem in refused.value.problems]


def test_a_record_that_is_lost_in_another_does_not_lack(tables):
    """Machine 2 has a record, behind that of machine 1, whose slash is forgotten."""
    (said,) = problems_of(tables, DYR.replace(*UNFINISHED))
    assert (
        "line 2: the record GENROU has no slash at its end, and runs into the next, GENROU" in said
    )
    assert "has no record of a machine" not in said


def test_a_record_that_is_lost_in_one_left_out_is_told(tables):
    """Else its machine would silently be none."""
    gencls, sexs = (line for line in DYR.splitlines() if "GENCLS" in line or "SEXS" in line)
    dyr = DYR.replace(f"{gencls}\n", "").replace(sexs, f"{sexs[:-1]}\n{gencls}")
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["SEXS"]')
    (said,) = problems_of(tables, dyr, case)
    assert "the record SEXS has no slash at its end, and runs into the next, GENCLS" in said


@pytest.mark.parametrize(("wrong", "helps"), [("0.1 10.0 100.0", True), ("9.55", False)])
def test_leaving_a_model_out_is_named_only_where_it_helps(wrong, helps, tables):
    """An exciter may go, and a machine's own record may not."""
    (said,) = problems_of(tables, DYR.replace(wrong, f"x{wrong}"))
    assert ("name models that may go" in said) is helps


def test_an_exciter_of_a_classical_machine_is_one_problem_at_its_line(tables):
    (said,) = problems_of(tables, DYR + SEXS_AT_3)
    assert "grid.dyr, line 8: SEXS of machine '1' at bus 3 acts on nothing" in said
    assert """(`gfor new --dyr-leave-out "SEXS at 3"`)""" in said


def test_an_exciter_of_a_classical_machine_goes_at_the_users_word(tables):
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["SEXS at 3"]')
    found = tables(DYR + SEXS_AT_3, case)
    assert (found["sg1"].exciter, found["sg3"].exciter) == ("sexs", "manual")


def test_a_classical_machine_that_a_converter_replaces_may_have_an_exciter(tables):
    case = CASE.replace("[units]", '[units]\nreplace = ["3"]')
    assert "sg3" not in tables(DYR + SEXS_AT_3, case)


def test_a_model_goes_at_the_users_word(tables):
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["OLDEXC"]\nexciter = "sexs"')
    found = tables(DYR.replace("'SEXS'", "'OLDEXC'"), case)
    assert found["sg1"].exciter == "sexs"
    assert found["sg2"].exciter == "sexs"  # it has no record, and [units] says what stands there
    assert found["sg3"].exciter == "manual"  # a classical machine has no field winding


def test_a_model_of_which_the_file_has_no_record_cannot_go(tables):
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["TGOV"]')
    with pytest.raises(
        CaseError, match=r"dyr_leave_out names 'TGOV', of which .* no record; take it"
    ):
        tables(DYR, case)


def test_a_governor_that_goes_leaves_the_power_constant(tables):
    """As the table of missing models says, and as where the file has no record of one."""
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["OLDGOV"]')
    found = tables(DYR.replace("'TGOV1'", "'OLDGOV'"), case)
    assert found["sg1"].governor == found["sg2"].governor == "constant_power"


ESDC2A = "1 'ESDC2A' 1 0.02 50.0 0.05 0.02 0.0 {VRMAX} -3.0 {KE} 0.512 0.07 1.3 0 3.9825 0.5 5.31 1.049 /"
ST2CUT = "1 'ST2CUT' 1 1 0 0 0 10 0 0 0 3 3 0.15 0.05 0.15 0.05 0.15 0.05 0.05 -0.05 0 0 /"


@pytest.mark.parametrize(("KE", "ceiling"), [(0, 1.049 * 5.31), (1, (1.049 + 1) * 5.31)])
def test_a_ceiling_of_zero_is_the_one_that_holds_the_second_point_of_saturation(
    tables, KE, ceiling
):
    values = tables(_with_exciter(ESDC2A.format(VRMAX=0, KE=KE)))["sg1"].parameters
    assert values["exciter.V_RMAX"] == pytest.approx(ceiling)
    assert values["exciter.V_RMIN"] == pytest.approx(-ceiling)
    assert values["exciter.K_E_of_start"] == (KE == 0)


def test_a_given_ceiling_stays(tables):
    values = tables(_with_exciter(ESDC2A.format(VRMAX=6, KE=1)))["sg1"].parameters
    assert (values["exciter.V_RMAX"], values["exciter.V_RMIN"]) == (6, -3)


def test_an_exciter_that_goes_takes_its_stabilizer_along(tables):
    dyr = _with_exciter(f"{ESDC2A.format(VRMAX=6, KE=1)}\n{ST2CUT}")
    case = CASE.replace("[units]", '[units]\ndyr_leave_out = ["ESDC2A"]')
    alone = tables(dyr, case)["sg1"]
    assert (alone.exciter, alone.stabilizer) == ("manual", "none")
    own = case.replace("[scenarios.plain]", '[components.sg1]\nexciter = "sexs"\n[scenarios.plain]')
    assert tables(dyr, own)["sg1"].stabilizer == "st2cut"


def _with_exciter(records):
    found = re.search(r"1 'SEXS'.*/", DYR)
    return DYR.replace(found[0], records)


@pytest.mark.slow
def test_the_machines_swing(tables, tmp_path, gfor):
    tables()
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json", "--range", "0.5:5")
    assert code == 0, error
    modes = json.loads(out)["scenarios"][0]["modes"]
    assert len([m for m in modes if 0.8 < m["frequency_hz"] < 3]) == 2


def test_only_the_switches_that_are_modelled_are_taken():
    """M = 5 and N = 1 are the ramp-tracking filter of a stabilizer, whose signals are all six of PSS/E."""
    switches = {f.name: f.only for record in DYR_RECORDS.values() for f in record.fields if f.only}
    assert {name: switches[name] for name in ("IM", "M", "N", "Switch")} == {
        "IM": tuple(range(1, 7)),
        "M": (5.0,),
        "N": (1.0,),
        "Switch": (0.0,),
    }
