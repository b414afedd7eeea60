"""WECC's generic plants in dynamics data: REGCA1 with REECA1 or REECB1, and REPCA1, as models of their own."""

import json
import re

import pytest
import xarray as xr

from fmus.wecc_renewable.dyr_records import PLANT_RECORDS
from orchestrator.cases.case import load_case, with_protection
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse.test_dyr_following import REGCA1, dyr, prepared, record
from tests.support.mill import mill_case

pytestmark = pytest.mark.usefixtures("undrawn")

__all__ = ["prepared"]  # the fixture
PLANT = (
    "3 'REPCA1' 1 0 0 0 '{}' 0 0 1 0.02 18 5 0 0.05 0 0 0 0.02 0.1 -0.1 -1 1 0.43 -0.43 1 0.05 0.25 "
    "-1 1 99 -99 1 0 0.1 20 10 /\n"
)
VOLTAGES = {"Brkpt": 0.9, "Zerox": 0.4, "Lvpl1": 1.22, "Volim": 1.2, "Lvpnt1": 0.8, "Lvpnt0": 0.4}


def elsewhere(point, circuit="1"):
    """The record of a controller that measures at a bus and a branch."""
    return PLANT.format(circuit).replace(f"0 0 0 '{circuit}'", f"{point} '{circuit}'")


def plausible(text):
    """The text with voltages in REGCA1."""
    return text.replace(record("REGCA1", REGCA1), record("REGCA1", REGCA1, **VOLTAGES))


TABLES = {"Vq1": 0.2, "Iq1": 1.0, "Vq4": 1.1, "Iq4": 1.2}


def unit(ready):
    return ready.system.components["gfor3"]


@pytest.mark.parametrize("electrical", ["REECA1", "REECB1"])
def test_records_are_the_whole_unit_with_its_own_values(electrical, prepared):
    more = {"Thld": 0.1, **TABLES} if electrical == "REECA1" else {}
    own = {"Iqh1": 1.1, "QFLAG": 1, "VMAX": 1.1, "VMIN": 0.9, "Vdip": 0.8, "Vup": 1.2, **more}
    ready = prepared(dyr(electrical, **own), "")
    plan = unit(ready)
    assert plan.description.model_name == "regca1_phasor"
    assert {
        "Tg": 0.02,
        "Lvplsw": True,
        "Khv": 0.7,
        "electrical.QFLAG": True,
        "electrical.VFLAG": False,
        "electrical.Kvi": 40,
        "electrical.Iqh1": 1.1,
        "S_n": 128.0,
    }.items() <= plan.parameters.items()
    assert ("electrical.only_in_dips" in plan.parameters) == (electrical == "REECB1")
    assert plan.parameters.get("electrical.Iq4", 1.2) == 1.2


def test_repcta1_is_repca1_under_the_name_it_has_beside_turbines_of_type_3(prepared):
    """PowerWorld's help says so, and a national system's file has as many values under either name."""
    plain, of_wind = PLANT.format(""), PLANT.format("").replace("REPCA1", "REPCTA1")
    found, wanted = (unit(prepared(dyr(plant=text), "")) for text in (of_wind, plain))
    assert found.description.model_name == wanted.description.model_name == "regca1_repca1_phasor"
    assert found.parameters == wanted.parameters


def test_repcta1_keeps_its_own_name_in_what_is_said_and_typed(prepared):
    of_wind = PLANT.format("").replace("REPCA1", "REPCTA1")
    ready = prepared(dyr(plant=of_wind), 'dyr_leave_out = ["REPCTA1"]')
    assert unit(ready).description.model_name == "regca1_phasor"
    assert any("REPCTA1 left out, as dyr_leave_out says" in q.text for q in ready.questions)
    assert [use.why for use in ready.records if use.kind == "REPCTA1"] == ["dyr_leave_out names it"]
    with pytest.raises(CaseError, match=r"REPCTA1 measures at bus 12, .*dyr-leave-out REPCTA1"):
        prepared(dyr(plant=elsewhere("12 0 0").replace("REPCA1", "REPCTA1")), "")
    with pytest.raises(CaseError, match=r"names 'REPCA1', of which the file has no record"):
        prepared(dyr(plant=of_wind), 'dyr_leave_out = ["REPCA1"]')


@pytest.mark.parametrize("circuit", ["0 ", "1", "A", ""])
def test_a_plant_controller_is_a_part_of_it(circuit, prepared):
    plan = unit(prepared(dyr(plant=PLANT.format(circuit)), ""))
    assert plan.description.model_name == "regca1_repca1_phasor"
    assert plan.parameters["plant.Fflag"] is True
    assert (plan.parameters["plant.Ddn"], plan.parameters["plant.Dup"]) == (20, 10)


@pytest.mark.parametrize(
    ("point", "bus", "branch", "ends"),
    [
        ("9 3 9", "bus_9", "line_9_3", (3, 9)),  # the transformer stands as 9-3 in the file
        ("9 9 8", "bus_9", "line_8_9", (9, 8)),
        ("0 8 9", "bus_3", "line_8_9", (8, 9)),
        ("9 0 0", "bus_9", "gfor3", ()),
    ],
)
def test_a_plant_controller_measures_at_a_bus_and_a_branch(point, bus, branch, ends, prepared):
    ready = prepared(plausible(dyr(plant=elsewhere(point))), "")
    plan, flow = unit(ready), ready.power_flow
    assert plan.description.model_name == "regca1_repca1_remote_phasor"
    fed = {str(c.target): str(c.source) for c in ready.system.connections}
    assert [fed[f"gfor3.plant.{name}"] for name in "vpq"] == [
        f"grid.{bus}.v",
        f"grid.{branch}.p",
        f"grid.{branch}.q",
    ]
    given = plan.parameters
    assert given["plant.v_0"] == pytest.approx(abs(flow.voltages[bus]))
    toward = -1 if given.get("plant.reversed") else 1
    wanted = 0.85  # its own 85 MW
    if ends and 8 in ends:  # what the line brings, without its losses
        (line,) = (line for line in flow.lines if line.name == branch)
        into, _ = line.powers(flow.voltages[line.from_bus], flow.voltages[line.to_bus])
        assert line.from_bus == "bus_8"
        wanted = into.real if ends[0] == 8 else -into.real
    assert toward * given["plant.p_0"] == pytest.approx(wanted, rel=1e-6)


def test_the_terminal_itself_is_no_other_point(prepared):
    ready = prepared(dyr(plant=elsewhere("3 0 0"), BUSR=3), "")
    assert unit(ready).description.model_name == "regca1_repca1_phasor"


@pytest.mark.slow
def test_the_voltage_that_is_measured_is_the_one_that_is_held(prepared, tmp_path, gfor):
    """After a step of a load the voltage at bus 9 returns, and the terminal's does not."""
    holding = elsewhere("9 3 9").replace("'1' 0 0 1 0.02 18 5", "'1' 0 1 0 0.02 2 8")
    holding = holding.replace("0.02 0.1 -0.1 -1 1", "0 0.1 -0.1 0 0")  # no Kc, no dead band
    prepared(plausible(dyr(plant=holding)), "")
    event = '{ type = "load_change", time = "0.1 s", load = "load_8", scale = 1.1 }'
    case = (tmp_path / "case.toml").read_text() + f"events = [{event}]\n"
    (tmp_path / "case.toml").write_text(case)
    code, _, error = gfor(
        "run", tmp_path / "case.toml", "--no-csv", "--stop", "4", "--out", tmp_path / "out"
    )
    assert code == 0, error
    (file,) = (tmp_path / "out").rglob("*.nc")
    with xr.open_dataset(file) as data:
        held, own = (data[f"grid.bus_{k}.v"].values.ravel() for k in (9, 3))
    least = held.min() - held[0]
    assert least < -1e-3
    assert abs(held[-1] - held[0]) < 0.05 * abs(least)
    assert abs(own[-1] - own[0]) > 0.3 * abs(least)


def test_a_plant_controller_that_is_left_out_is_said(prepared):
    ready = prepared(dyr(plant=PLANT.format("")), 'dyr_leave_out = ["REPCA1"]')
    assert unit(ready).description.model_name == "regca1_phasor"
    assert any("REPCA1 left out, as dyr_leave_out says: the ref" in q.text for q in ready.questions)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            dyr().replace("3 'REECB1'", "1 'REECB1'"),
            r"machine '1' at bus 3 has records of its converter and no REECA1, REECB1, REECC1 or REECD1.*replace =",
        ),
        (
            dyr().replace("3 'REGCA1'", "1 'REGCA1'"),
            r"machine '1' at bus 3 has records of its electrical and no REGCA1, REGCB1 or REGCC1",
        ),
        (
            dyr(plant=record("REGCA1", REGCA1, Tg=0.03)),
            r"line 7: a second converter of machine '1' at bus 3",
        ),
        (
            dyr().replace(" /\n3 'REECB1'", "\n3 'REECB1'"),
            r"be taken over; correct them:\n  \S+, line \d+: the record REGCA1 has no slash[^\n]*$",
        ),
        (dyr(plant=record("REECA1", {})), r"line 7: a second electrical of machine '1' at bus 3"),
        (
            dyr(BUSR=2),
            r"line 6: REECB1 has BUSR = 2: its control measures at another .*write BUSR = 0 for the term",
        ),
        (dyr(VFLAG=2), r"line 6: REECB1 has VFLAG = 2; only 0 or 1 can be modelled"),
        (
            dyr(plant=elsewhere("0 2 3")),
            r"line 7: gfor3: REPCA1 measures the branch 2-3, circuit '1', which is no line .*REPCA1'\]",
        ),
        (
            dyr(plant=elsewhere("12 0 0")),
            r"line 7: gfor3: REPCA1 measures at bus 12, which the network has not; .*REPCA1'\]",
        ),
        (dyr(plant=elsewhere("0 9 0")), r"line 7: REPCA1 has BUS1 = 9 and BUS2 = 0; give both"),
        (dyr(plant=elsewhere("A 0 0")), r"line 7: REPCA1 has BUSR = 'A'; it must be the number"),
    ],
)
def test_what_cannot_be_taken_over_is_refused(text, words, prepared):
    with pytest.raises(CaseError, match=f"(?s){words}"):
        prepared(text, "")


@pytest.mark.slow
def test_the_system_with_a_plant_has_a_steady_state_and_modes(prepared, tmp_path, gfor):
    prepared(plausible(dyr(plant=PLANT.format(""))), "")
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert scenario["stable"]
    assert any("gfor3.plant" in str(mode) for mode in scenario["modes"])


# -- the other records ------------------------------------------------------------------------------

BATTERY = {"PFFLAG": 0, "VFLAG": 0, "QFLAG": 1, "PQFLAG": 0, "Vdip": 0.8, "Vup": 1.2, "Trv": 0.02}
BATTERY |= {"Iqh1": 1.1, "Iql1": -1.1, "Tp": 0.05, "QMax": 0.6, "QMin": -0.6, "VMAX": 1.1}
BATTERY |= {"VMIN": 0.9, "Kvp": 1.0, "Kvi": 40.0, "Tiq": 0.02, "dPmax": 99.0, "dPmin": -99.0}
BATTERY |= {"PMAX": 1.0, "PMIN": -1.0, "Imax": 1.3, "Tpord": 0.02, "T": 3600.0, "SOCini": 0.4}
BATTERY |= {"SOCmax": 0.9, "SOCmin": 0.1}
TYPE_D = {name: value for name, value in BATTERY.items() if not name.startswith(("T", "SOC"))}
TYPE_D |= {"Trv": 0.02, "Tp": 0.05, "Tiq": 0.02, "Tpord": 0.02, "QVmax": 0.6, "QVmin": -0.6}
TYPE_D |= {"VFLAG": 1, "VCMPFLAG": 1, "Xc": 0.05, "Ke": 1.0, "Vblkh": 1.4, "Vblkl": 0.1}
EMF = {"PQFLAG": 1, "Tg": 0.02, "Tfltr": 0.02, "Iqrmax": 99.0, "Iqrmin": -99.0, "rrpwr": 10.0}
EMF |= {"Te": 0.01, "Imax": 1.3}
LOOP = EMF | {"Kip": 0.5, "Kii": 20.0, "Kppll": 20.0, "Kipll": 200.0, "wmax": 12.0, "wmin": -12.0}


def line(name, values):
    """A record of the unit at bus 3; fields that are not given are 0."""
    fields = [field.name for field in PLANT_RECORDS[name].fields]
    return f"3 '{name}' 1 {' '.join(str(values.get(field, 0)) for field in fields)} /\n"


def with_records(*lines):
    """The file with these records in place of the unit's own."""
    others = [one for one in dyr().splitlines(keepends=True) if not one.startswith("3 ")]
    return "".join([*others, *lines])


OF_REGCA1 = record("REGCA1", REGCA1, **VOLTAGES)
WIND = (
    "3 'WTDTA1' 1 4.5 0.0 0.85 1.6 1.4 /\n",
    "3 'WTARA1' 1 0.007 0.0 /\n",
    "3 'WTPTA1' 1 25 150 30 3 0 0.3 27 0 10 -10 /\n",
    "3 'WTTQA1' 1 0 3 0.6 0.05 60 1.2 0 0.2 0.58 0.4 0.72 0.6 0.86 0.8 1 0 /\n",
)
TYPE_3 = (
    "3 'WT3G1' 1 74 0.8 30 0 0.1 1.5 /\n",
    "3 'WT3E1' 1 0 1 1 0 0 '0' 0.15 18 5 0 0.05 3 0.6 1.12 0.04 0.436 -0.436 1.1 0.02 0.45 -0.45 5 0.1 0.9 1.1 40 "
    "-0.5 0.4 0.05 0.05 1 0.69 0.78 0.98 1.12 0.74 1.2 /\n",
    "3 'WT3T1' 1 1.0 4.94 0 0.007 21.98 0.875 1.8 1.5 /\n",
    "3 'WT3P1' 1 0.3 150 25 3 30 0 27 10 1 /\n",
)
TYPE_4 = (
    "3 'WT4G1' 1 0.02 0.02 0.4 0.9 1.11 1.2 2 2 0.02 /\n",
    "3 'WT4E1' 1 0 0 1 0 0.15 18 5 0.05 0.15 0 0.08 0.48 -0.47 1.1 0.1 0.5 -0.5 0.05 0.15 0.9 1.1 120 0.05 0.05 1.7 "
    "1.11 1.11 /\n",
)
MADE = {
    "WT4G1 WT4E1": TYPE_4,
    "WT3G1 WT3E1 WT3T1 WT3P1": TYPE_3,
    "REGCB1 REECC1": (line("REGCB1", EMF), line("REECC1", BATTERY)),
    "REGCC1 REECD1 REPCA1": (
        line("REGCC1", LOOP),
        line("REECD1", TYPE_D),
        PLANT.format("1").replace("REPCA1", "REPCTA1"),
    ),
    "REGCA1 REECC1 REPCA1 elsewhere": (
        OF_REGCA1,
        line("REECC1", BATTERY),
        elsewhere("9 9 8"),
    ),
    "REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1": (
        OF_REGCA1,
        line("REECA1", BATTERY),
        *WIND,
    ),
}


@pytest.mark.parametrize("records", MADE)
def test_other_records_are_one_plant(records, prepared):
    plan = unit(prepared(with_records(*MADE[records]), ""))
    made = "_".join(records.lower().split())
    assert plan.description.model_name == f"wecc_plant_{made}_phasor"
    given = plan.parameters
    if records.startswith(("REGCB1", "REGCC1")):  # ZSORCE of the network data
        assert (given["Re"], given["Xe"]) == (0.0, 0.2)
    if "REECC1" in records:
        assert (given["electrical.SOCini"], given["electrical.T"]) == (0.4, 3600.0)
    if "WT3G1" in records:
        assert (given["turbines"], given["Xeq"], given["electrical.wP100"]) == (74, 0.8, 1.2)
        assert (given["shaft.Htfrac"], given["pitch.PMX"]) == (0.875, 1)
    if "WT4G1" in records:
        assert (given["GLVPL"], given["electrical.VARFLG"], given["electrical.Iqhl"]) == (
            1.11,
            1,
            1.11,
        )
    if "WTTQA1" in records:
        assert (given["torque.P3"], given["shaft.Freq1"]) == (0.6, 1.6)


OF_GRIDPACK = (
    "3 'WTARA1' '1 ' 1 0.007 /\n",
    "3 'WTPTA1' '1 ' 25 150 30 0 0 0.3 27 0 10 -10 /\n",
    "3 'WTTQA1' '1 ' 1 0.5 2.5 0.066667 60 1.1 0 0.2 0.58 0.4 0.72 0.72 0.866 0.86 1 0 /\n",
    "3 'WTDTA1' '1 ' 5 0.5 0 0 0 /\n",
)
"""A turbine of GridPACK's example kundur-twoarea_4renewable_mech.dyr: one mass, without a frequency of its shaft."""


def test_a_turbine_of_one_mass_needs_no_frequency_and_its_slope_is_asked_about(prepared):
    """The values of WTARA1 stand there in the other order: the slope of power by the pitch would be 1."""
    ready = prepared(with_records(OF_REGCA1, line("REECA1", BATTERY), *OF_GRIDPACK), "")
    given = unit(ready).parameters
    assert (given["shaft.Htfrac"], given["shaft.Freq1"], given["shaft.DAMP"]) == (0.0, 0.0, 0.5)
    (asked,) = [q.text for q in ready.questions if "aerodynamics.Ka" in q.text]
    assert "0.007; an example of GridPACK has Theta0 before it" in asked


@pytest.mark.parametrize(
    ("records", "shortest", "told"),
    [
        ("REGCB1 REECC1", 0.32, "PRC-029"),
        ("REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1", 0.16, "PRC-029 for wind"),
    ],
)
def test_a_code_gives_a_wind_plant_the_times_of_wind(records, shortest, told, prepared, tmp_path):
    """PRC-029 has a table of its own for wind, and a trip names it: below 0.25 pu half of the time."""
    prepared(with_records(*MADE[records]), "")
    (ready,) = with_protection(load_case(tmp_path / "case.toml"), "prc029").prepare()
    assert {(relay.of, relay.record) for relay in ready.relays} == {("gfor3", told)}
    assert min(x.limits.delay for x in ready.relays if x.limits.low == 0.25) == shortest


@pytest.mark.parametrize("left_out", ["WTPTA1 WTTQA1", "WTDTA1 WTARA1 WTPTA1 WTTQA1"])
def test_a_wind_plant_stays_one_where_its_turbine_is_left_out(left_out, prepared, tmp_path):
    """A model without the turbine's shaft is still a wind plant, which may trip in half of the time of others."""
    made = MADE["REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1"]
    prepared(with_records(*made), f"dyr_leave_out = {left_out.split()}\n")
    (ready,) = with_protection(load_case(tmp_path / "case.toml"), "prc029").prepare()
    assert {relay.record for relay in ready.relays} == {"PRC-029 for wind"}


def test_a_wind_plant_stays_one_where_a_converter_of_ours_replaces_it(prepared, tmp_path):
    """What drives the plant is the same, and so is the region in which it may not trip."""
    made = MADE["REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1"]
    prepared(with_records(*made), "")
    case = tmp_path / "case.toml"
    text = case.read_text().replace("[units]", '[units]\nreplace = ["3"]')
    case.write_text(text.replace('converter = "gfor"', 'converter = "gfor_phasor"'))
    (ready,) = with_protection(load_case(case), "prc029").prepare()
    assert unit(ready).description.model_name == "gfor_phasor"
    assert {relay.record for relay in ready.relays} == {"PRC-029 for wind"}


@pytest.mark.parametrize(
    "records", [name for name in MADE if "REGC" in name and "else" not in name]
)
@pytest.mark.slow
def test_the_system_with_such_a_plant_has_modes_and_a_run(records, prepared, tmp_path, gfor):
    prepared(with_records(*MADE[records]), "")
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert scenario["stable"]
    event = '{ type = "load_change", time = "0.1 s", load = "load_8", scale = 1.05 }'
    case = (tmp_path / "case.toml").read_text() + f"events = [{event}]\n"
    (tmp_path / "case.toml").write_text(case)
    code, _, error = gfor(
        "run", tmp_path / "case.toml", "--no-csv", "--stop", "1", "--out", tmp_path / "out"
    )
    assert code == 0, error


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (
            (line("REGCB1", EMF), line("REECC1", BATTERY | {"BUSR": 8})),
            r"REECC1 has BUSR = 8: its control measures at another bus .*write BUSR = 0 for the terminal$",
        ),
        (
            (OF_REGCA1, line("REECC1", BATTERY), WIND[3]),
            r"has records of a wind turbine's torque and no WTDTA1, its shaft.*leave_out = \['WTTQA1'\]|WTTQA1",
        ),
        ((*TYPE_3[:2], TYPE_3[3]), r"has records WT3E1, WT3G1, WT3P1: WT3G1, WT3E1 and WT3T1 go"),
        ((*TYPE_3, PLANT.format("1")), r"has records REPCA1, WT3E1, WT3G1, WT3P1, WT3T1: WT3G1"),
        (TYPE_4[1:], r"has records WT4E1: WT4G1 and WT4E1 go together and with no other"),
        ((line("REGCC1", LOOP),), r"records of its converter and no REECA1, REECB1, REECC1 or"),
    ],
)
def test_records_that_lack_something_are_named(lines, words, prepared):
    with pytest.raises(CaseError, match=f"(?ms){words}"):
        prepared(with_records(*lines), "")


def test_a_shaft_that_cannot_be_read_names_what_goes_with_it(prepared):
    """Planted: no number in WTDTA1. The case that takes the remedy as it stands is read in one round."""
    short = OF_GRIDPACK[3].replace(" 0 0 0 /", " 0 0 x /")
    lines = with_records(OF_REGCA1, line("REECA1", BATTERY), *OF_GRIDPACK[:3], short)
    with pytest.raises(CaseError, match="WTDTA1 has Dshaft = 'x'; it must be a number") as refused:
        prepared(lines, "")
    told = re.search(
        r"to leave out WTDTA1, .*: write (dyr_leave_out = \[.*?\])", str(refused.value)
    )
    assert told is not None
    assert told[1] == "dyr_leave_out = ['WTARA1', 'WTDTA1', 'WTPTA1', 'WTTQA1']"
    assert unit(prepared(lines, told[1] + "\n")).description.model_name == "regca1_phasor"


def test_a_record_that_cannot_be_read_beside_a_good_shaft_names_nothing_else(prepared):
    slope = OF_GRIDPACK[0].replace(" 1 0.007", " x 0.007")
    lines = with_records(OF_REGCA1, line("REECA1", BATTERY), slope, *OF_GRIDPACK[1:])
    with pytest.raises(CaseError, match="WTARA1 has Ka = 'x'") as refused:
        prepared(lines, "")
    assert "to leave out" not in str(refused.value)


def test_values_too_many_or_too_few_are_asked_about(prepared):
    """As GridPACK's two areas with wind turbines have them: three values of WTARA1, four of WTDTA1."""
    slope = OF_GRIDPACK[0].replace("0.007", "0.007 0")
    short = OF_GRIDPACK[3].replace(" 0 0 0 /", " 0 0 /")
    lines = (OF_REGCA1, line("REECA1", BATTERY))
    found = prepared(with_records(*lines, slope, *OF_GRIDPACK[1:3], short), "")
    asked = [str(question) for question in found.questions if "and needs" in str(question)]
    assert len(asked) == 2
    assert "WTARA1 has 3 values, and needs 2: what follows them (0) is not used" in asked[0]
    assert "WTDTA1 has 4 values, and needs 5: the others (Dshaft) are taken as 0" in asked[1]
    whole = prepared(with_records(*lines, *OF_GRIDPACK), "")
    assert unit(found).parameters == unit(whole).parameters


GOVERNORS = tuple(f"{bus} 'TGOV1' 1 0.05 0.5 1 0 1 3 0" for bus in (1, 2))


@pytest.mark.parametrize(
    ("left", "governed"),
    [("TGOV1", [False, False]), ("TGOV1 at 2", [True, False]), ("tgov1 at 1", [False, True])],
)
def test_records_of_one_bus_are_left_out_alone(tmp_path, left, governed):
    """The machine at the other bus keeps its governor, and the record is told as not used."""
    units = f'dyr_leave_out = ["{left}"]\n'
    (ready,) = load_case(mill_case(tmp_path, GOVERNORS, units=units)).prepare(["base"])
    plans = [ready.system.components[f"sg{bus}"].description for bus in (1, 2)]
    assert ["governor.R" in plan.variables for plan in plans] == governed
    unused = [use for use in ready.records if use.why == "dyr_leave_out names it"]
    assert len(unused) == governed.count(False)


def test_a_bus_without_such_a_record_is_refused(tmp_path):
    units = 'dyr_leave_out = ["TGOV1 at 7"]\n'
    with pytest.raises(CaseError, match="names 'TGOV1 at 7', of which the file has no record"):
        load_case(mill_case(tmp_path, GOVERNORS, units=units)).prepare(["base"])


MACHINE_OF_PVD1 = (
    "3 'PVD1' 1 1 0.05 0.3 -0.3 0.98 1.04 -1.4 0.0006 20 1.2 0.5 0.88 1.1 1.2 0.5 57 58.5 60.6 61.5 0.25 0.02 0.04 "
    "1.2 0.8 0.4 -1.3 0.7 /\n"
)


@pytest.mark.slow
def test_small_photovoltaic_plants_are_the_whole_unit(prepared, tmp_path, gfor):
    """A fault trips all of them by voltage, of which half comes back, and then a part by the jump of the frequency."""
    plan = unit(prepared(with_records(MACHINE_OF_PVD1), ""))
    assert plan.description.model_name == "pvd1_phasor"
    given = plan.parameters
    assert (given["Pqflag"], given["Vrflag"], given["Khv"]) == (True, 0.5, 0.7)
    code, _, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    words = ("--fault", "bus_9, 100 ms", "--stop", "2", "--out", tmp_path / "out")
    code, _, error = gfor("run", tmp_path / "case.toml", "--no-csv", *words)
    assert code == 0, error
    (path,) = (tmp_path / "out").rglob("*.nc")
    with xr.open_dataset(path) as kept:
        share = kept["gfor3.share"].values.ravel()
    assert share[0] == 1.0
    assert share.min() < 0.2
    assert 0.3 < share[-1] < 0.5


MACHINE_OF_B1 = (
    "3 'REGFMB1' 1 0 0 1 1 1 1 0.05 0 5 0.02 0.05 -0.05 0.265 2.65 0.2 -0.2 0 0.6 0 100 50 1 0.9 2 1.5 "
    "0.02 0.02 0 0 1 0.05 /\n"
)


@pytest.mark.slow
def test_a_virtual_synchronous_machine_is_the_whole_unit(prepared, tmp_path, gfor):
    plan = unit(prepared(with_records(MACHINE_OF_B1), ""))
    assert plan.description.model_name == "regfm_b1_phasor"
    given = plan.parameters
    assert (given["H"], given["kI"], given["VPLLfrz"], given["XL"]) == (0.6, 2.0, 0.05, 0.2)
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert scenario["stable"]
    assert any("gfor3.Dw" in str(mode) for mode in scenario["modes"])
