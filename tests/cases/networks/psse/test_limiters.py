"""Limiters of excitation in dynamics data: parts of their machines, or not used because their exciter does not hear."""

import tomllib
from pathlib import Path

import pytest

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from orchestrator.cases.networks.psse import missing_models
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.dyr_uses import record_uses
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.psse.unused_models import unused_models
from orchestrator.cases.networks.record_use import UseOfRecord

GENROU = "1 'GENROU' 1 8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /\n"
MAXEX1 = "1 'MAXEX1' 1 2.5 1.1 120 1.2 40 1.5 15 1.0 0.002 -0.5 /\n"
MAXEX2 = "1 'MAXEX2' 1 0 2.5 1.1 120 1.2 40 1.5 15 1.0 0.002 -0.5 /\n"
MNLEX2 = "1 'MNLEX2' 1 0.1 1 0.3 0.5 0.1 2.5 3 /\n"
UEL1 = "1 'UEL1' 1 1.95 1.38 0 5.8 5.8 0 100 18 -18 0 0.05 0 0 18 {} /\n"
SEXS = "1 'SEXS' 1 0.1 10 100 0.1 0 5 /\n"
ESST1A = "1 'ESST1A' 1 {} 1 0.01 99 -99 0 0 0 0 100 0.02 9 -9 9 -9 0 0 1 0 0 /\n"
ESAC1A = "1 'ESAC1A' 1 0.01 0 0 100 0.02 9 -9 0.8 0.03 1 0.2 0.38 1 4.18 0.1 3.14 0.03 6 -5 /\n"


def read(tmp_path, text, leaving_out=()):
    place = tmp_path / "grid.dyr"
    place.write_text(text)
    records = read_dyr(place)
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    model = machine_models(records, [machine], leaving_out)[1, "1"]
    uses = record_uses(records, {(1, "1")}, (), leaving_out)
    return model, uses, unused_models(records, uses)


def test_a_limiter_is_a_part_with_its_fields_in_the_files_order(tmp_path):
    model, uses, asked = read(tmp_path, GENROU + SEXS + MAXEX2 + MNLEX2)
    assert (model.parts["oel"], model.parts["uel"]) == ("maxex2", "mnlex2")
    own = {n: x for n, x in model.parameters.items() if n.startswith(("oel.", "uel."))}
    assert own == {
        "oel.of_current": 0,
        "oel.EFDRATED": 2.5,
        "oel.EFD1": 1.1,
        "oel.TIME1": 120,
        "oel.EFD2": 1.2,
        "oel.TIME2": 40,
        "oel.EFD3": 1.5,
        "oel.TIME3": 15,
        "oel.EFDDES": 1.0,
        "oel.KMX": 0.002,
        "oel.VLOW": -0.5,
        "uel.K_F2": 0.1,
        "uel.T_F2": 1,
        "uel.K_M": 0.3,
        "uel.T_M": 0.5,
        "uel.MELMAX": 0.1,
        "uel.Q_0": 2.5,
        "uel.R": 3,
    }
    assert {use.use for use in uses} == {UseOfRecord.USED}
    assert asked == []


POINTS = "-0.2 0.01 0.2 0.02 0.6 0.03 1 0.04" + 14 * " 0"
UEL2C = (
    f"{{begin}} 2 2 1 2 0.02 0.03 0.025 0.4 0.8 0.5 -0.2 {{kuf}} 0 0.08 0.02 0.07 0.015 0.06 {POINTS} "
    "0.6 -0.3 0.95 0.9 0.1 0.04 0.55 -0.25 0.5 -0.2 0.6 /\n"
)
"""Constants of UEL2C as a test of InterPSS has them (`Uel2cLimiterTest`)."""


@pytest.mark.parametrize("begin", ["1 'UEL2C' 1", "1 'USRMDL' 1 'UEL2CU1' 9 0 4 47 9 2"])
def test_uel2c_has_its_fields_in_the_order_of_interpss(begin, tmp_path):
    model, _, asked = read(tmp_path, GENROU + SEXS + UEL2C.format(begin=begin, kuf=0))
    assert asked == []
    own = {n.removeprefix("uel."): x for n, x in model.parameters.items() if n.startswith("uel.")}
    assert model.parts["uel"] == "uel2c"
    first = {"k_1": 2, "k_2": 2, "M": 1, "SW": 2, "T_UV": 0.02, "K_UI": 0.4, "K_UL": 0.8}
    points = {"P0": -0.2, "Q0": 0.01, "P3": 1, "Q3": 0.04, "P4": 0, "Q10": 0, "T_U4": 0.06}
    end = {"V_ULMAX": 0.6, "V_ULMIN": -0.3, "V_bias": 0.95, "K_fix": 0.9, "X_q": 0.6}
    wanted = first | points | end | {"V_UELMAX2": 0.55, "V_UELMIN1": -0.2, "T_Qref": 0.04}
    assert {name: own[name] for name in wanted} == wanted
    model, _, _ = read(tmp_path, GENROU + SEXS + UEL2C.format(begin=begin, kuf=0.1))
    assert any("has KUF = 0.1" in doubt.text for doubt in model.doubts)


UEL2 = (
    f"1 'UEL2' 1 2 1 1 0.02 0.03 0.025 0.4 0.8 0.5 -0.2 0 {{kfb}} 0.08 0.02 0.07 0.015 0.06 {POINTS} "
    "0.6 -0.3 /\n"
)


def test_uel2_has_pss_e_icons_first_and_then_uel2c_s_fields(tmp_path):
    model, _, asked = read(tmp_path, GENROU + SEXS + UEL2.format(kfb=0))
    own = {n.removeprefix("uel."): x for n, x in model.parameters.items() if n.startswith("uel.")}
    assert model.parts["uel"] == "uel2"
    wanted = {"k_1": 2, "k_2": 1, "M": 1, "T_UV": 0.02, "T_UP": 0.03, "K_UI": 0.4, "K_UL": 0.8}
    wanted |= {"T_U1": 0.02, "T_U4": 0.06, "P0": -0.2, "Q3": 0.04, "V_ULMAX": 0.6, "V_ULMIN": -0.3}
    assert {name: own[name] for name in wanted} == wanted
    assert asked == []
    model, _, _ = read(tmp_path, GENROU + SEXS + UEL2.format(kfb=0.3))
    assert any("UEL2 has KFB = 0.3" in doubt.text for doubt in model.doubts)


OEL2C = (
    "{input} 1 .015 .08 .02 .10 .35 .8 .01 .08 0 -1 0 -1 {most} -1 0 .12 .4 .04 .7 .02 1.02 .9 1.45 "
    "1.10 .05 1.8 .2 2 .05 .5 -.5 1 -1 .2 1 0 0 -2 2 .1 {rated} /\n"
)
"""Constants of OEL2C as a test of InterPSS has them (`Oel2cLimiterTest`)."""


@pytest.mark.parametrize("begin", ["1 'OEL2C' 1 ", "1 'USRMDL' 1 'OEL2CU1' 10 0 2 41 8 8 "])
def test_oel2c_has_its_fields_in_the_order_of_interpss(begin, tmp_path):
    record = begin + OEL2C.format(input=2, most=0, rated=1)
    model, _, asked = read(tmp_path, GENROU + SEXS + record)
    own = {n.removeprefix("oel."): x for n, x in model.parameters.items() if n.startswith("oel.")}
    assert model.parts["oel"] == "oel2c"
    stages = {"input": 2, "SW": 1, "T_C1": 0.015, "T_B1": 0.08, "T_C2": 0.02, "T_B2": 0.1}
    control = {"K_P": 0.35, "K_I": 0.8, "K_D": 0.01, "T_D": 0.08, "V_OELMIN3": -1, "V_OELMIN1": -1}
    latch = {"I_reset": 0, "T_en": 0.12, "T_off": 0.4, "I_THoff": 0.04, "K_scale": 0.7}
    limits = {"T_R": 0.02, "K_act": 1.02, "I_TFpu": 0.9, "I_inst": 1.45, "I_lim": 1.1, "T_A": 0.05}
    time = {"c_1": 1.8, "K_1": 0.2, "c_2": 2, "K_2": 0.05, "V_INVMAX": 0.5, "V_INVMIN": -0.5}
    timer = {"FIXED_ru": 1, "FIXED_rd": -1, "T_FCL": 0.2, "T_max": 1, "T_min": 0, "K_FB": 0}
    wanted = stages | control | latch | limits | time | timer
    wanted |= {"K_rd": -2, "K_ru": 2, "K_ZRU": 0.1}
    assert {name: own[name] for name in wanted} == wanted
    assert len(own) == 42
    assert asked == []
    assert not [doubt for doubt in model.doubts if doubt.variable.startswith("oel")]


@pytest.mark.parametrize(
    ("values", "variable", "said"),
    [
        ({"input": 3, "most": 0, "rated": 1}, "oel.input", "has INPUT = 3, and 1 is the field"),
        ({"input": 1, "most": 0, "rated": 2.5}, "oel.K_scale", "has IFDRATED = 2.5, which no"),
    ],
)
def test_what_oel2c_cannot_stand_for_is_asked_about(values, variable, said, tmp_path):
    model, _, _ = read(tmp_path, GENROU + SEXS + "1 'OEL2C' 1 " + OEL2C.format(**values))
    (doubt,) = (one for one in model.doubts if one.variable.startswith("oel"))
    assert doubt.variable == variable
    assert said in doubt.text


def test_an_oel2c_of_a_gate_beside_an_exciter_that_adds_is_asked_about(tmp_path):
    record = "1 'OEL2C' 1 " + OEL2C.format(input=1, most=10, rated=1).replace(
        "0 -1 0 -1 10", "99 -9 99 -9 10"
    )
    model, _, _ = read(tmp_path, GENROU + SEXS + record)
    (doubt,) = (one for one in model.doubts if one.variable == "oel.V_OELMAX1")
    assert doubt.text.startswith("OEL2C rests at up to 10 pu, and its exciter adds that")


OEL3C = "1 'OEL3C' 1 {input} 1.05 0.5 0.03 {exponent} 1.2 12 0.8 0.4 -0.9 {most} -0.7 /\n"


def of_oel3c(tmp_path, **changed):
    values = {"input": 1, "exponent": 2, "most": 0} | changed
    return read(tmp_path, GENROU + SEXS + OEL3C.format(**values))


def test_oel3c_has_its_fields_in_the_order_of_powerworld_s_help(tmp_path):
    model, uses, asked = of_oel3c(tmp_path)
    own = {n.removeprefix("oel."): x for n, x in model.parameters.items() if n.startswith("oel.")}
    assert model.parts["oel"] == "oel3c"
    assert own == {
        "input": 1,
        "I_TFpu": 1.05,
        "K_scale": 0.5,
        "T_F": 0.03,
        "K_1": 2,
        "K_oel": 1.2,
        "T_oel": 12,
        "K_P": 0.8,
        "V_OELMAX1": 0.4,
        "V_OELMIN1": -0.9,
        "V_OELMAX2": 0,
        "V_OELMIN2": -0.7,
    }
    assert {use.use for use in uses} == {UseOfRecord.USED}
    assert asked == []
    assert not [doubt for doubt in model.doubts if doubt.variable.startswith("oel")]


@pytest.mark.parametrize(
    ("values", "variable", "said"),
    [
        ({"input": 0}, "oel.input", "OEL3C has INPUT = 0, and only of 1, the field voltage"),
        ({"input": 2}, "oel.input", "OEL3C has INPUT = 2, and only of 1, the field voltage"),
        ({"exponent": 0.02}, "oel.K_1", "OEL3C has K1 = 0.02, an exponent below 1"),
        ({"most": 9}, "oel.V_OELMAX1", "OEL3C rests at up to 0.4 pu, and its exciter adds that"),
    ],
)
def test_what_is_doubtful_in_an_oel3c_is_asked_about(values, variable, said, tmp_path):
    model, _, _ = of_oel3c(tmp_path, **values)
    (doubt,) = (one for one in model.doubts if one.variable.startswith("oel"))
    assert doubt.variable == variable
    assert doubt.text.startswith(said)


OEL4C = "1 'OEL4C' 1 {} {} 0.4 0.02 -0.1 /\n"
STAYS = "OEL4C has TDELAY = 12 s, with which it does not let go by itself in Dynawo's diagram"


@pytest.mark.parametrize(
    ("given", "delay", "taken", "said"),
    [
        (0.6, 0, 0.6, ()),
        (0.6, 12, 0.6, (STAYS,)),
        (0, 0, 90.0, ("OEL4C has QREF = 0, for which PowerWorld takes the greatest",)),
        (60, 0, 60, ("OEL4C has QREF = 60, which is per unit of MBASE",)),
    ],
)
def test_oel4c_has_its_fields_in_order_and_its_limit_from_the_raw_file_where_it_is_0(
    given, delay, taken, said, tmp_path
):
    model, uses, asked = read(tmp_path, GENROU + SEXS + OEL4C.format(given, delay))
    own = {n.removeprefix("oel."): x for n, x in model.parameters.items() if n.startswith("oel.")}
    assert model.parts["oel"] == "oel4c"
    assert own == {"Q_ref": taken, "T_delay": delay, "K_P": 0.4, "K_I": 0.02, "V_min": -0.1}
    assert {use.use for use in uses} == {UseOfRecord.USED}
    assert asked == []
    doubts = [doubt.text for doubt in model.doubts if doubt.variable.startswith("oel")]
    assert len(doubts) == len(said)
    assert all(text.startswith(start) for text, start in zip(doubts, said, strict=True))


def used(tmp_path, *texts):
    model, uses, asked = read(tmp_path, GENROU + "".join(texts))
    by_name = {use.kind: use.use for use in uses}
    assert {kind for kind in ("oel", "uel") if kind in model.parts} == {
        DYR_RECORDS[name].kind
        for name, use in by_name.items()
        if use is UseOfRecord.USED and DYR_RECORDS[name].kind in ("oel", "uel")
    }
    prefixes = {name.partition(".")[0] for name in model.parameters}
    assert prefixes & {"oel", "uel"} == {*model.parts} & {"oel", "uel"}
    return {*model.parts} & {"oel", "uel"}, [one.text for one in asked]


@pytest.mark.parametrize(
    ("exciter", "heard"),
    [
        (SEXS, {"oel", "uel"}),
        (ESST1A.format(1), {"uel"}),
        (ESST1A.format(4), set()),
        (ESAC1A, {"uel"}),
    ],
    ids=["sums both", "sums the lower", "by its field at a gate", "a gate"],
)
def test_a_limiter_acts_where_its_exciter_adds_its_signal(exciter, heard, tmp_path):
    found, asked = used(tmp_path, exciter, MAXEX1, MNLEX2)
    assert found == heard
    assert len(asked) == 2 - len(heard)
    for text in asked:
        assert "whose signal its exciter does not take where gfor's limiters act" in text


@pytest.mark.parametrize(
    ("exciter", "gate"), [(ESST1A.format(2), 1), (ESST1A.format(3), 2), (ESAC1A, 2), (SEXS, None)]
)
def test_a_limiter_acts_at_the_gate_of_its_exciter(exciter, gate, tmp_path):
    model, _, _ = read(tmp_path, GENROU + exciter + UEL1.format("-18"))
    assert model.parts["uel"] == "uel1"
    assert model.parameters.get("uel.gate") == gate


@pytest.mark.parametrize(
    ("exciter", "least", "asked"), [(SEXS, "-18", True), (SEXS, "0", False), (ESAC1A, "-18", False)]
)
def test_a_limiter_that_rests_below_zero_at_a_sum_is_asked_about(exciter, least, asked, tmp_path):
    model, _, _ = read(tmp_path, GENROU + exciter + UEL1.format(least))
    told = [doubt.text for doubt in model.doubts if doubt.variable == "uel.V_ULMIN"]
    assert len(told) == asked
    for text in told:
        assert text.startswith("UEL1 rests at -18 pu, and its exciter adds that to the voltage")


def test_the_input_of_uel1_that_is_left_out_is_asked_about(tmp_path):
    record = UEL1.format("-18").replace("1.95 1.38 0 ", "1.95 1.38 3.3 ")
    model, _, _ = read(tmp_path, GENROU + ESAC1A + record)
    assert any("UEL1 has KUF = 3.3: the input of the exciter's" in d.text for d in model.doubts)


@pytest.mark.parametrize(
    ("points", "aim", "variables"),
    [
        ("1.1 120 1.2 40 1.5 15", 1.0, []),
        ("1.1 120 1.1 120 1.1 120", 1.1, []),
        ("1.5 15 1.2 40 1.1 120", 1.0, ["oel.EFD1"]),
        ("1.1 15 1.2 40 1.5 120", 1.0, ["oel.TIME1"]),
        ("1.1 120 1.2 40 1.5 15", 1.3, ["oel.EFDDES"]),
    ],
    ids=["as typed", "one point", "out of order", "time rises", "aims beyond"],
)
@pytest.mark.parametrize("start", ["1 'MAXEX1' 1", "1 'MAXEX2' 1 0"])
def test_an_inverse_time_that_contradicts_itself_is_asked_about(
    start, points, aim, variables, tmp_path
):
    record = f"{start} 2.5 {points} {aim} 0.002 -0.5 /\n"
    model, _, _ = read(tmp_path, GENROU + SEXS + record)
    asked = [doubt for doubt in model.doubts if doubt.variable.startswith("oel.")]
    assert [doubt.variable for doubt in asked] == variables
    assert all(doubt.text.startswith(record.split("'")[1]) for doubt in asked)


def test_a_second_limiter_of_one_kind_is_refused(tmp_path):
    with pytest.raises(Exception, match="a second oel of machine '1' at bus 1"):
        read(tmp_path, GENROU + SEXS + MAXEX1 + MAXEX2)


def test_a_limiter_beside_no_exciter_is_not_used(tmp_path):
    _, uses, _ = read(tmp_path, GENROU + MAXEX1)
    assert [(use.use, use.why) for use in uses][1] == (
        UseOfRecord.NOT_USED,
        "its machine has no exciter",
    )


def test_a_limiter_that_may_go_is_left_out(tmp_path):
    model, uses, _ = read(tmp_path, GENROU + SEXS + MAXEX1, ["MAXEX1"])
    assert "oel" not in model.parts
    assert uses[-1].why == "dyr_leave_out names it"


@pytest.mark.parametrize(
    ("name", "reason", "typed"),
    [
        ("MNLEX1", "no public source gives its diagram", "--set sg1.uel=mnlex2"),
        ("OEL5C", "no public source gives the order of its fields", "--set sg1.oel=maxex2"),
        ("SCL1C", "no public source gives the order of its fields", "--set sg1.oel=maxex2"),
    ],
)
def test_a_limiter_that_rests_is_told_with_the_reason_and_one_that_acts(
    name, reason, typed, tmp_path
):
    _, _, asked = read(tmp_path, GENROU + SEXS + f"1 '{name}' 1 1 2 3 /\n")
    (question,) = asked
    assert f"{name} is a limiter of excitation, taken to rest" in str(question)
    assert reason in str(question)
    assert typed in str(question)


def test_each_limiter_without_a_part_has_a_reason():
    table = Path(missing_models.__file__).with_name("model_names.toml").read_text("utf-8")
    names = {*tomllib.loads(table)["limiter"].split()} - {*DYR_RECORDS}
    assert {name for name in names if missing_models.reason_of_limiter(name)} == names
