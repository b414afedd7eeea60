"""PLNTBU1 with REAX4BU1 at two units of one bus: its component, its wires, its start, and its modes."""

import json

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_dyr import DYR
from tests.cases.networks.psse.test_dyr_converters import PHASORS
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.usefixtures("undrawn")

UNIT = """\
3 'REGCA1' '{0}' 1 0.02 10 0.9 0.4 1.22 1.2 0.8 0.4 -1.3 0.02 0.7 999 -999 0.7 /
3 'REECB1' '{0}' 0 0 0 0 0 -99 99 0.02 0 0 0 1.1 -1.1 0 0.05 0.4 -0.4 1.1 0.9 0 0.1 1 40 0.03 99 -99 1 0 1.2 0.05 /
"""
PLANT = """\
3 'USRBUS' 'PLNTBU1' 504 0 7 28 7 15
  {point} {flags}
  0.02 2 8 0 0.05 0 0 0 0 0.1 -0.1 0 0 0.43 -0.43
  1 0.5 0.25 -0.0005 0.0005 99 -99 1 -1 0.1 20 10 {base} /
"""
AT_UNIT = "3 'USRMDL' '{0}' 'REAX4BU1' 107 0 1 7 2 4 {1} 0.05 {2} {2} 0.5 -0.5 0.5 -0.5 /\n"
SHARES = {"1": 0.6, "2": 0.4}
MACHINES = [text for text in DYR.splitlines(keepends=True) if not text.startswith("3 ")]


def several(point="9 3 9 '1'", flags="0 1 1", base=150, bus=3):
    """Dynamics data of two units under one controller."""
    plant = PLANT.format(point=point, flags=flags, base=base)
    units = [UNIT.format(k) + AT_UNIT.format(k, bus, share) for k, share in SHARES.items()]
    return "".join([*MACHINES, *units, plant])


@pytest.fixture
def prepared(tmp_path):
    """Text of a DYR file and of [units] → the case, ready to run."""

    def build(text, units=""):
        found = records(33)
        common = ",0,300,-300,1.025,0,{0},0,0.2,0,0,1,1,100,{0},0,1,1"
        found["GENERATOR"][2] = "3,'1 ',55.0" + common.format("80.0")
        found["GENERATOR"].append("3,'2 ',30.0" + common.format("48.0"))
        (tmp_path / "grid.raw").write_text(raw(33, found))
        (tmp_path / "grid.dyr").write_text(text)
        case = PHASORS.replace("[units]", f"[units]\n{units}")
        solver = '[solver]\nstep_size = "2 ms"\n[components.grid]'
        (tmp_path / "case.toml").write_text(case.replace("[components.grid]", solver))
        return prepare_one(tmp_path / "case.toml")

    return build


def sources(ready):
    return {str(c.target): str(c.source) for c in ready.system.connections}


@pytest.mark.parametrize("base", [150, 0])
def test_a_controller_is_a_component_that_both_units_hear(base, prepared):
    ready = prepared(several(base=base))
    plan, fed = ready.system.components["plant3"], sources(ready)
    assert plan.description.model_name == "plant_controller_phasor"
    given = plan.parameters
    assert (given["RefFlag"], given["Fflag"], given["VCFlag"]) == (1, True, False)
    assert (given["Ki"], given["Ddn"], given["Dup"]) == (8, 20, 10)
    assert given["S_n"] == (base or 100)
    assert fed["plant3.v_re"] == "grid.bus_9.v_re"
    assert fed["plant3.p"] == "grid.line_9_3.p"
    assert given["reversed"] is True  # the transformer stands as 9-3 in the file
    for k, share in SHARES.items():
        unit = ready.system.components[f"gfor3_{k}"]
        assert unit.description.model_name == "wecc_plant_regca1_reecb1_reax4bu1_phasor"
        assert unit.parameters["plant.Kw"] == unit.parameters["plant.Kz"] == share
        assert fed[f"gfor3_{k}.plant.delta_P"] == "plant3.delta_P"
        assert fed[f"gfor3_{k}.plant.delta_Q"] == "plant3.delta_Q"
    v = ready.power_flow.voltages["bus_9"]
    assert given["v_0"] == pytest.approx(abs(v))
    assert given["theta_0"] == pytest.approx(np.angle(v))
    assert -given["p_0"] == pytest.approx(0.85, rel=1e-9)
    assert not [q.text for q in ready.questions if "PLNTBU1" in q.text or "REAX4BU1" in q.text]
    used = {r.kind for r in ready.records if str(r.use) == "used"}
    assert {"PLNTBU1", "REAX4BU1"} <= used


def test_a_unit_without_its_controller_keeps_its_references_and_is_asked_about(prepared):
    ready = prepared(several(bus=4))
    assert "plant3" not in ready.system.components
    assert ready.system.components["gfor3_1"].inputs == {"plant.delta_P": 0, "plant.delta_Q": 0}
    texts = [q.text for q in ready.questions]
    assert any("gfor3_2: REAX4BU1 names bus 4, of which no PLNTBU1 is used" in t for t in texts)
    assert any("PLNTBU1 (bus 3) is of no machine and not used" in t for t in texts)


WHYS = {"PLNTBU1": "dyr_leave_out names it", "REAX4BU1": "a model at bus 3, which is of no machine"}


@pytest.mark.parametrize("left", [["PLNTBU1"], ["REAX4BU1"]])
def test_records_that_the_case_leaves_out_are_said(left, prepared):
    ready = prepared(several(), f"dyr_leave_out = {left}")
    assert "plant3" not in ready.system.components
    assert {r.why for r in ready.records if r.kind == "PLNTBU1"} == {WHYS[left[0]]}
    texts = [q.text for q in ready.questions]
    if left == ["PLNTBU1"]:
        assert any("REAX4BU1 names bus 3, of which no PLNTBU1 is used" in t for t in texts)
    else:
        assert ready.system.components["gfor3_1"].description.model_name == "regca1_phasor"
        assert any("REAX4BU1 left out, as dyr_leave_out says: the ref" in t for t in texts)
        assert any("references of the units that it sets are constant" in t for t in texts)


@pytest.mark.parametrize(("flags", "asked"), [("0 1 0", 0), ("0 0 0", 1), ("0 1 1", 1)])
def test_a_controller_without_a_branch_measures_no_power(flags, asked, prepared):
    ready = prepared(several("9 0 0 ''", flags))
    assert ready.system.components["plant3"].inputs == {"p": 0, "q": 0}
    assert len([q for q in ready.questions if "names no branch" in q.text]) == asked


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (several("9 2 3 '1'"), r"plant3: PLNTBU1 measures the branch 2-3, .*PLNTBU1'\]"),
        (several("12 0 0 '1'"), r"plant3: PLNTBU1 measures at bus 12, .*has not.*PLNTBU1'\]"),
        (several("9 3 0 '1'"), r"PLNTBU1 has BUS1 = 3 and BUS2 = 0; give both"),
        (several(flags="0 3 1"), r"PLNTBU1 has RefFlag = 3; only 0 or 1 or 2 can be modelled"),
        (several(bus="A"), r"REAX4BU1 has BUSP = 'A'; it must be the number of a bus"),
        (several() + several().split("-0.5 /\n")[-1], r"a second PLNTBU1 of bus 3; remove one"),
        (several().replace("504 0 7 28", "504 0 7 27"), r"PLNTBU1 has 41 values, and needs 35"),
        (several() + "3 'REPCA1' 1 /\n", r"line \d+: a second plant of machine '1' at bus 3"),
    ],
)
def test_what_cannot_be_is_refused(text, words, prepared):
    with pytest.raises(CaseError, match=f"(?s){words}"):
        prepared(text)


def test_the_coarser_converter_hears_no_plant(prepared):
    """`gfl_phasor` has constant references: the part at the unit can only be left out."""
    with pytest.raises(CaseError, match=r"(?s)stands for REAX4BU1, .*\['REAX4BU1'\]"):
        prepared(several(), "dyr_approximate = true")
    ready = prepared(several(), 'dyr_approximate = true\ndyr_leave_out = ["REAX4BU1"]')
    assert ready.system.components["gfor3_1"].description.model_name == "gfl_phasor"
    assert "plant3" not in ready.system.components


def zeros(folder, gfor):
    code, out, error = gfor("modes", folder / "case.toml", "--json")
    assert code == 0, error
    found = json.loads(out)["scenarios"][0]
    assert found["stable"]
    assert found["residual"] < 1e-9
    return found["stability"]["zero_eigenvalues"], json.dumps(found["modes"])


@pytest.mark.slow
def test_one_controller_has_one_integrator_where_copies_have_eigenvalues_at_0(
    prepared, tmp_path, gfor
):
    """The reference angle gives one eigenvalue at 0; two REPCA1 that measure one point give two more."""
    prepared(several())
    count, modes = zeros(tmp_path, gfor)
    assert count == 1
    assert "plant3.P_control" in modes
    copy = "3 'REPCA1' '{0}' 9 3 9 '1' 0 1 1 0.02 2 8 0 0.05 0 0 0 0 0.1 -0.1 0 0 0.43 -0.43 1 0.5 0.25 "
    copy += "-0.0005 0.0005 99 -99 1.2 0 0.1 20 10 /\n"
    prepared("".join([*MACHINES, *(UNIT.format(k) + copy.format(k) for k in SHARES)]))
    assert zeros(tmp_path, gfor)[0] == 3


@pytest.mark.slow
def test_the_voltage_of_the_plant_returns_and_its_power_is_shared(prepared, tmp_path, gfor):
    """After a step of a load bus 9 has its voltage again, and changes of reactive power are as the shares."""
    prepared(several().replace("-0.0005 0.0005", "-1 1"))
    event = '{ type = "load_change", time = "0.1 s", load = "load_8", scale = 1.1 }'
    case = (tmp_path / "case.toml").read_text() + f"events = [{event}]\n"
    (tmp_path / "case.toml").write_text(case)
    code, _, error = gfor(
        "run", tmp_path / "case.toml", "--no-csv", "--stop", "5", "--out", tmp_path / "out"
    )
    assert code == 0, error
    (file,) = (tmp_path / "out").rglob("*.nc")
    with xr.open_dataset(file) as data:
        v, p = (data[f"grid.{name}"].values.ravel() for name in ("bus_9.v", "line_9_3.p"))
        large, small = (data[f"gfor3_{k}.q"].values.ravel() * s for k, s in (("1", 80), ("2", 48)))
    least = v.min() - v[0]
    assert least < -1e-3
    assert abs(v[-1] - v[0]) < 0.05 * abs(least)
    assert p[-1] == pytest.approx(p[0], abs=2e-3)
    assert (large[-1] - large[0]) / (small[-1] - small[0]) == pytest.approx(0.6 / 0.4, rel=0.02)
    assert small[-1] - small[0] > 0.5  # Mvar


TYPED = """\
name = "typed"
[solver]
step_size = "2 ms"
[components.grid]
model = "phasor_grid"
[power_flow]
grid = "grid"
slack = "stiff"
[network]
buses = ["north", "park"]
[network.lines]
tie = { from = "north", to = "park", X = 0.1, R = 0.01 }
[network.loads]
city = { bus = "north", p = "100 MW", q = "20 Mvar" }
[components.stiff]
model = "synchronous_generator_phasor"
machine = "classical"
bus = "north"
parameters = { S_n = 1000.0, v_0 = 1.0 }
[components.park]
model = "plant_controller_phasor"
parameters = { S_n = 150.0, Fflag = true, Kp = 0.5, dbd1 = 0.0, dbd2 = 0.0, reversed = true }
[components.gfor]
model = "wecc_plant_phasor"
records = "REGCA1 REECA1 REAX4BU1"
bus = "park"
parameters = { S_n = 100.0, P_0 = 0.9, v_0 = 1.01 }
[scenarios.plain]
"""
WIRES = {"park.delta_P": "gfor.plant.delta_P", "park.delta_Q": "gfor.plant.delta_Q"}
WIRES |= {"grid.park.v_re": "park.v_re", "grid.park.v_im": "park.v_im"}
WIRES |= {"grid.tie.p": "park.p", "grid.tie.q": "park.q"}


@pytest.mark.slow
def test_a_case_may_have_a_controller_of_its_own(tmp_path, gfor):
    """Its connections tell the start values; a value that is given stays."""
    wires = "".join(f'[[connections]]\nfrom = "{a}"\nto = "{b}"\n' for a, b in WIRES.items())
    (tmp_path / "case.toml").write_text(TYPED + wires)
    ready = prepare_one(tmp_path / "case.toml")
    given, v = ready.system.components["park"].parameters, ready.power_flow.voltages["park"]
    assert given["v_0"] == pytest.approx(1.01)
    assert given["theta_0"] == pytest.approx(np.angle(v))
    into = v * np.conj((v - ready.power_flow.voltages["north"]) / (0.01 + 0.1j))
    loss = abs(into / v) ** 2 * (0.01 + 0.1j)
    assert -given["p_0"] == pytest.approx(0.9 - loss.real, rel=1e-6)  # without the losses
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    found = json.loads(out)["scenarios"][0]
    assert found["stable"]
    assert found["residual"] < 1e-9
    (tmp_path / "case.toml").write_text(TYPED.replace("dbd1", "v_0 = 1.005, dbd1") + wires)
    other = prepare_one(tmp_path / "case.toml").system.components["park"]
    assert other.parameters["v_0"] == 1.005
