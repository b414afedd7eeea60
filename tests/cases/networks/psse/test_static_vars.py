"""Records of compensators: at FACTS devices, at generators and at switched shunts, where the device is."""

import json

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_devices import lines_of

MACHINES = "".join(f"{bus} 'GENCLS' 1 4.0 0.0 /\n" for bus in (1, 2, 3))
RECORD = "8 'CSVGN1' 1 50.0 0.0 0.0 0.1 0.0 0.05 0.0 1.0 0.0 60.0 /\n"


@pytest.fixture
def folder(tmp_path):
    found = records(33)
    found["FACTS DEVICE"] = lines_of("FACTS DEVICE", 33)
    (tmp_path / "grid.raw").write_text(raw(33, found))
    (tmp_path / "grid.dyr").write_text(MACHINES + RECORD)
    return tmp_path


def test_a_device_with_a_model_is_a_unit_that_holds_its_voltage(folder):
    table = NetworkTable(raw="grid.raw")
    data = network_data(table, folder, None, frozenset({(8, "1")}))
    unit = next(machine for machine in data.machines if machine.bus == 8)
    assert (unit.p_mw, unit.v_pu, unit.rating_mva) == (0.0, 1.03, 60.0)
    assert not data.device_loads
    assert data.generation["bus_8"].v_pu == 1.03


@pytest.mark.parametrize("modelled", [(), {(5, "1")}, {(1, "1")}])
def test_without_a_record_at_its_bus_it_stays_a_load(folder, modelled):
    data = network_data(NetworkTable(raw="grid.raw"), folder, None, frozenset(modelled))
    assert data.device_loads == ("facts_F_1_8",)
    assert {machine.bus for machine in data.machines} == {1, 2, 3}


def test_a_case_has_the_model_there(gfor, folder):
    files = (folder / "grid.raw", folder / "grid.dyr")
    code, out, err = gfor("new", *files, "--out", folder / "case.toml", "--json")
    assert code == 0, err
    records_of = {one["kind"]: one["use"] for one in json.loads(out)["records"]}
    assert records_of["CSVGN1"] == "used"
    code, out, err = gfor("modes", folder / "case.toml", "--scenario", "base", "--json")
    assert code == 0, err
    (scenario,) = json.loads(out)["scenarios"]
    (unit,) = [x for x in scenario["power_flow"]["machines"] if x["bus"] == "bus_8"]
    assert unit["p_mw"] == pytest.approx(0, abs=1e-6)
    assert abs(unit["q_mvar"]) < 60
    voltage = next(x for x in scenario["power_flow"]["buses"] if x["name"] == "bus_8")["v_pu"]
    assert voltage == pytest.approx(1.03)


COMPENSATORS = {
    "CSVGN3": "50.0 0.0 0.0 0.1 0.0 0.05 0.0 1.0 0.0 60.0 0.2",
    "CSVGN4": "{bus} 50.0 0.0 0.0 0.1 0.0 0.05 0.0 1.0 0.0 60.0 0.2",
    "CSVGN5": "{bus} 0.02 0.1 0.0 0.1 0.0 0.0 50.0 2.0 1.2 1.0 -1.0 -1.2 0.05 0.15",
    "CSTATT": "0.0 0.0 0.1 0.0 25.0 0.03 99 -99 1.2 1.2 0.2 1.3 0.1 0.5",
}
PARTS = {
    "CSVGN3": "csvgn3_phasor",
    "CSVGN4": "csvgn3_phasor",
    "CSVGN5": "csvgn5_phasor",
    "CSTATT": "cstatt_phasor",
}


def with_compensator(folder, name, bus=8):
    """A generator of 0 MW at bus 8, with a compensator's record."""
    found = records(33)
    found["BUS"] = [
        line.replace(",230.0,1,", ",230.0,2,") if line.startswith("8,") else line
        for line in found["BUS"]
    ]
    found["GENERATOR"] += ["8,'1 ',0,0,60,-60,1.02,0,60,0,1.0,0,0,1,1,100,0,0,1,1"]
    (folder / "grid.raw").write_text(raw(33, found))
    record = f"8 '{name}' 1 {COMPENSATORS[name].format(bus=bus)} /\n"
    (folder / "grid.dyr").write_text(MACHINES + record)
    return folder / "grid.raw", folder / "grid.dyr"


CSTCNT = "'f 1' 'CSTCNT' {bus} 0.0 0.0 0.1 0.0 25.0 0.03 99 -99 1.2 1.2 0.2 1.3 0.1 0.5 {base} /\n"


@pytest.mark.parametrize(("bus", "remote"), [(0, 0), (8, 0), (7, 0), (7, 7)])
def test_a_facts_devices_own_record_makes_it_a_static_condenser(gfor, folder, bus, remote):
    """On STBASE, at VSET or, where the file lets it hold another bus, at the file's voltage."""
    text = (folder / "grid.raw").read_text()
    line = lines_of("FACTS DEVICE", 33)[0]
    assert line in text
    fields = [*line.split(","), *["0"] * 20][:20]
    fields[19] = str(remote)
    (folder / "grid.raw").write_text(text.replace(line, ",".join(fields)))
    (folder / "grid.dyr").write_text(MACHINES + CSTCNT.format(bus=bus, base=50))
    asked, prepared = prepared_of(gfor, (folder / "grid.raw", folder / "grid.dyr"), folder)
    assert "no machine" not in asked
    plan = prepared.system.components["gfor8"]
    assert (plan.number("S_n"), plan.number("ICMAX"), plan.number("DROOP")) == (50, 1.2, 0.03)
    is_elsewhere = bus == 7
    assert plan.description.model_name == f"cstatt_{'elsewhere_' if is_elsewhere else ''}phasor"
    wanted = 1.0 if remote else 1.03
    assert abs(prepared.power_flow.voltages["bus_8"]) == pytest.approx(wanted)


@pytest.mark.parametrize("base", [0, -30])
def test_a_facts_devices_record_without_a_base_is_refused(gfor, folder, base):
    """All its values are on STBASE: none other may stand for it."""
    (folder / "grid.dyr").write_text(MACHINES + CSTCNT.format(bus=0, base=base))
    code, _, err = gfor("new", folder / "grid.raw", folder / "grid.dyr", "--out", folder / "x.toml")
    assert code == 2
    assert f"CSTCNT has STBASE = {base}: the base of its values must exceed 0" in " ".join(
        err.split()
    )


def power_flow(gfor, case):
    code, out, err = gfor("modes", case, "--scenario", "base", "--json")
    assert code == 0, err
    return json.loads(out)["scenarios"][0]["power_flow"]


def voltage(flow):
    return next(x for x in flow["buses"] if x["name"] == "bus_8")["v_pu"]


def questions_of(listed):
    return " ".join(json.dumps(listed["questions"]).split())


@pytest.mark.parametrize("name", COMPENSATORS)
def test_a_generator_with_a_compensators_record_is_that_compensator(gfor, tmp_path, name):
    code, out, err = gfor(
        "new", *with_compensator(tmp_path, name), "--out", tmp_path / "case.toml", "--json"
    )
    assert code == 0, err
    listed = json.loads(out)
    assert {one["kind"]: one["use"] for one in listed["records"]}[name] == "used"
    assert "own bus" not in questions_of(listed)
    flow = power_flow(gfor, tmp_path / "case.toml")
    (unit,) = [x for x in flow["machines"] if x["bus"] == "bus_8"]
    assert unit["p_mw"] == pytest.approx(0, abs=1e-6)
    assert voltage(flow) == pytest.approx(1.02)


def prepared_of(gfor, files, folder):
    code, out, err = gfor("new", *files, "--out", folder / "case.toml", "--json", "--force")
    assert code == 0, err
    (prepared,) = load_case(folder / "case.toml").prepare(["base"])
    return questions_of(json.loads(out)), prepared


@pytest.mark.parametrize("name", ["CSVGN4", "CSVGN5"])
def test_a_compensator_holds_the_bus_that_its_record_names(gfor, tmp_path, name):
    asked, prepared = prepared_of(gfor, with_compensator(tmp_path, name, bus=7), tmp_path)
    assert "IB" not in asked
    v_7 = abs(prepared.power_flow.voltages["bus_7"])
    assert prepared.values["gfor8.held.v_0"] == pytest.approx(v_7)
    assert v_7 != pytest.approx(1.02, abs=1e-3)
    ends = {(str(x.source), str(x.target)) for x in prepared.system.connections}
    assert ("grid.bus_7.v", "gfor8.held.v") in ends


def modes_of(gfor, files, folder):
    code, _, err = gfor("new", *files, "--out", folder / "case.toml", "--json", "--force")
    assert code == 0, err
    code, out, err = gfor("modes", folder / "case.toml", "--scenario", "base", "--json")
    assert code == 0, err
    (scenario,) = json.loads(out)["scenarios"]
    return [(mode["real"], mode["imag"]) for mode in scenario["modes"]]


def test_a_bus_close_by_is_held_as_its_own_and_one_far_away_is_not(gfor, tmp_path):
    """Of a line from 8 to 7 nearly nothing is left: both models have the same modes, and not so with the line."""
    found = {}
    for is_close in (True, False):
        for bus in (8, 7):
            files = with_compensator(tmp_path, "CSVGN5", bus=bus)
            line = "7,8,'1 ',0.0085,0.072,0.149,"
            text = files[0].read_text()
            assert line in text
            if is_close:
                files[0].write_text(text.replace(line, "7,8,'1 ',0.0,0.0004,0.0,"))
            found[is_close, bus] = np.array(modes_of(gfor, files, tmp_path))
    assert found[True, 7] == pytest.approx(found[True, 8], abs=2e-3)
    assert abs(found[False, 7] - found[False, 8]).max() > 0.01


@pytest.mark.parametrize("name", ["CSVGN4", "CSVGN5"])
def test_a_compensator_that_names_a_bus_that_is_not_there_holds_its_own(gfor, tmp_path, name):
    asked, prepared = prepared_of(gfor, with_compensator(tmp_path, name, bus=77), tmp_path)
    assert f"{name} has IB = 77, a bus that the network has not" in asked
    assert not [name for name in prepared.values if "held" in name]


SVSMO1 = """
 0.18 {uv1} 0.31 0.48 1.80 2.00 0.93 6.7 0.91 0.27 0.023 0.0 0.0 1.08 0.92 0.0 0.012 0.0 0.0 42.0 210.0 0.45 -0.45
 0.012 1.10 0.95 -0.30 0.35 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.13 0.4 37.0 19.0 -38.0 -18.0 0.09 0.47 2.8 280.0 0.80 1.20 /
"""
"""Constants of SVSMO1T2 as InterPSS' public example has them (`PSSE_5Bus_svsmo1t2_synthetic.dyr`)."""
SLOTS = " ".join(f"0 '{k}'" for k in range(1, 9))
SHUNTS = {
    33: "8,2,0,1,1.02,1.02,0,100,'',30.0,1,40.0,1,-30.0",
    35: "8,'A ',2,0,1,1.02,1.02,0,0,100,'',30.0,1,1,40.0,1,1,-30.0",
}


def with_shunt(folder, revision=33, at=8, uv1="0.0"):
    found = records(revision)
    found["SWITCHED SHUNT"] += [SHUNTS[revision]]
    (folder / "grid.raw").write_text(raw(revision, found))
    begin = f"{at} 'SVSMO1T2'" if revision == 33 else f"{at} 'SVSMO1T3' 'A'"
    constants = SVSMO1.format(uv1=uv1)
    (folder / "grid.dyr").write_text(f"{MACHINES}{begin} 8 0 0 {SLOTS}{constants}")
    return folder / "grid.raw", folder / "grid.dyr"


@pytest.mark.parametrize(("revision", "name"), [(33, "shunt 1"), (35, "shunt A")])
def test_a_switched_shunt_with_a_model_is_a_unit_and_no_shunt(tmp_path, revision, name):
    with_shunt(tmp_path, revision)
    table = NetworkTable(raw="grid.raw")
    held = network_data(table, tmp_path)
    data = network_data(table, tmp_path, None, frozenset({(8, name)}))
    (unit,) = [machine for machine in data.machines if machine.bus == 8]
    assert (unit.p_mw, unit.v_pu, unit.rating_mva) == (0.0, 1.0, 100.0)
    assert (unit.q_min_mvar, unit.q_max_mvar) == (-30.0, 40.0)
    assert {machine.bus for machine in held.machines} == {1, 2, 3}
    assert [x.use.value for x in held.records if x.kind == "switched shunt"] == ["held"]
    assert [x.use.value for x in data.records if x.kind == "switched shunt"] == ["used"]


def test_its_bus_stands_for_one_that_a_line_without_impedance_joins(tmp_path):
    """A merged bus keeps the number that the record names, even if its partner comes first."""
    with_shunt(tmp_path)
    text = (tmp_path / "grid.raw").read_text()
    bus = "8,'BUS 8     ',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9"
    line = "8,9,'1 ',"
    assert bus in text
    assert line in text
    text = text.replace(bus, f"{bus}\n{bus.replace('8,', '10,', 1).replace('BUS 8 ', 'BUS 10')}")
    joined = "10,8,'1 ',0.0,0.00001,0,0,0,0,0,0,0,0,1,1,0,1,1"
    (tmp_path / "grid.raw").write_text(text.replace(line, f"{joined}\n{line}", 1))
    data = network_data(NetworkTable(raw="grid.raw"), tmp_path, None, frozenset({(8, "shunt 1")}))
    assert "bus_8" in data.buses
    assert "bus_10" not in data.buses
    assert 8 in {machine.bus for machine in data.machines}
    other = network_data(NetworkTable(raw="grid.raw"), tmp_path, None, frozenset({(10, "shunt 1")}))
    assert "bus_10" in other.buses


@pytest.mark.parametrize("revision", [33, 35])
def test_a_solved_file_gives_the_system_what_its_shunt_feeds(gfor, tmp_path, revision):
    """The voltage of the power flow with the shunt held at BINIT, as the file's: the system then feeds BINIT·V²."""
    files = with_shunt(tmp_path, revision)
    records_of_system = files[1].read_text()
    files[1].write_text(MACHINES)
    assert gfor("new", *files, "--out", tmp_path / "held.toml")[0] == 0
    v = voltage(power_flow(gfor, tmp_path / "held.toml"))
    files[0].write_text(files[0].read_text().replace("1,1.0,0.0,1.1,0.9", f"1,{v!r},0.0,1.1,0.9"))
    files[1].write_text(records_of_system)
    code, out, err = gfor("new", *files, "--out", tmp_path / "case.toml", "--json")
    assert code == 0, err
    used = {one["kind"]: one["use"] for one in json.loads(out)["records"]}
    assert used["SVSMO1T2" if revision == 33 else "SVSMO1T3"] == "used"
    assert "UV1" not in questions_of(json.loads(out))
    (unit,) = [
        x for x in power_flow(gfor, tmp_path / "case.toml")["machines"] if x["bus"] == "bus_8"
    ]
    assert unit["p_mw"] == pytest.approx(0, abs=1e-6)
    assert unit["q_mvar"] == pytest.approx(30.0 * v**2, abs=0.01)


def test_it_has_no_part_in_the_power_that_a_lost_machine_fed(gfor, tmp_path):
    """By rating it would take a quarter of it, which it cannot feed."""
    files = with_shunt(tmp_path)
    assert gfor("new", *files, "--out", tmp_path / "case.toml")[0] == 0
    code, out, err = gfor(
        *("modes", tmp_path / "case.toml", "--scenario", "base"),
        *("--set", "sg3.connected=false", "--json"),
    )
    assert code == 0, err
    (scenario,) = json.loads(out)["scenarios"]
    fed = {x["bus"]: x["p_mw"] for x in scenario["power_flow"]["machines"]}
    assert fed["bus_8"] == pytest.approx(0, abs=1e-6)
    assert fed["bus_1"] + fed["bus_2"] > 71.6 + 163 + 84


def test_its_strategy_at_low_voltage_is_asked_about(gfor, tmp_path):
    code, out, err = gfor(
        "new", *with_shunt(tmp_path, uv1="0.6"), "--out", tmp_path / "case.toml", "--json"
    )
    assert code == 0, err
    assert "SVSMO1T2 has UV1 = 0.6" in questions_of(json.loads(out))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.80 1.20 /", "1.20 0.80 /", "SVSMO1T2 has Vrefmin = 1.2 above Vrefmax = 0.8"),
        ("0.012 1.10 0.95", "0.012 0.90 0.95", "SVSMO1T2 has Bmax = 0.95 above Bshrt = 0.9"),
    ],
)
def test_limits_that_are_turned_around_are_asked_about(gfor, tmp_path, old, new, said):
    files = with_shunt(tmp_path)
    text = files[1].read_text()
    for values, expected in (((old, old), False), ((old, new), True)):
        assert old in text
        files[1].write_text(text.replace(*values))
        code, out, err = gfor("new", *files, "--out", tmp_path / "case.toml", "--json", "--force")
        assert code == 0, err
        assert (said in questions_of(json.loads(out))) == expected


def test_a_model_of_a_shunt_that_is_not_there_is_asked_about(gfor, tmp_path):
    code, out, err = gfor(
        "new", *with_shunt(tmp_path, at=7), "--out", tmp_path / "case.toml", "--json"
    )
    assert code == 0, err
    assert "SVSMO1T2 (bus 7) is of no machine and not used" in questions_of(json.loads(out))


@pytest.mark.parametrize("revision", [33, 35])
@pytest.mark.parametrize(("remote", "told"), [(99, True), (7, False), (0, False)])
def test_a_switched_shunt_that_holds_a_bus_that_is_not_there_is_told(
    tmp_path, revision, remote, told
):
    found = records(revision)
    shunt = SHUNTS[revision].replace("8,2,0,1,", "8,1,0,1,").replace("'A ',2,", "'A ',1,")
    found["SWITCHED SHUNT"] += [shunt.replace("1.02,1.02,0,", f"1.02,0.98,{remote},", 1)]
    (tmp_path / "grid.raw").write_text(raw(revision, found))
    changes = network_data(NetworkTable(raw="grid.raw"), tmp_path).changes
    said = " ".join(" ".join(change.text.split()) for change in changes)
    assert (f"holds the voltage of bus {remote} (SWREM), which the file has not" in said) == told
