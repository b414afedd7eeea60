"""CDC4T at a DC line of the RAW file: its stations, their wires, its start, modes and runs, and what is asked."""

import json
import math
import re

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import CaseError, InputError
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.linear_model import HELD
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.studies.modes.modes import ModesResult, compute_modes
from orchestrator.studies.operating_points.outages import read_outages, what_remains
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.runs.after_events import modes_after
from orchestrator.systems.coupling.master import Master
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_devices import lines_of
from tests.cases.networks.psse.test_dyr import CASE, DYR
from tests.cases.networks.psse.test_dyr_converters import PHASORS
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.usefixtures("undrawn")

CDC4T = """\
'TIE 1' 'CDC4T' 5 15 0.05 0.04 0.6 0.65 0.1 80 0.8 0.12 50 60 5 4
  20 100 130 220 240 250 300 0.15 /
"""
RECTIFIER, INVERTER = "dc_TIE_1_5", "dc_TIE_1_8"
SOLVER = '[solver]\nstep_size = "2 ms"\nstop_time = "1 s"\nrecord = ["grid.*.v"]\n[components.grid]'


def lines(*changes):
    """Lines of the DC line's record, with parts of them replaced."""
    found = lines_of("TWO-TERMINAL DC", 33)
    for old, new in changes:
        assert any(old in line for line in found), old
        found = [line.replace(old, new) for line in found]
    return found


@pytest.fixture
def prepared(tmp_path):
    """Text of the line's record of dynamics data → the case, ready to run; with a model it records that."""

    def build(
        text=CDC4T, units="", dc=None, case=PHASORS, *, recorded=False, joined=False, **overrides
    ):
        found = records(33)
        found["BRANCH"] += ["5,8,'1 ',0,1e-6,0,0,0,0,0,0,0,0,1,1,0,1,1"] if joined else []
        found["TWO-TERMINAL DC"] = lines() if dc is None else dc
        (tmp_path / "grid.raw").write_text(raw(33, found))
        (tmp_path / "grid.dyr").write_text(DYR + text)
        case = case.replace("[units]", f"[units]\n{units}")
        solver = SOLVER.replace('["', '["dc_*", "') if text == CDC4T and recorded else SOLVER
        (tmp_path / "case.toml").write_text(case.replace("[components.grid]", solver))
        return prepare_one(
            tmp_path / "case.toml", None, {k.replace("__", "."): x for k, x in overrides.items()}
        )

    return build


def sources(ready):
    return {str(c.target): str(c.source) for c in ready.system.connections}


def texts(ready):
    return " ".join(" ".join(q.text.split()) for q in ready.questions)


def test_a_line_with_a_record_is_a_station_at_each_bus(prepared):
    """Figures of the RAW file's line and of the record; the current is what 60 MW and 250 kV ask for."""
    ready = prepared()
    plans, fed = ready.system.components, sources(ready)
    first, second = (plans[name].parameters for name in (RECTIFIER, INVERTER))
    assert plans[RECTIFIER].description.model_name == "lcc_rectifier_phasor"
    assert plans[INVERTER].description.model_name == "lcc_inverter_phasor"
    for p in (first, second):
        assert (p["N"], p["X_c"], p["E_n"]) == (1, 12.0, pytest.approx(230 * 0.92))
        assert p["V_dc_0"] == pytest.approx(250)
    assert (first["R_dc"], first["DELTI"], first["VSCHD"], first["mode"]) == (8.0, 0.1, 250.0, 1)
    assert (first["ALFDY"], first["CRAMP"], first["C3"]) == (5, 4, 300)
    assert (first["TCMODE"], first["V1"], first["TIDC"]) == (0.15, 100, 0.04)
    assert (second["GAMDY"], second["holds_angle"]) == (15, False)
    assert "GAMDY" not in first
    current = (math.sqrt(250**2 + 4 * 8 * 60) - 250) / 16
    assert first["P_0"] * first["S_n"] == pytest.approx(-60)
    assert second["P_0"] * second["S_n"] == pytest.approx(250 * current)
    assert fed[f"{RECTIFIER}.inverter.V_most"] == f"{INVERTER}.V_most"
    assert fed[f"{RECTIFIER}.inverter.beyond"] == f"{INVERTER}.beyond"
    assert fed[f"{INVERTER}.I_dc"] == f"{RECTIFIER}.inverter_I"
    assert fed[f"{INVERTER}.V_dc"] == f"{RECTIFIER}.inverter_V"
    assert fed[f"{INVERTER}.v_re"] == "grid.bus_8.v_re"
    assert not [x.name for x in ready.network.loads if x.name.startswith("dc_")]
    used = {r.kind: str(r.use) for r in ready.records if r.kind in ("CDC4T", "two-terminal dc")}
    assert used == {"CDC4T": "used", "two-terminal dc": "used"}
    assert "CDC4T: 1 DC line with the model of its record, 60 MW" in texts(ready)
    assert "without dynamics" not in texts(ready)


def test_ends_at_buses_that_are_one_are_two_stations(gfor, prepared, tmp_path):
    """A line without impedance joins the DC line's buses: each station has its own power and wires."""
    ready = prepared(recorded=True, joined=True)
    rectifier, inverter = "dc_TIE_1_5", "dc_TIE_1_5_2"
    plans, fed = ready.system.components, sources(ready)
    current = (math.sqrt(250**2 + 4 * 8 * 60) - 250) / 16
    first, second = (plans[name].parameters for name in (rectifier, inverter))
    assert first["P_0"] * first["S_n"] == pytest.approx(-60)
    assert second["P_0"] * second["S_n"] == pytest.approx(250 * current)
    assert fed[f"{rectifier}.inverter.V_most"] == f"{inverter}.V_most"
    assert fed[f"{inverter}.I_dc"] == f"{rectifier}.inverter_I"
    assert fed[f"{rectifier}.v_re"] == fed[f"{inverter}.v_re"] == "grid.bus_5.v_re"
    run = responses(gfor, tmp_path, "--stop", "0.2")
    for name in (f"{rectifier}.p", f"{rectifier}.q", f"{inverter}.p", f"{inverter}.q"):
        assert np.ptp(run[name].to_numpy()) < 1e-5, name


@pytest.mark.parametrize("text", [CDC4T, ""], ids=["with a record", "without"])
def test_a_line_from_a_bus_to_itself_is_one_error_at_its_record(prepared, text):
    with pytest.raises((CaseError, InputError)) as refused:
        prepared(text, dc=lines(("8,1,22", "5,1,22")))
    assert str(refused.value).count("has its rectifier and its inverter at one bus, 5") == 1
    assert "has no variable" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "mode"),
    [
        (("1,8.0,60.0", "2,8.0,240.0"), 0),
        (("60.0,250", "-60.0,250"), 2),
        ((",0.1,'I'", ",0,'I'"), 1),
    ],
)
def test_what_a_line_holds_is_its_records(prepared, change, mode):
    """MDC 2 holds the current, and a power below 0 is the inverter's."""
    parameters = prepared(dc=lines(change)).system.components[RECTIFIER].parameters
    assert parameters["mode"] == mode


def test_an_angle_without_a_band_is_held(prepared):
    ready = prepared(dc=lines(("22,17", "17,17")))
    assert ready.system.components[INVERTER].parameters["holds_angle"] is True


def responses(gfor, tmp_path, *options):
    code, _, err = gfor(
        "run", tmp_path / "case.toml", *options, "--out", tmp_path / "run", "--no-csv"
    )
    assert code == 0, err
    (path,) = (tmp_path / "run").rglob("trajectory.nc")
    return xr.open_dataset(path)


def interruptions_told(tmp_path):
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    (scenario,) = summary["scenarios"]
    assert "DC lines that are blocked or bypassed: dc_TIE_1_5 at 1" in json.dumps(summary)
    return [one for one in scenario["findings"] if one["kind"] == "interruption"]


def test_it_starts_where_the_power_flow_is_with_the_lines_loss_between_its_ends(
    gfor, prepared, tmp_path
):
    plans = prepared(recorded=True).system.components
    run = responses(gfor, tmp_path, "--stop", "0.5")
    for name in run.data_vars:
        if name.startswith("dc_"):
            assert np.ptp(run[name].to_numpy()) < 1e-5, name
    p = {name: plans[name].parameters for name in (RECTIFIER, INVERTER)}
    at = {name: float(run[name][0]) for name in run.data_vars if name.startswith("dc_")}
    drawn, fed = (at[f"{name}.p"] * p[name]["S_n"] for name in (RECTIFIER, INVERTER))
    assert drawn == pytest.approx(-60, abs=1e-4)
    assert -drawn - 8 * at[f"{RECTIFIER}.I_dc"] ** 2 == pytest.approx(fed, abs=1e-4)
    for name in (RECTIFIER, INVERTER):
        assert at[f"{name}.q"] == pytest.approx(p[name]["Q_0"], abs=1e-6)


def step_map(master, names):
    """Map of states and of what the exchange remembers, each up and down for a real communication step."""
    state = CoupledState(master)
    x = state.read()
    held = [master.output_names.index(n.removesuffix(HELD)) for n in names if n.endswith(HELD)]
    y = master.y[held].copy()

    def step(moved):
        saved = state._save()
        state.write(x + moved[: len(x)])
        master.y[held] = y + moved[len(x) :]
        master.advance(1)
        found = np.concatenate([state.read(), master.y[held]])
        state._restore(*saved)
        return found

    size = 1e-5 * np.maximum(1.0, np.abs([*x, *y]))
    moves = np.diag(size)
    return np.column_stack([(step(d) - step(-d)) / (2 * d.max()) for d in moves])


@pytest.mark.parametrize("dc", [None, [("22,17", "17,17")]], ids=["voltage", "angle"])
def test_the_step_map_is_that_of_the_whole(prepared, dc):
    ready = prepared(dc=lines(*dc) if dc else None)
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        composed = compose(Blocks(master), master.schedule)
        whole = step_map(master, composed.names)
    assert np.abs(composed.A - whole).max() < 1e-6


def test_a_fault_at_the_inverter_bypasses_it_and_it_comes_back(gfor, prepared, tmp_path):
    """Its voltage falls at once; the current is held by the limit; after the fault both rise by their ramps."""
    prepared(recorded=True)
    run = responses(
        gfor, tmp_path, "--fault", "bus_8, 100 ms", "--stop", "3", "--set", f"{RECTIFIER}.VBLOCK=0"
    )
    time = run["time"].to_numpy()

    def at(t, name):
        return float(run[name].to_numpy()[np.argmin(np.abs(time - t))])

    begin = 1.0  # of a fault of --fault
    assert at(begin - 0.01, f"{RECTIFIER}.bypassed") == 0
    assert at(begin + 0.05, f"{RECTIFIER}.bypassed") == 1
    assert at(begin + 0.05, f"{INVERTER}.p") == pytest.approx(0, abs=1e-3)
    assert at(begin + 0.05, f"{RECTIFIER}.inverter_I") == 0
    assert at(begin + 0.09, f"{RECTIFIER}.I_dc") < 0.22
    assert at(begin + 0.4, f"{RECTIFIER}.bypassed") == 0
    rising = [at(begin + t, f"{RECTIFIER}.V_inverter") for t in (0.16, 0.2, 0.24)]
    assert np.diff(rising) == pytest.approx(5 * 250 * 0.04, rel=0.05)
    start = at(0.5, f"{INVERTER}.p")
    assert at(begin + 1.9, f"{INVERTER}.p") == pytest.approx(start, rel=0.01)
    (told,) = interruptions_told(tmp_path)
    assert told["variable"] == "bypassed"
    assert begin <= told["time"] < begin + 0.02
    assert begin + 0.1 < told["until"] < begin + 0.4
    assert told["power_mw"] == pytest.approx(60)


def test_a_fault_at_the_rectifier_blocks_it(gfor, prepared, tmp_path):
    prepared(recorded=True)
    run = responses(gfor, tmp_path, "--fault", "bus_5, 100 ms", "--stop", "3")
    time = run["time"].to_numpy()
    blocked = run[f"{RECTIFIER}.blocked"].to_numpy()
    assert blocked[np.argmin(np.abs(time - 1.05))] == 1
    assert blocked[np.argmin(np.abs(time - 1.25))] == 0
    current = run[f"{RECTIFIER}.I_dc"].to_numpy()
    assert current[np.argmin(np.abs(time - 1.05))] == 0
    assert current[-1] == pytest.approx(current[0], rel=0.01)
    assert [told["variable"] for told in interruptions_told(tmp_path)] == ["blocked"]


def test_with_the_delays_of_cdc6t_it_blocks_and_comes_back_behind_them(gfor, prepared, tmp_path):
    """TRB from the fault's begin; TIUB and TCOM from its end, which are longer than TBLOCK and TRUB."""
    delays = "0.8 0.04 0.05 0 0.03 0 0.1 0.12 0 0.04"
    text = CDC6T.format(delays).replace(" 0.6 0.65 0.1 80", " 0 0.65 0.1 0")
    prepared(text)
    responses(gfor, tmp_path, "--fault", "bus_5, 100 ms", "--stop", "3")
    (told,) = interruptions_told(tmp_path)
    assert told["variable"] == "blocked"
    assert told["time"] == pytest.approx(1.04, abs=0.008)
    assert told["until"] == pytest.approx(1.1 + 0.12 + 0.03, abs=0.01)


def test_left_out_it_is_a_load_at_each_bus(prepared):
    ready = prepared(units="dyr_leave_out = ['CDC4T']")
    assert RECTIFIER not in ready.system.components
    assert {x.name for x in ready.network.loads if x.name.startswith("dc_")} == {
        RECTIFIER,
        INVERTER,
    }
    assert "1 two-terminal DC line without dynamics" in texts(ready)
    assert "is of no machine" not in texts(ready)


def test_among_emt_models_it_is_a_load_and_the_question_says_which_models_have_it(prepared):
    ready = prepared(case=CASE)
    assert RECTIFIER not in ready.system.components
    assert 'its model is one of phasors: write models = "phasor"' in texts(ready)


@pytest.mark.parametrize(
    ("text", "dc"),
    [
        (CDC4T.replace("TIE 1", "TIE 2"), None),
        (CDC4T, lines(("'TIE 1',1", "'TIE 1',0"))),
        (CDC4T, lines(("'1',0.0", "'1',5.0"))),
    ],
    ids=["no such line", "out of service", "capacitors"],
)
def test_a_record_without_a_line_that_it_fits_is_asked_about(prepared, text, dc):
    ready = prepared(text, dc=dc)
    assert RECTIFIER not in ready.system.components
    assert "CDC4T (DC line TIE" in texts(ready)
    assert "no DC line of this name in service with a current" in texts(ready)


def test_limits_beyond_which_it_starts_are_asked_about(prepared):
    text = CDC4T.replace("5 15 0.05", "25 28 0.05").replace("250 300", "250 230")
    text = text.replace(" 0.6 0.65", " 1.05 1.1").replace("80 0.8", "255 0.8")
    ready = prepared(text)
    found = texts(ready)
    assert "ALFDY is 25 degrees, and the line starts with a firing angle of" in found
    assert "GAMDY is 28 degrees, and the line starts with a extinction angle" not in found
    assert "GAMDY is 28 degrees, and the line starts with an extinction angle of" in found
    assert "the limit of the current is 230 A at the 250 kV of the start, where 238.2 A" in found
    assert "VBLOCK is 1.05 pu, and the rectifier's bus has 0.9" in found
    assert "VBYPAS is 255 kV, and the inverter has 250 kV at the start" in found


def test_thresholds_that_do_not_fit_each_other_are_asked_about(prepared):
    found = texts(prepared(CDC4T.replace(" 0.6 0.65 0.1 80", " 0.7 0.65 0.1 0.3")))
    assert "VUNBL is 0.65 pu, below VBLOCK of 0.7 pu" in found
    assert (
        "VBYPAS is 0.3 kV, and the inverter has 250 kV at the start: it hardly ever acts" in found
    )
    assert "hardly ever acts" not in texts(prepared(CDC4T.replace("0.1 80", "0.1 0")))


def test_nothing_else_is_asked_about_a_line_within_its_limits(prepared):
    kinds = [q for q in prepared().questions if "TIE 1" in q.text and "CDC4T" in q.text]
    assert len(kinds) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CDC4T + CDC4T, "a second CDC4T of the DC line 'TIE 1'; remove one"),
        (CDC4T.replace(" 0.15 /", " /"), "CDC4T has 21 values, and needs 22: ALFDY"),
        (CDC4T.replace("5 15 0.05", "5 x 0.05"), "CDC4T has GAMDY = 'x'; it must be a number"),
    ],
)
def test_what_cannot_be_is_refused(prepared, text, words):
    with pytest.raises(CaseError, match=words):
        prepared(text)


def test_points_of_the_currents_limit_that_do_not_rise_are_refused_by_their_line(prepared):
    text = r"grid\.dyr, line \d+: CDC4T of the DC line 'TIE 1' has V2 = 90 kV behind V1 = 100 kV: V2 must exceed"
    with pytest.raises(CaseError, match=text):
        prepared(CDC4T.replace("220 240", "90 240"))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("5 15 0.05", "0.087 0.26 0.05"), ("ALFDY = 0.087", "GAMDY = 0.26")),
        (("5 15 0.05 0.04", "5 15 50 40"), ("TVDC = 50", "TIDC = 40")),
        (("0.65 0.1 80", "0.65 100 80"), ("TBLOCK = 100",)),
    ],
)
def test_angles_in_radians_and_times_in_milliseconds_are_asked_about(prepared, change, said):
    found = texts(prepared(CDC4T.replace(*change)))
    for one in said:
        assert one in found


CDC6T = CDC4T.replace("CDC4T", "CDC6T").replace(" /", " {} /")
OF_CDC6T = "{vrb} 0.1 0.05 0 0.02 0 0.1 0 0 0.04"


def test_cdc6t_is_cdc4t_with_its_own_delays(prepared):
    plain = prepared().system.components[RECTIFIER].parameters
    ready = prepared(CDC6T.format(OF_CDC6T.format(vrb=0.8)))
    plan = ready.system.components[RECTIFIER]
    own = ("VRB", "TRB", "TRUB", "VIB", "TCOM", "VIY", "TIY", "TIUB", "TIUY")
    assert [plan.parameters[name] for name in own] == [0.8, 0.1, 0.05, 0, 0.02, 0, 0.1, 0, 0]
    assert {name: x for name, x in plan.parameters.items() if name not in own} == plain
    assert plan.description.model_name == "lcc_rectifier_cdc6t_phasor"
    assert "CDC6T: 1 DC line with the model of its record, 60 MW" in texts(ready)


def test_the_modes_of_cdc6t_are_those_of_cdc4t(prepared):
    """In service no delay acts."""
    plain, waiting = (
        [mode.eigenvalue for mode in compute_modes(ready).modes]
        for ready in (prepared(), prepared(CDC6T.format(OF_CDC6T.format(vrb=0.8))))
    )
    assert plain
    assert waiting == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize(
    ("limits", "field"),
    [("1.05 0.1 0.05 0", "VRB"), ("0.8 0.1 0 1.2", "VIB")],
)
def test_a_line_that_starts_below_a_limit_of_its_delays_is_asked_about(prepared, limits, field):
    said = texts(prepared(CDC6T.format(f"{limits} 0.02 0 0.1 0 0 0.04")))
    assert re.search(rf"{field} is [\d.]+ pu, and the \w+'s bus has .* at the start: it acts", said)


def test_cdc6t_with_the_fields_of_cdc4t_is_refused(prepared):
    with pytest.raises(CaseError, match="CDC6T has 22 values, and needs 32"):
        prepared(CDC6T.format(""))


def test_wrong_counts_of_all_kinds_of_records_are_told_together(prepared):
    """Of two motors, a composite load, two relays of loads, one of a machine, and a DC line."""
    wrong = (
        "5 'CIM5BL' 1 1 2 3 /\n6 'CIM6BL' 1 1 2 /\n8 'CMLDBLU2' 1 4 5 /\n"
        "5 'LVSHBL' 1 0.8 0.1 /\n6 'LDSHBL' 1 59 0.1 /\n0 'VTGTPAT' 1 1 '1' 0.5 /\n"
    )
    with pytest.raises(CaseError) as refused:
        prepared(wrong + CDC6T.format(""))
    problem = refused.value.problems[0]
    told = [line for line in problem.text.splitlines() if " values" in line]
    names = ("CIM5BL", "CIM6BL", "CMLDBLU2", "CDC6T", "VTGTPAT", "LVSHBL", "LDSHBL")
    assert [next(name for name in names if name in line) for line in told] == [*names]


def test_a_dc_line_is_lost_by_the_name_that_its_file_gives_it(prepared):
    elements = Elements.of(prepared())
    _, named = read_outages("tie 1", elements)
    _, station = read_outages(RECTIFIER, elements)
    assert named == station


def test_an_unknown_outage_is_told_that_dc_lines_count(prepared):
    with pytest.raises(InputError, match="no unit, line, DC line, load or shunt 'DCB'"):
        read_outages("DCB", Elements.of(prepared()))


def test_ends_that_do_not_fit_are_refused(prepared):
    with pytest.raises(CaseError, match="a DC line cannot start so; set P_0 and V_dc_0 of both"):
        prepared(**{f"{INVERTER}__P_0": 0.5})


def test_an_end_beyond_the_part_that_is_studied_keeps_its_voltage(gfor, tmp_path):
    """A machine behind the DC line alone: its system has a frequency of its own, and the rectifier feeds from there."""
    found = records(33)
    found["BUS"].append("11,'FAR', 230.0,2,1,1,1,1.01,-20.0,1.1,0.9,1.1,0.9")
    machine = "11,'1 ',60,0,300,-300,1.01,0,200,0,0.2,0,0,1,1,100,200,0,1,1"
    found["GENERATOR"].append(machine)
    found["TWO-TERMINAL DC"] = lines(("5,1,20", "11,1,20"))
    (tmp_path / "grid.raw").write_text(raw(33, found))
    (tmp_path / "grid.dyr").write_text(DYR + "11 'GENCLS' 1 5 0 /\n" + CDC4T)
    files = (tmp_path / "grid.raw", tmp_path / "grid.dyr")
    code, _, err = gfor(
        *("new", *files, "--models", "phasor", "--out", tmp_path / "case.toml", "--json")
    )
    assert code == 0, err
    code, out, err = gfor("modes", tmp_path / "case.toml", "--scenario", "base", "--json")
    assert code == 0, err
    answer = json.loads(out)
    assert "dc_TIE_1_11, an end of the DC line 'TIE 1', is beyond the part" in err + out
    ready = prepare_one(tmp_path / "case.toml", "base")
    plan = ready.system.components["dc_TIE_1_11"]
    assert complex(plan.inputs["v_re"], plan.inputs["v_im"]) == pytest.approx(
        1.01 * np.exp(-1j * math.radians(20))
    )
    assert plan.parameters["v_0"] == pytest.approx(1.01)
    assert INVERTER in ready.system.components
    assert answer["scenarios"][0]["modes"]
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        before = master.y.copy()
        master.advance(100)
        assert np.abs(master.y - before).max() < 1e-5


def test_without_a_step_its_modes_are_those_of_short_steps(prepared):
    """Both stations tell each other values at once, and no output comes back to itself."""
    ready = prepared()
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        exact = np.linalg.eigvals(continuous(Blocks(master, without_step=True)).A)
        z = np.linalg.eigvals(compose(Blocks(master), master.schedule).A).astype(complex)
    stepped = np.log(z[np.abs(z) > 0.1]) / ready.step_size
    swings = exact[(exact.imag > 1) & (exact.imag < 12)]
    assert len(swings)
    for value in swings:
        assert np.abs(stepped / value - 1).min() < 1e-4


@pytest.mark.parametrize("lost", [RECTIFIER, INVERTER])
def test_with_a_station_its_line_is_lost(prepared, lost):
    ready = prepared()
    remains = what_remains(ready, Elements.of(ready), [lost])
    assert {*remains.units} == {RECTIFIER, INVERTER}
    assert not remains.dead


def test_a_line_with_both_ends_out_of_service_is_no_line(prepared):
    """Its stations feed nothing, and that fits; one alone that feeds does not."""
    ready = prepared(**{f"{end}__connected": False for end in (RECTIFIER, INVERTER)})
    assert [ready.system.components[end].number("P_0") for end in (RECTIFIER, INVERTER)] == [0, 0]
    with pytest.raises(CaseError, match="or take both out of service"):
        prepared(**{f"{RECTIFIER}__connected": False})


def test_an_outage_of_each_unit_takes_a_dc_line_once(prepared):
    elements = Elements.of(prepared())
    assert {RECTIFIER, INVERTER} <= {*elements.units}
    for kind in ("units", "n-1"):
        names = " ".join(outage.name for outage in read_outages(kind, elements))
        assert names.count("dc_TIE_1") == 1


@pytest.mark.parametrize("lost", [RECTIFIER, INVERTER])
def test_after_the_trip_of_a_station_the_modes_are_those_without_its_line(prepared, tmp_path, lost):
    """Planted before: the other station alone was refused, as no line can start so."""
    trip = f'events = [{{ type = "unit_trip", time = "0.2 s", unit = "{lost}" }}]\n'
    prepared()
    text = (tmp_path / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(
        text.replace("[scenarios.plain]\n", f"[scenarios.plain]\n{trip}")
    )
    after = modes_after(prepare_one(tmp_path / "case.toml", None, {}), (0.1, 2.0))
    both = {f"{end}__connected": False for end in (RECTIFIER, INVERTER)}
    expected = compute_modes(prepared(**both))
    assert isinstance(after, ModesResult)
    assert [m.eigenvalue for m in after.modes] == pytest.approx(
        [m.eigenvalue for m in expected.modes], rel=1e-6
    )
    assert not any(RECTIFIER in name or INVERTER in name for name in after.model.names)


def test_a_run_in_which_the_rectifier_trips_is_kept(gfor, prepared, tmp_path):
    prepared(recorded=True)
    text = (tmp_path / "case.toml").read_text()
    trip = f'events = [{{ type = "unit_trip", time = "0.2 s", unit = "{RECTIFIER}" }}]\n'
    assert "[scenarios.plain]\n" in text
    (tmp_path / "case.toml").write_text(
        text.replace("[scenarios.plain]\n", f"[scenarios.plain]\n{trip}")
    )
    run = responses(gfor, tmp_path, "--stop", "0.5")
    for name in (RECTIFIER, INVERTER):
        assert abs(float(run[f"{name}.p"][0])) > 0.5
        assert float(run[f"{name}.p"][-1]) == pytest.approx(0, abs=1e-4)
