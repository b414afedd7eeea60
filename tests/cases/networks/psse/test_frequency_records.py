"""Records LDFR of loads: which load each is of, and that the loads of a case follow the frequency by them."""

from dataclasses import replace

import pytest

from fmus.grid.element_data import LAWS, Load
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.frequency_records import recorded_frequency, with_frequency
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_machine_bases import dynamics, network
from tests.support.scenarios import prepare_one

FILE_LOADS = [
    FileLoad("load_1", 1, "1", 10, 5, 7, 80.0, 20.0),
    FileLoad("load_2", 2, "1", 20, 5, 7, 60.0, 10.0),
    FileLoad("load_3", 3, "1", 20, 6, 8, 30.0, 8.0),
    FileLoad("load_3", 3, "2", 20, 6, 8, 10.0, 2.0),
]
LOADS = [
    replace(Load(name, bus, p, q), active=LAWS["power"], reactive=LAWS["power"])
    for name, bus, p, q in (
        ("load_1", "bus_1", 80.0, 20.0),
        ("load_2", "bus_2", 60.0, 10.0),
        ("load_3", "bus_3", 40.0, 10.0),
    )
]


def recorded(tmp_path, *records, loads=LOADS):
    path = tmp_path / "loads.dyr"
    path.write_text("".join(f"{text} /\n" for text in records))
    return recorded_frequency(read_dyr(path), FILE_LOADS, loads)


def test_the_narrower_record_goes_first(tmp_path):
    found = recorded(
        tmp_path,
        "0 'LDFRAL' * 1 0 1 0",
        "20 'LDFRAR' * 1.5 -1 1.5 -1",
        "2 'LDFRBL' 1 2 -2 2 -2",
    )
    assert found.factors == {"load_1": (1, 0), "load_2": (2, -2), "load_3": (1.5, -1)}
    assert {line for _, line in found.places} == {1, 2, 3}
    assert not found.remarks


def test_loads_of_one_bus_are_the_mean_by_their_powers(tmp_path):
    found = recorded(tmp_path, "3 'LDFRBL' 1 2 -1 2 -1")
    assert found.factors == {"load_3": pytest.approx((2 * 0.75, -0.8))}


def test_constant_impedances_and_loads_with_factors_keep_theirs(tmp_path):
    z = LAWS["impedance"]
    others = [replace(LOADS[0], active=z, reactive=z), replace(LOADS[1], k_pf=0.7), LOADS[2]]
    found = recorded(tmp_path, "0 'LDFRAL' * 1 0 1 0", loads=others)
    assert set(found.factors) == {"load_3"}
    assert [load.k_pf for load in with_frequency(others, found)] == [0.0, 0.7, 1.0]


def test_other_exponents_of_constant_currents_are_told(tmp_path):
    (remark,) = recorded(tmp_path, "0 'LDFRAL' * 1 0 0.5 0").remarks
    assert "r = 0.5 and s = 0 are of constant currents" in remark.text


@pytest.mark.parametrize("values", ["1 0 1", "x 0 1 0", "1 0 1 0 1"])
def test_a_record_that_is_none_is_not_used(tmp_path, values):
    assert not recorded(tmp_path, f"0 'LDFRAL' * {values}").factors


def test_a_case_with_the_record_has_the_modes_of_the_same_load_model(tmp_path):
    """The record's m and n, beside k_pf and k_qf that the case writes itself; without both the mode is another."""
    by_record = mode(tmp_path, "0 'LDFRAL' * 1.5 -1 1.5 -1 /\n", "")
    by_case = mode(tmp_path, "", ", k_pf = 1.5, k_qf = -1")
    assert by_record == pytest.approx(by_case, rel=1e-9)
    assert abs(mode(tmp_path, "", "") - by_case) > 1e-4


def mode(tmp_path, record, factors):
    """The swing [1/s] of two machines beside a load of constant power."""
    (tmp_path / "grid.raw").write_text(network())
    records = dynamics(1, 6.5, 900.0, 900.0) + dynamics(3, 6.5, 900.0, 900.0) + record
    (tmp_path / "grid.dyr").write_text(records)
    out = tmp_path / "case.toml"
    text = write_case(WantedCase((tmp_path / "grid.raw", tmp_path / "grid.dyr"), out)).text
    said = f'load_model = {{ active = "power", reactive = "power"{factors} }}'
    out.write_text(text.replace("[network]\n", f"[network]\n{said}\n"), encoding="utf-8")
    prepared = prepare_one(out, "base")
    used = [use for use in prepared.records if use.kind == "LDFRAL"]
    assert [use.use for use in used] == [UseOfRecord.USED] * bool(record)
    found = [mode.eigenvalue for mode in compute_modes(prepared).modes]
    return min((x for x in found if x.imag > 0.1), key=lambda x: x.imag)
