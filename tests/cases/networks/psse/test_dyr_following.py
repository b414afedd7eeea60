"""WECC's grid-following converters in dynamics data, as the phasor converter: what carries over, and what is said."""

import json

import numpy as np
import pytest

from fmus.grid_following.dyr_approximation import FIELDS, MODEL, approximation
from fmus.toolchain.catalogue import build_model
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw
from tests.cases.networks.psse.test_dyr import DYR
from tests.cases.networks.psse.test_dyr_converters import PHASORS
from tests.support.jacobians import jacobians
from tests.support.scenarios import prepare_one

REGCA1 = {
    "Lvplsw": 1,
    "Tg": 0.02,
    "Rrpwr": 10,
    "Iolim": -1.3,
    "Khv": 0.7,
    "Iqrmax": 999,
    "Iqrmin": -999,
    "Accel": 0.7,
}
REECB1 = {
    "Vdip": -99,
    "Vup": 99,
    "Trv": 0.02,
    "Iqh1": 1.1,
    "Iql1": -1.1,
    "QMax": 0.4,
    "QMin": -0.4,
    "VMAX": 1.1,
    "VMIN": 0.9,
    "Kvp": 1,
    "Kvi": 40,
    "Tiq": 0.03,
    "dPmax": 99,
    "dPmin": -99,
    "PMAX": 1,
    "Imax": 1.2,
    "Tpord": 0.05,
}


def record(name, values, **changed):
    """Text of a record of machine 1 at bus 3; what is not given is 0."""
    given = values | changed
    assert {*given} <= {*FIELDS[name]}
    return f"3 '{name}' 1 {' '.join(str(given.get(field, 0)) for field in FIELDS[name])} /\n"


def dyr(electrical="REECB1", plant="", **flags):
    text = record("REGCA1", REGCA1) + record(electrical, REECB1, **flags) + plant
    return DYR.replace("3 'GENCLS' 1  2.35 0.0 /\n", text)


@pytest.fixture
def prepared(tmp_path):
    """Text of a DYR file and of [units] → the case, ready to run."""

    def build(text, units="dyr_approximate = true", step="2 ms"):
        (tmp_path / "grid.raw").write_text(raw(33))
        (tmp_path / "grid.dyr").write_text(text)
        case = PHASORS.replace("[units]", f"[units]\n{units}").replace(
            "[components.grid]", f'[solver]\nstep_size = "{step}"\n[components.grid]'
        )
        (tmp_path / "case.toml").write_text(case)
        ready = prepare_one(tmp_path / "case.toml")
        return ready

    return build


@pytest.mark.parametrize("electrical", ["REECA1", "REECB1"])
def test_what_carries_over_and_what_is_said(electrical, prepared):
    ready = prepared(dyr(electrical))
    plan = ready.system.components["gfor3"]
    assert plan.description.model_name == MODEL
    assert {
        "current_control.tau": 0.02,
        "active_power.tau": 0.04,
        "reactive_power.mode": 0,
        "reactive_power.tau": 0.07,
        "current_limit.I_max": 1.2,
        "current_limit.priority": 2,
        "S_n": 128.0,
    }.items() <= plan.parameters.items()
    said = {question.text: question.place for question in ready.questions}
    (left,) = (text for text in said if f"not taken over from {electrical}: " in text)
    dropped = left.partition(": not taken over from ")[2].partition(": ")[2].split(", ")
    used = {"Trv", "Tiq", "Imax", "PFFLAG", "VFLAG", "QFLAG", "PQFLAG"}
    assert {*dropped} == {*FIELDS[electrical]} - used - {"PFLAG"}  # every field stands on one side
    assert said[left].endswith("grid.dyr, line 5")
    assert any("not taken over from REGCA1: Lvplsw, Rrpwr, Brkpt, " in text for text in said)


def test_voltage_control_is_an_integrator(prepared):
    values = prepared(dyr(QFLAG=1, PQFLAG=1)).system.components["gfor3"].parameters
    assert values["reactive_power.mode"] == values["current_limit.priority"] == 1
    assert 1 / (values["reactive_power.tau"] * values["reactive_power.X_s"]) == pytest.approx(40)


@pytest.mark.parametrize(
    ("text", "units", "words"),
    [
        (
            dyr("REECA1").replace("'REECA1'", "'WT4E2'"),
            "",
            r"line 6: no part of ours stands for WT4E2, a grid-following converter; write replace = ",
        ),
        (
            dyr(QFLAG=1, VFLAG=1),
            None,
            r"line 5: the converter at bus 3 cannot be .*VFLAG = 1, a voltage control",
        ),
        (dyr("REECA1", PFLAG=1), None, r"REECA1 has PFLAG = 1, power by the speed of a turbine"),
        (dyr(QFLAG=2), None, r"REECB1 has QFLAG = 2; it is 0 or 1"),
        (
            dyr(QFLAG=1, Kvi=0),
            None,
            r"REECB1 has QFLAG = 1 and Kvi = 0; a voltage control needs its integrator",
        ),
        (
            dyr(plant="3 'REPCA1' 1 0 /\n"),
            None,
            r"line 7: no part .* REPCA1.*write dyr_leave_out = \['REPCA1'\]",
        ),
        (
            dyr().replace("'REECB1' 1 0", "'REECB1' 1"),
            None,
            r"line 6: REECB1 has 29 values, and needs 30: BUSR, PFF",
        ),
        (
            dyr(plant=record("REGCA1", REGCA1, Tg=0.03)),
            None,
            r"line 7: a second REGCA1 of machine '1' at bus 3",
        ),
        (
            dyr(plant=record("REECA1", REECB1)),
            None,
            r"line 7: a second REECA1 of machine '1' at bus 3",
        ),
        (
            dyr(plant="3 'SEXS' 1  0.1 10.0 100.0 0.05 -5.0 5.0 /\n"),
            None,
            r"is a converter, and has records of its",
        ),
        (
            dyr().replace("3 'REECB1'", "1 'REECB1'"),
            None,
            r"REGCA1 is there, and REECA1 or REECB1 is not; together",
        ),
    ],
)
def test_what_cannot_be_approximated_is_refused(text, units, words, prepared):
    with pytest.raises(CaseError, match=f"(?s){words}"):
        prepared(text, "dyr_approximate = true" if units is None else units)


def test_a_plant_controller_that_is_left_out_is_said(prepared):
    ready = prepared(
        dyr(plant="3 'REPCA1' 1 0 /\n"), 'dyr_approximate = true\ndyr_leave_out = ["REPCA1"]'
    )
    (place,) = (
        q.place
        for q in ready.questions
        if "REPCA1 left out, as dyr_leave_out says: the ref" in q.text
    )
    assert place.endswith("grid.dyr, line 7")


def test_two_figures_for_the_subtransient_reactance_are_questioned(prepared):
    assert not [question for question in prepared(DYR).questions if "ZX" in question.text]
    ready = prepared(DYR.replace(" 0.12 ", " 0.13 "))
    (asked,) = (question for question in ready.questions if "ZX" in question.text)
    assert asked.place.endswith("grid.dyr, line 2")
    assert (
        "sg1: GENROU has X''d = 0.13 pu, and the RAW file has ZX = 0.12 pu of the same machine in line 19"
        in asked.text
    )
    assert 'meant = ["sg1.machine.X_d2"]' in asked.text


@pytest.mark.parametrize(("hertz", "most"), [(0.2, 0.02), (0.5, 0.02), (1.0, 0.04), (2.0, 0.11)])
def test_its_admittance_is_that_of_the_records_below_two_hertz(hertz, most):
    """Change of the current by that of the voltage: WECC's block diagrams by hand, with QFLAG = 0, at v = 1."""
    P, Q, lag, current, reactive = 0.8, 0.2, 0.02, 0.02, 0.02
    full = {name: dict.fromkeys(FIELDS[name], 0.0) for name in ("REGCA1", "REECB1")}
    full["REGCA1"]["Tg"] = current
    full["REECB1"] |= {"Trv": lag, "Tiq": reactive, "Imax": 1.2}
    values = approximation(full)[0] | {"S_n": 100.0, "P_0": P, "Q_0": Q, "v_0": 1.0}
    model = build_model(MODEL)
    assert {*values} <= {v.name for v in model.parameters}
    p = np.array([float(values.get(v.name, v.start)) for v in model.parameters])
    c, x = model.initialise(p)
    u = np.array([{"v_re": 1.0}.get(i.name, i.start) for i in model.inputs])
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, u, p, c))
    rows = [[v.name for v in model.outputs].index(name) for name in ("i_re", "i_im")]
    columns = [[v.name for v in model.inputs].index(name) for name in ("v_re", "v_im")]
    s = 2j * np.pi * hertz
    found = (
        C[rows] @ np.linalg.solve(s * np.eye(len(A)) - A, B[:, columns]) + D[np.ix_(rows, columns)]
    )
    follows = 1 / ((1 + s * lag) * (1 + s * current))
    wanted = np.array([[-P * follows, Q], [Q * follows / (1 + s * reactive), P]])
    assert np.linalg.norm(found - wanted) < most * np.linalg.norm(wanted)


@pytest.mark.slow
@pytest.mark.parametrize("step", ["2 ms", "5 ms"])
def test_the_system_with_it_has_a_steady_state_and_damped_modes(step, prepared, tmp_path, gfor):
    prepared(dyr(), step=step)
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert scenario["stable"]


@pytest.mark.parametrize(
    ("name", "flags", "numbers"), [("REGCA1", 1, 14), ("REECA1", 6, 45), ("REECB1", 5, 25)]
)
def test_a_record_has_the_fields_of_the_program(name, flags, numbers):
    """ICONs and CONs of PSS/E's model library; no field stands twice."""
    assert len(FIELDS[name]) == len(set(FIELDS[name])) == flags + numbers


@pytest.mark.parametrize("approximates", [True, False])
def test_the_title_of_a_new_case_tells_of_the_approximation(approximates, tmp_path, gfor):
    (tmp_path / "grid.raw").write_text(raw(33))
    (tmp_path / "grid.dyr").write_text(dyr() if approximates else DYR)
    case = tmp_path / "case.toml"
    files = (tmp_path / "grid.raw", tmp_path / "grid.dyr")
    code, _, error = gfor("new", *files, "--dyr-approximate", "--out", case)
    assert code == 0, error
    title = "As in the files" + ", with WECC's converters approximated" * approximates
    assert f'title = "{title}"' in case.read_text()
