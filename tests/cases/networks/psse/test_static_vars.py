"""CSVGN1 at the bus of a FACTS device: the model stands where the device is."""

import json

import pytest

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
