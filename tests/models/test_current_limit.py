"""The limits of the converter's current, each against its equations written a second time and solved another way.

The second computation finds the limiting impedance by bisection, and integrates with SciPy's Radau method.
"""

from cmath import exp, phase, rect

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fmus.toolchain.catalogue import build_model
from orchestrator.cases.case import load_case
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.studies.runs.run import run_scenario
from tests.support.converter_at_grid import AtGrid
from tests.support.evaluated import Evaluated

KIND = "current_limit.kind"
KINDS = {"box": 0, "circular": 1, "threshold": 2, "informed": 3}
W_B = 100 * np.pi
R_C, X_C, B_C, R_T, X_T, R_CAP = 0.005, 0.15, 0.15, 0.002, 0.15, 1 / (30 * 0.15)
OMEGA_N = 4 / (0.05 * 0.707)
K_P, K_I = 200 * 0.707 * OMEGA_N * B_C / W_B, OMEGA_N**2 * B_C / W_B
PARAMETERS = {
    "current_limit.I_max": 1.15,
    "current_limit.threshold": 0.95,
    "current_limit.angle": 0.6,
    "current_limit.X_R": 4.0,
}
"""None of them the default."""


# -- the second computation ---------------------------------------------------------------------


def limited(kind, demand, u_0):
    """Reference behind the limit, and the voltage that it takes away."""
    if kind == "box":
        return complex(np.clip(demand.real, -1.1, 1.1), np.clip(demand.imag, -1.1, 1.1)), 0.0
    I_max, I_th, phi, ratio = PARAMETERS.values()
    if kind == "threshold":
        if abs(demand) <= I_th:
            return demand, 0.0
        # a short circuit at the capacitor gives I_max
        k = u_0 / abs((I_max - I_th) * complex(1, ratio) * I_max)
        gain = lambda i: K_P * k * (i - I_th) * complex(1, ratio)  # noqa: E731
        size = brentq(lambda i: i * abs(1 + gain(i)) - abs(demand), I_th, abs(demand), xtol=1e-14)
        reference = demand / (1 + gain(size))
    else:
        if abs(demand) <= I_max:
            return demand, 0.0
        z = brentq(
            lambda z: abs(1 + K_P * z * rect(1, phi)) - abs(demand) / I_max, 0, 100, xtol=1e-15
        )
        reference = demand / (1 + K_P * z * rect(1, phi))
    return reference, (demand - reference) / K_P


def second_computation(kind, P_0, stages, times):
    """θ, P_f, i_s and the voltage integrator at those times, from a steady state at 1 pu of voltage."""
    i = complex(P_0)
    u = 1 + complex(R_T, X_T) * i
    theta, U_0 = phase(u), abs(u)
    i_g = i * exp(-1j * theta)
    u_c = U_0 / (1 + 1j * B_C * R_CAP)
    i_s = i_g + 1j * B_C * u_c
    s_0 = U_0 * i_g.conjugate()
    x_v = i_s - 1j * B_C * U_0 - i_g
    x_c = U_0 + complex(R_C, X_C) * i_s - 1j * X_C * i_s - U_0
    start = np.array([i_s, u_c, i_g, U_0, i_g, x_v, x_c])

    def rates(v):
        def of(_, y):
            i_s, u_c, i_g, u_ff, i_ff, x_v, x_c = y[:14:2] + 1j * y[1:14:2]
            theta, P_f, Q_f = y[14:]
            u = u_c + R_CAP * (i_s - i_g)
            w = 1 + 0.05 * (s_0.real - P_f)
            u_ref = U_0 + 0.067 * (s_0.imag - Q_f)
            demand = K_P * (u_ref - u) + x_v + 1j * w * B_C * u + i_ff
            i_ref, taken = limited(kind, demand, U_0)
            told = (u + (taken if kind == "informed" else 0)) * i_g.conjugate()
            d_x = K_I * (u_ref - u - taken)
            if kind == "box":
                d_x = complex(
                    d_x.real * (abs(demand.real) < 1.1), d_x.imag * (abs(demand.imag) < 1.1)
                )
            v_c = X_C / W_B / 1e-3 * (i_ref - i_s) + x_c + 1j * w * X_C * i_s + u_ff
            d = [
                W_B / X_C * (v_c - u - complex(R_C, w * X_C) * i_s),
                W_B / B_C * (i_s - i_g - 1j * w * B_C * u_c),
                W_B / X_T * (u - v * exp(-1j * theta) - complex(R_T, w * X_T) * i_g),
                (u - u_ff) / 1e-4,
                (i_g - i_ff) / 1e-4,
                d_x,
                R_C / 1e-3 * (i_ref - i_s),
            ]
            slow = [W_B * (w - 1), (told.real - P_f) / 0.1, (told.imag - Q_f) / 0.1]
            return [*np.ravel([(z.real, z.imag) for z in d]), *slow]

        return of

    y = np.array([*np.ravel([(z.real, z.imag) for z in start]), theta, s_0.real, s_0.imag])
    found, begin = [], 0.0
    for end, v in stages:
        inside = times[(times > begin + 1e-9) & (times < end + 1e-9)]
        solution = solve_ivp(
            rates(v), (begin, end), y, "Radau", t_eval=inside, rtol=1e-6, atol=1e-8
        )
        assert solution.success
        y, begin = solution.y[:, -1], end
        found.append(solution.y)
    y = np.hstack(found)
    return np.array([y[14], y[15], y[0], -y[1], y[10], -y[11]]).T


NAMES = [
    "droop.theta",
    "droop.P_f",
    "filter.i_s_q",
    "filter.i_s_d",
    "voltage_control.x_q",
    "voltage_control.x_d",
]


def by_the_fmu(path, values, stages, times, names=NAMES):
    """The same of the FMU, whose input is held during each of its steps of 1 ms."""
    with LoadedComponent("device", read_description(path)) as device:
        device.set(values)
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        batch, rows, begin = RealBatch(device, list(names)), [], 0
        for end, v in stages:
            device.set({"v_re": complex(v).real, "v_im": complex(v).imag})
            for k in range(begin, round(end * 1000)):
                device.step(k * 1e-3, 1e-3)
                rows.append(batch.read().copy())
            begin = round(end * 1000)
    assert len(rows) == len(times)
    return np.array(rows)


EVENTS = {
    "dip": [(0.005, 1.0), (0.025, 0.3), (0.05, 1.0)],
    "jump": [(0.005, 1.0), (0.05, exp(-0.6j))],
}


@pytest.mark.slow
@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_fmu_moves_as_a_second_computation_says(kind, event, fmu_path):
    stages = EVENTS[event]
    times = np.arange(1, round(stages[-1][0] * 1000) + 1) / 1000
    wanted = second_computation(kind, 0.5, stages, times)
    values = {"P_0": 0.5, "internal_step": 5e-6, KIND: KINDS[kind], **PARAMETERS}
    found = by_the_fmu(fmu_path("gfor", native=True), values, stages, times)
    assert np.abs(np.hypot(*wanted[:, 2:4].T)).max() > 0.9  # it does limit
    assert found == pytest.approx(wanted, abs=5e-5)


# -- without limiting all are one ---------------------------------------------------------------


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_where_nothing_is_limited_all_linear_models_are_the_same_to_the_last_bit(kind):
    values = {"P_0": 0.7, "Q_0": 0.1, "pod_p.enabled": 1, "pod_q.enabled": 1}
    paper = Evaluated(build_model("gfor"), values).blocks([1.0, 0.0])
    other = Evaluated(build_model("gfor"), values | {KIND: kind}).blocks([1.0, 0.0])
    demand = [v.name for v in build_model("gfor").outputs].index("current_demand")
    for a, b in zip(paper, other, strict=True):
        rows = np.arange(len(a)) != demand if len(a) != len(paper[0]) else slice(None)
        assert np.array_equal(a[rows], b[rows])
        assert np.isfinite(b).all()


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_where_nothing_is_limited_all_responses_are_the_same_to_the_last_bit(kind, fmu_path):
    stages, times = [(0.01, 1.0), (0.1, 0.99 * exp(0.01j))], np.arange(100)
    paper, other = (
        by_the_fmu(fmu_path("gfor"), {"P_0": 0.6, KIND: k}, stages, times, (*NAMES, "u", "omega"))
        for k in (0, kind)
    )
    assert np.ptp(paper[:, 1]) > 1e-3
    assert np.array_equal(paper, other)


# -- what a limit holds -------------------------------------------------------------------------


@pytest.mark.parametrize("P_0", [-0.6, 0.5, 0.9])
@pytest.mark.parametrize("left", [0.0, 0.2, 0.7])
@pytest.mark.parametrize("kind", [1, 2, 3])
def test_the_magnitude_stays_within_the_limit_in_a_dip(kind, left, P_0):
    """The paper's box lets 1.56 pu through; without any limit it is 5 to 11 pu."""
    response = AtGrid(20.0).run({"P_0": P_0, KIND: kind}, [(0.01, {}), (0.15, {"source.v": left})])
    assert response["i_s"].max() < 1.25
    assert response["i_s"][30:].max() < 1.11
    assert response["current_demand"].max() > 1


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_the_integrator_does_not_wind_up(kind, fmu_path):
    """With k_i = 6.1 1/s an error of 0.9 pu would move it by 1.1 pu in 0.2 s."""
    stages = [(0.01, 1.0), (0.21, 0.1)]
    found = by_the_fmu(fmu_path("gfor"), {"P_0": 0.5, KIND: kind}, stages, np.arange(210))
    assert np.abs(found[:, 4:] - found[0, 4:]).max() < 0.03


@pytest.mark.parametrize("kind", [1, 3])
@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_the_circular_limit_acts_like_an_impedance_of_the_chosen_angle(kind, degrees, fmu_path):
    """What is missing of the voltage, over the current; in steady state, at a voltage at which nothing turns."""
    signals = [
        "filter.i_s_q",
        "filter.i_s_d",
        "filter.u_c_q",
        "filter.u_c_d",
        "transformer.i_g_q",
        "transformer.i_g_d",
        "droop.Q_f",
    ]
    values = {
        "P_0": 0.5,
        KIND: kind,
        "current_limit.angle": np.deg2rad(degrees),
        "droop.R_f": 0.0,
        "droop.R_V": 0.0,
    }
    row = by_the_fmu(fmu_path("gfor"), values, [(0.3, 0.3)], np.arange(300), signals)[-1]
    i_s, u_c, i_g = (complex(row[k], -row[k + 1]) for k in (0, 2, 4))
    U_0 = abs(1 + 0.5 * complex(R_T, X_T))
    missing = U_0 - (u_c + R_CAP * (i_s - i_g))
    assert np.degrees(phase(missing / i_s)) == pytest.approx(degrees, abs=1.0)
    assert abs(i_s) == pytest.approx(1.1, abs=2e-3)


def test_a_threshold_impedance_gives_its_largest_current_at_a_short_circuit_of_the_capacitor(
    fmu_path,
):
    """Behind the transformer's reactance less: what is missing is U_0 less the voltage over the transformer."""
    signals = ["i_s", "u", "current_demand"]
    values = {"P_0": 0.1, KIND: 2, "droop.R_f": 0.0, "droop.R_V": 0.0, "transformer.X_t": 0.01}
    i_s, u, _ = by_the_fmu(fmu_path("gfor"), values, [(0.5, 0.0)], np.arange(500), signals)[-1]
    assert u < 0.02
    assert i_s == pytest.approx(1.1, abs=2e-3)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({KIND: 1, "P_0": 1.15}, "more current than current_limit.I_max"),
        ({KIND: 3, "current_limit.I_max": 0.8}, "more current than current_limit.I_max"),
        ({KIND: 2, "P_0": 1.05}, "more current than current_limit.threshold"),
        (
            {KIND: 2, "P_0": 0.5, "current_limit.threshold": 1.2},
            "threshold must be below current_limit.I_max",
        ),
        ({KIND: 0, "P_0": 1.15}, "more active current than voltage_control.i_q_max"),
    ],
)
def test_a_dispatch_that_would_be_limited_is_refused_with_the_rule(values, rule, fmu_path):
    with pytest.raises(ComponentError, match=rule):
        by_the_fmu(fmu_path("gfor"), values, [(0.001, 1.0)], np.arange(1))


def test_the_box_asks_nothing_of_a_dispatch_that_another_limit_lets_pass(fmu_path):
    values = {KIND: 1, "P_0": 1.15, "current_limit.I_max": 1.3}
    assert len(by_the_fmu(fmu_path("gfor"), values, [(0.001, 1.0)], np.arange(1))) == 1


# -- synchronism --------------------------------------------------------------------------------

DIP, JUMP = (
    [(0.02, {}), (0.25, {"source.v": 0.2}), (2.0, {"source.v": 1.0})],
    [(0.02, {}), (2.0, {"source.jump": 0.8})],
)


@pytest.mark.parametrize("stages", [DIP, JUMP], ids=["dip", "jump"])
def test_the_paper_s_box_loses_synchronism_where_the_informed_limit_keeps_it(stages):
    grid = AtGrid(20.0)
    assert not grid.run({"P_0": 0.5}, stages).keeps_synchronism
    assert grid.run({"P_0": 0.5, KIND: 3}, stages).keeps_synchronism


def test_the_damping_controllers_stay_in_effect_while_the_current_is_limited():
    on = {"P_0": 0.5, KIND: 3, "pod_p.enabled": 1.0, "pod_q.enabled": 1.0}
    grid = AtGrid(20.0)
    with_them, without = (grid.run(values, DIP) for values in (on, {"P_0": 0.5, KIND: 3}))
    limits = slice(60, 260)
    assert (with_them["current_demand"][limits] > 1).all()
    assert np.abs(with_them["omega"][limits] - without["omega"][limits]).max() > 1e-4
    assert with_them.keeps_synchronism


# -- unbalance ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_a_phase_to_phase_fault_leaves_every_phase_near_the_limit(kind, fmu_path):
    """Phases b and c meet: half the voltage in the positive sequence, and half in the negative one. The
    reference swings at 100 Hz and stays within 1.1 pu; the current follows late.
    """
    volt, ampere = 230e3 * np.sqrt(2 / 3), 1500 / 230 * 1e3 * np.sqrt(2 / 3)
    healthy = lambda t: [np.cos(W_B * t - 2 * np.pi / 3 * k) for k in range(3)]  # noqa: E731
    fault = lambda t: [np.cos(W_B * t), -np.cos(W_B * t) / 2, -np.cos(W_B * t) / 2]  # noqa: E731
    with LoadedComponent("device", read_description(fmu_path("gfor_abc"))) as device:
        device.set({"P_0": 0.5, KIND: kind})
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set(dict(zip(("v_a", "v_b", "v_c"), np.array(healthy(0.0)) * volt, strict=True)))
        device.exit_initialization_mode()
        peaks = []
        for k in range(2000):
            voltages = (healthy if k < 200 else fault)(k * 1e-4)
            device.set(dict(zip(("v_a", "v_b", "v_c"), np.array(voltages) * volt, strict=True)))
            device.step(k * 1e-4, 1e-4)
            found = device.get(["i_a", "i_b", "i_c", "i_s"])
            peaks.append([*np.abs([found[f"i_{p}"] for p in "abc"]) / ampere, found["i_s"]])
    assert np.array(peaks)[400:, 3].max() < 1.2
    assert 1.0 < np.array(peaks)[400:, :3].max() < 1.25


# -- what a run says ----------------------------------------------------------------------------

CASE = """
name = "deep"
[solver]
stop_time = "0.4 s"
groups = [["gfor"], ["grid"]]
[components.gfor]
model = "gfor"
parameters = { P_0 = 0.6, Q_0 = 0.05 }
[components.grid]
model = "infinite_bus"
parameters = { P_0 = 9.0, Q_0 = 0.75 }
[[connections]]
from = "grid.v_re"
to = "gfor.v_re"
[[connections]]
from = "grid.v_im"
to = "gfor.v_im"
[[connections]]
from = "gfor.i_re"
to = "grid.i_re"
[[connections]]
from = "gfor.i_im"
to = "grid.i_im"
[[events]]
type = "parameter_change"
time = "0.1 s"
component = "grid"
parameter = "dip.depth"
value = 0.8
"""


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
def test_a_run_says_which_limit_acts(kind, tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(CASE, encoding="utf-8")
    (ready,) = load_case(file).prepare([], {f"gfor.{KIND}": kind})
    told = {f.variable: f for f in run_scenario(ready).findings if f.kind == "active_limit"}
    assert set(told) == ({"current_demand"} if kind else {"filter.i_s_q", "filter.i_s_d"})
    assert all(f.time == pytest.approx(0.1, abs=0.02) for f in told.values())
