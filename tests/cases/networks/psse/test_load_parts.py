"""Parts of loads of constant current and admittance: the format's own formula, P = PL + IP·v + YP·v²."""

from dataclasses import replace

import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.test_network_sources import solved

VM = 1.08
PL, QL, IP, IQ, YP, YQ = 10.0, 4.0, 20.0, 8.0, 5.0, -3.0
POWER = {"load_model": {"active": "power", "reactive": "power"}}


@pytest.fixture
def written(tmp_path):
    def write(*loads, revision=33, **keys):
        found = records(revision)
        found["BUS"][3] = found["BUS"][3].replace(",1.0,0.0", f",{VM},0.0")
        found["LOAD"] += loads
        (tmp_path / "grid.raw").write_text(raw(revision, found), encoding="utf-8")
        return network_data(NetworkTable(raw="grid.raw", **keys), tmp_path)

    return write


def drawn(load, v):
    """P and Q [MW, Mvar] of a load by its shares at a voltage [pu]."""
    ratio = v / VM
    of = [law.z * ratio**2 + law.i * ratio + law.p for law in (load.active, load.reactive)]
    return load.p_mw * of[0], load.q_mvar * of[1]


RECORD = f"4,'2 ',1,1,1,{PL},{QL},{IP},{IQ},{YP},{YQ},1,1,0"


def of_record(v, rest=lambda v: 1.0):
    """The format's formula; YQ is positive where it generates, as with shunts."""
    return PL * rest(v) + IP * v + YP * v**2, QL * rest(v) + IQ * v - YQ * v**2


@pytest.mark.parametrize("v", [0.85, 1.0, VM, 1.12])
def test_the_shares_are_the_records_formula(v, written):
    data = written(RECORD, keep_load_parts=True, **POWER)
    (load,) = [x for x in data.loads if x.bus == "bus_4"]
    assert drawn(load, v) == pytest.approx(of_record(v))
    assert not [s for s in data.shunts if s.bus == "bus_4"]
    assert not data.changes
    assert load.active.z + load.active.i + load.active.p == pytest.approx(1)


def test_the_rest_follows_the_case(written):
    data = written(RECORD, keep_load_parts=True)  # without keys a load is a constant impedance
    (load,) = [x for x in data.loads if x.bus == "bus_4"]
    for v in (0.9, 1.1):
        assert drawn(load, v) == pytest.approx(of_record(v, rest=lambda v: (v / VM) ** 2))
    (other,) = [x for x in data.loads if x.bus == "bus_5"]
    assert other.active.z == 1


@pytest.mark.parametrize("revision", [34, 35])
def test_several_loads_at_a_bus_and_distributed_generation(revision, written):
    records = ("4,'2 ',1,1,1,10,4,20,8,0,0,1,1,0,6,1,1", "4,'3 ',1,1,1,0,0,0,0,7,2")
    data = written(*records, revision=revision, keep_load_parts=True, **POWER)
    (load,) = [x for x in data.loads if x.bus == "bus_4"]
    for v in (0.9, 1.1):
        assert drawn(load, v) == pytest.approx(
            (10 - 6 + 20 * v + 7 * v**2, 4 - 1 + 8 * v - 2 * v**2)
        )


def test_both_ways_have_the_same_voltages_where_the_file_holds_the_solution(written, monkeypatch):
    """The file's VM is made the solution's by repetition; then the shares and the shunt draw the same."""
    found = []
    for _ in range(12):
        monkeypatch.setitem(globals(), "VM", abs(found[-1]["bus_4"]) if found else VM)
        found.append(solved(written(RECORD)).voltages)
    kept = solved(written(RECORD, keep_load_parts=True)).voltages
    for bus, v in kept.items():
        assert v == pytest.approx(found[-1][bus], abs=1e-9)


@pytest.mark.parametrize(
    "record", ["4,'2 ',1,1,1,-10,0,9.26,0,0,0", "4,'2 ',1,1,1,-10,0,9.2592592592592595,0,0,0"]
)
def test_a_load_that_cancels_itself_is_refused(record, written):
    with pytest.raises(
        InputError,
        match=r"load_4 at bus_4: its P is .* -10, .* of constant current .* keep_load_parts",
    ):
        written(record, keep_load_parts=True)


def test_the_key_is_for_psse(tmp_path):
    with pytest.raises(
        InputError, match="keep_load_parts is for networks of PSS/E; remove the key"
    ):
        network_data(NetworkTable(pandapower="case9", keep_load_parts=True), tmp_path)


FED = "5,'W ',1,1,1,-300,20,0,0,{yp},0,1,1,0"


@pytest.mark.parametrize("keep", [True, False])
def test_loads_of_both_signs_at_a_bus_are_two_elements(written, keep):
    data = written(FED.format(yp=0), keep_load_parts=keep, **POWER)
    at_bus = {x.name: x for x in data.loads if x.bus == "bus_5"}
    assert {name: (x.p_mw, x.q_mvar) for name, x in at_bus.items()} == {
        "load_5": (125, 50),
        "static_5": (-300, 20),
    }
    assert at_bus["load_5"].active.p == 1, "constant power, as the case says of loads"
    assert at_bus["static_5"].active.i == 1, "a constant current, as generation without a word is"
    assert not [change for change in data.changes if "sign" in str(change)]
    assert data.feeding == {"bus_5": -300}


def test_each_sign_keeps_its_own_parts(written):
    """A feeding record's admittance (here YP = -40 MW) is no part of what the others draw."""
    fed = FED.format(yp=-40)
    current = "5,'3 ',1,1,1,10,0,20,0,0,0,1,1,0"
    data = written(fed, current, keep_load_parts=True, **POWER)
    loads = {x.name: x for x in data.loads if x.bus == "bus_5"}
    # the file's voltage at bus 5 is 1 pu
    assert (loads["load_5"].p_mw, loads["static_5"].p_mw) == (155, -340)
    assert loads["load_5"].active.i == pytest.approx(20 / 155)
    assert loads["static_5"].active.z == pytest.approx(40 / 340)
    assert set(data.flow_laws) == {"load_5", "static_5"}


def test_records_of_dynamics_data_find_each_sign_by_its_own_name(written):
    data = written(FED.format(yp=0), "5,'2 ',1,1,1,10,0,0,0,0,0,1,1,0")
    found = [(x.load, x.name) for x in data.file_loads if x.bus == 5]
    assert found == [("load_5", "1"), ("static_5", "W"), ("load_5", "2")]


def test_loads_of_one_sign_and_reactive_power_alone_are_one_element(written):
    data = written("5,'2 ',1,1,1,7,0,0,0,0,0", "5,'C ',1,1,1,0,-30,0,0,0,0,1,1,0")
    (load,) = [x for x in data.loads if x.bus == "bus_5"]
    assert (load.name, load.p_mw, load.q_mvar) == ("load_5", 132, 20)


def test_both_signs_draw_as_one_sum_in_the_power_flow(written):
    """Two elements draw what one of their sum does, so the flow's voltages are the same."""
    apart = solved(written(FED.format(yp=0), **POWER)).voltages
    one = written(FED.format(yp=0).replace("-300", "0").replace(",20,", ",0,"), **POWER)
    (netted,) = [x for x in one.loads if x.bus == "bus_5"]
    others = tuple(x for x in one.loads if x.bus != "bus_5")
    whole = replace(one, loads=(*others, replace(netted, p_mw=-175, q_mvar=70)))
    for bus, v in solved(whole).voltages.items():
        assert v == pytest.approx(apart[bus], abs=1e-9)
