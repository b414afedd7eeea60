"""WECC's generic plants in dynamics data: REGCA1 with REECA1 or REECB1, and REPCA1, as models of their own."""

import json

import pytest
import xarray as xr

from orchestrator.core.errors import CaseError
from tests.cases.networks.psse.test_dyr_following import REGCA1, dyr, prepared, record

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
    code, _, error = gfor("run", tmp_path / "case.toml", "--stop", "4", "--out", tmp_path / "out")
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
            r"machine '1' at bus 3 has records of its converter and no REECA1 or REECB1.*replace =",
        ),
        (
            dyr().replace("3 'REGCA1'", "1 'REGCA1'"),
            r"machine '1' at bus 3 has records of its electrical and no REGCA1",
        ),
        (
            dyr(plant=record("REGCA1", REGCA1)),
            r"line 7: a second converter of machine '1' at bus 3",
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
