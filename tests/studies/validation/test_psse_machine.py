"""A machine that PSS/E simulated, by the voltage at its own terminals: it comes back, and so do its parameters.

`tests/reference/psse_sexs_flow.csv` holds the voltage of bus 102 and the flow of line 101-103 from SEXS_RESULTS.csv of
PowerSimulationsDynamics.jl (test/benchmarks/psse/SEXS, PSS/E 34's recording of a trip of line 101-102 at 1 s), the
first 6 s. Bus 101 is infinite and the load a constant impedance, so that Kirchhoff's laws give angle, P and Q."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
FLOW = Path(__file__).parents[2] / "reference" / "psse_sexs_flow.csv"
LINE = 0.01 + 0.12j  # each of the three [pu on 100 MVA]
LOAD, LOADED_AT = (
    2.5 + 0.3j,
    0.99341,
)  # of bus 103 [pu], and its voltage in the power flow of the RAW file
SHORT = 3.0  # end of a recording that is enough where no value is found [s]
INFINITE, TRIP = 1.05, 1.0  # voltage of bus 101 [pu]; the line 101-102 is out from then on [s]

CASE = """
name = "one_machine"
[solver]
step_size = "1 ms"
stop_time = "1 s"
groups = [["machine"], ["grid"]]

[components.machine]
model = "synchronous_generator_phasor"
machine = "genrou"
exciter = "sexs"
governor = "constant_power"
stabilizer = "none"
[components.machine.parameters]
S_n = "100 MVA"
f_n = "60 Hz"
P_0 = 1.0
Q_0 = -0.0325
v_0 = 1.02
machine = { R_s = 0, T_d10 = 8, T_d20 = 0.03, T_q10 = 0.4, T_q20 = 0.05, H = 6.175, D = 0.05, X_d = 1.8, X_q = 1.7, \
X_d1 = 0.3, X_q1 = 0.55, X_d2 = 0.25, X_l = 0.2, s_10 = 0.1, s_12 = 0.8, speed_in_emf = false }
exciter = { T_R = 0, T_A = 2, T_B = 5, K = 20, T_E = 1, E_MIN = -50, E_MAX = 50 }
transformer = { X_t = 0, R_t = 0 }
governor.output_is_torque = false

[components.grid]
model = "infinite_bus"
parameters = { P_0 = 1.0, Q_0 = -0.0325, v_0 = 1.02, f_n = 60 }
"""
WIRES = (
    ("grid.v_re", "machine.v_re"),
    ("grid.v_im", "machine.v_im"),
    ("machine.i_re", "grid.i_re"),
    ("machine.i_im", "grid.i_im"),
)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("psse") / "case.toml"
    wires = [f'[[connections]]\nfrom = "{a}"\nto = "{b}"\n' for a, b in WIRES]
    path.write_text(CASE + "".join(wires), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def recording():
    """Voltage, P and Q at the terminals of PSS/E's machine, with an instrument's last digits."""
    flow = pd.read_csv(FLOW)
    to_load = np.conj((flow.p_101_103_mw + 1j * flow.q_101_103_mvar).to_numpy() / 100 / INFINITE)
    v_103 = INFINITE - LINE * to_load
    of_load = np.conj(LOAD) / LOADED_AT**2 * v_103
    v = v_103 + LINE * (of_load - to_load)
    assert np.abs(np.abs(v) - flow.v_pu).max() < 1e-5
    tripped = flow.time.to_numpy() >= TRIP
    power = 100 * v * np.conj(of_load - to_load + np.where(tripped, 0, (v - INFINITE) / LINE))
    noise = np.random.default_rng(1).normal(0, 0.02, (2, len(v)))  # [MVA]
    columns = {
        "v_pu": np.abs(v),
        "angle_deg": np.rad2deg(np.angle(v)),
        "p_mw": power.real + noise[0],
        "q_mvar": power.imag + noise[1],
    }
    return pd.DataFrame(columns, index=pd.Index(flow.time, name="time"))


def validated(case, recording, **more):
    return gfor_in_python.validate(
        case, recording, component="machine", step="1 ms", average=0, **more
    )


def test_pss_es_machine_comes_back_by_its_own_terminal_voltage(case, recording):
    found = validated(case, recording)
    assert found.questions == []
    after = found.table().query("window == 'after' and signal in ('p', 'q')")
    assert after["mean_abs_error_pu"].max() < 5e-4


def behind_a_lag(frame, column, seconds=0.05):
    part = 1 - np.exp(-0.005 / seconds)
    first = frame[column].iloc[0]
    return frame.assign(
        **{column: scipy_signal.lfilter([part], [1, part - 1], frame[column] - first) + first}
    )


def test_the_parameters_of_pss_es_machine_are_found_again(case, recording):
    off = {"machine.machine.H": 5.0, "machine.exciter.K": 26.0}
    found = validated(case, recording, values=off, fit=["machine.H", "exciter.K"])
    assert found.result.fit.reached
    truth = {"machine.H": 6.175, "exciter.K": 20.0}
    for row in found.fitted().itertuples():
        assert row.identifiable
        assert row.value == pytest.approx(truth[row.parameter], rel=0.02)


def fitted(case, recording, inertia, **more):
    """The one parameter of a fit that begins at an inertia."""
    values = {"machine.machine.H": inertia}
    (row,) = validated(case, recording, values=values, **more).as_json()["fit"]
    return row


def test_an_inertia_is_found_from_six_times_its_value(case, recording):
    """Slopes alone end at 147 s, with an interval from 63 to 231."""
    row = fitted(case, recording, 40.0, fit="machine.H")
    assert row["identifiable"]
    assert row["low"] < 6.175 < row["high"]
    assert row["high"] - row["low"] < 0.1


def test_a_fit_that_finds_nothing_better_is_told_and_shows_no_interval(case, recording):
    """The inertia is wrong, and an exciter's time constant is fitted in its place."""
    row = fitted(case, recording[:SHORT], 40.0, fit="exciter.T_B")
    assert row["why_not"] == "no better than the start"
    assert row["value"] == row["start"] == 5.0
    assert (row["low"], row["high"], row["identifiable"]) == (None, None, False)


def test_a_fit_that_stands_on_a_bound_is_told_and_shows_no_interval(case, recording):
    given = {"fit": "machine.H", "bounds": {"machine.H": (7.0, 30.0)}}
    row = fitted(case, recording[:SHORT], 20.0, **given)
    assert row["why_not"] == "at its bound"
    assert row["value"] == pytest.approx(7.0, abs=1e-3)
    assert (row["low"], row["high"]) == (None, None)


SPOILT = {
    "P and Q exchanged": (
        lambda f: f.assign(p_mw=f.q_mvar, q_mvar=f.p_mw),
        "read otherwise",
    ),
    "Q without its sign, which it loses before the event": (
        lambda f: f.assign(q_mvar=f.q_mvar.abs()),
        "magnitude",
    ),
    "P cut by the recorder's range": (
        lambda f: f.assign(p_mw=f.p_mw.clip(upper=f.p_mw.quantile(0.97))),
        "clipped",
    ),
    "Q cut by the recorder's range": (
        lambda f: f.assign(q_mvar=f.q_mvar.clip(upper=f.q_mvar.quantile(0.95))),
        "clipped",
    ),
    "Q behind a lag": (lambda f: behind_a_lag(f, "q_mvar"), "behind a lag"),
    "a magnitude behind a lag": (lambda f: behind_a_lag(f, "v_pu"), "magnitude lacks a step"),
    "an angle that jumps": (
        lambda f: f.assign(angle_deg=f.angle_deg + 20 * (f.index > 3)),
        "angle jumps alone",
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_recording_of_a_machine_is_asked_about(case, recording, name):
    spoil, kind = SPOILT[name]
    found = validated(case, spoil(recording)).as_json()["events"][0]["questions"]
    assert [(one["kind"], one["keeps_open"]) for one in found] == [(kind, True)]


def test_a_machine_that_refuses_to_draw_power_is_asked_about_the_sign(case, recording, tmp_path):
    """As a meter that counts into the plant: the turbine's least power is 0."""
    text = case.read_text(encoding="utf-8").replace('"constant_power"', '"tgov1"')
    path = tmp_path / "case.toml"
    path.write_text(text.replace("governor.output_is_torque = false\n", ""), encoding="utf-8")
    turned = recording.assign(p_mw=-recording.p_mw)
    words = r"P is -1 pu before the event; if P counts into the plant, give --channel 'p=-p_mw'"
    with pytest.raises(gfor_in_python.CosimError, match=words) as refused:
        validated(path, turned)
    assert "V_MIN" in str(refused.value)
    (typed,) = re.findall(r"--channel '([^']*)'", str(refused.value))
    assert (
        validated(path, turned, channels=[typed]).questions == validated(path, recording).questions
    )
