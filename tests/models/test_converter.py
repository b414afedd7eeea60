"""The grid-forming converter against its equations, written a second time by hand, at parameters that all differ.

With its defaults both droops measure with the same lag, both limits are the same and both references stand still:
one in the other's place would not show. Here no two of them are equal.
"""

from cmath import exp

import numpy as np
import pytest

from fmus.converter_parts.filter import SteadyState
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from gfor_fmu.droop import declare_droop, frequency, voltage_reference
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.support.evaluated import Evaluated

DROOP = {"droop.R_f": 0.04, "droop.R_V": 0.09, "droop.tau_P": 0.03, "droop.tau_Q": 0.22}
OTHERWISE = {
    "P_0": 0.55,
    "Q_0": 0.12,
    "v_0": 1.03,
    "theta_0": 0.6,
    "S_n": 340.0,
    "S_base": 120.0,
    "f_n": 60.0,
    "filter.R_c": 0.007,
    "filter.X_c": 0.13,
    "filter.B_c": 0.11,
    "transformer.R_t": 0.004,
    "transformer.X_t": 0.17,
    **DROOP,
    "droop.delta_P_ref": 0.03,
    "droop.delta_Q_ref": -0.05,
    "droop.delta_U_ref": 0.02,
    "voltage_control.tau": 0.08,
    "voltage_control.xi": 0.6,
    "voltage_control.i_q_max": 0.95,
    "voltage_control.i_d_max": 0.7,
    "current_control.tau": 0.0015,
    "feed_forward.tau": 3e-4,
    "pod_p.enabled": 1,
    "pod_p.T_W": 4.0,
    "pod_p.T_f": 0.07,
    "pod_p.T_S1": 0.21,
    "pod_p.T_S2": 0.33,
    "pod_p.N_S": 2,
    "pod_p.K": 130.0,
    "pod_p.limit": 0.15,
    "pod_q.enabled": 1,
    "pod_q.T_W": 6.0,
    "pod_q.T_f": 0.12,
    "pod_q.T_S1": 0.27,
    "pod_q.T_S2": 0.31,
    "pod_q.N_S": 1,
    "pod_q.K": 170.0,
    "pod_q.limit": 0.25,
}
REFERENCES_AT_REST = dict.fromkeys((f"droop.delta_{x}_ref" for x in "PQU"), 0.0)
VIRTUAL = {"virtual_impedance.R_v": 0.02, "virtual_impedance.X_v": 0.14}
VARIANTS = {
    "the paper's": {},
    "algebraic": VIRTUAL | {"voltage_control.factor": 40.0},
    "dynamic": VIRTUAL | {"virtual_impedance.dynamic": 1},
}
"""Virtual impedances, and another gain of the voltage control with one of them."""


# -- the droops ---------------------------------------------------------------------------------


def droops():
    """Both droops between the measured power, both supplementary references, and what they give."""
    m = ModelBuilder("alone", "Both droops")
    P, Q, delta_p, delta_q = (
        m.input(name, "pu", name, base="S_n") for name in ("P", "Q", "delta_p", "delta_q")
    )
    start = SteadyState(0.2, Phasor(1.02, 0), *(Phasor(0, 0),) * 3, Phasor(0.6, 0.1))
    droop = declare_droop(m, start, Phasor(P, Q))
    m.derivative(droop.theta, 0)
    m.output("omega", frequency(droop, delta_p), "pu", "Frequency", base="f_n")
    m.output("u_q", voltage_reference(droop, delta_q).re, "pu", "Voltage reference", base="S_n")
    return m.build()


@pytest.mark.parametrize("hertz", [0.1, 0.7, 3.0, 20.0])
def test_each_droop_has_its_own_lag_and_its_own_gain(hertz):
    s = 2j * np.pi * hertz
    found = Evaluated(droops(), DROOP).response(s, [0.6, 0.1, 0.0, 0.0])
    wanted = dict.fromkeys(found, 0.0) | {
        ("omega", "P"): -0.04 / (1 + 0.03 * s),
        ("omega", "delta_p"): 0.04,
        ("u_q", "Q"): -0.09 / (1 + 0.22 * s),
        ("u_q", "delta_q"): 0.09,
    }
    assert found == pytest.approx(wanted, rel=1e-10, abs=1e-14)


@pytest.mark.parametrize(
    ("reference", "omega", "u_q"),
    [
        ("delta_P_ref", 0.04 * 0.03, 0.0),
        ("delta_Q_ref", 0.0, 0.09 * 0.03),
        ("delta_U_ref", 0.0, 0.03),
    ],
)
def test_a_raised_reference_raises_frequency_or_voltage(reference, omega, u_q):
    at_rest = [0.6, 0.1, 0.0, 0.0]
    before = Evaluated(droops(), DROOP).outputs(at_rest)
    assert before == pytest.approx({"omega": 1.0, "u_q": 1.02}, abs=1e-15)
    after = Evaluated(droops(), DROOP | {f"droop.{reference}": 0.03}).outputs(at_rest)
    assert {k: after[k] - before[k] for k in after} == pytest.approx(
        {"omega": omega, "u_q": u_q}, abs=1e-14
    )


# -- the whole converter ------------------------------------------------------------------------


def by_hand(p, x, v):
    """Rates of all states, and the outputs, from the equations of the paper; ``p`` and ``x`` by name."""

    def qd(name):
        return complex(x[f"{name}_q"], -x[f"{name}_d"])

    rates, omega_b = {}, 2 * np.pi * p["f_n"]
    i_s, u_c, i_g = qd("filter.i_s"), qd("filter.u_c"), qd("transformer.i_g")
    u = u_c + (i_s - i_g) / (30 * p["filter.B_c"])
    delta_p, delta_q = _pod_output(p, x, "pod_p", -1), _pod_output(p, x, "pod_q", +1)
    w = 1 + p["droop.R_f"] * (p["droop.P_ref"] + p["droop.delta_P_ref"] + delta_p - x["droop.P_f"])
    for pod in ("pod_p", "pod_q"):
        rates |= _pod_rates(p, x, pod, w - 1)
    power = u * i_g.conjugate()
    rates["droop.P_f"] = (power.real - x["droop.P_f"]) / p["droop.tau_P"]
    rates["droop.Q_f"] = (power.imag - x["droop.Q_f"]) / p["droop.tau_Q"]
    rates["droop.theta"] = omega_b * (w - 1)
    u_ref = p["droop.U_ref"] + p["droop.delta_U_ref"]
    u_ref += p["droop.R_V"] * (p["droop.Q_ref"] + p["droop.delta_Q_ref"] + delta_q - x["droop.Q_f"])
    v_c, demand = _inner_loops(p, x, qd, rates, u, u_ref, w)
    into_grid = (
        u
        - v * exp(-1j * x["droop.theta"])
        - (p["transformer.R_t"] + 1j * w * p["transformer.X_t"]) * i_g
    )
    X_c, B_c = p["filter.X_c"], p["filter.B_c"]
    for name, rate in {
        "filter.i_s": omega_b / X_c * (v_c - u - (p["filter.R_c"] + 1j * w * X_c) * i_s),
        "filter.u_c": omega_b / B_c * (i_s - i_g - 1j * w * B_c * u_c),
        "transformer.i_g": omega_b / p["transformer.X_t"] * into_grid,
    }.items():
        _put(rates, name, rate)
    injected = i_g * exp(1j * x["droop.theta"])
    at_bus, scale = v * injected.conjugate(), p["S_n"] / p["S_base"]
    outputs = {
        "i_re": injected.real * scale,
        "i_im": injected.imag * scale,
        "p": at_bus.real,
        "q": at_bus.imag,
    }
    outputs |= {
        "omega": w,
        "delta_p_pod": delta_p,
        "delta_q_pod": delta_q,
        "u": abs(u),
        "i_s": abs(i_s),
    }
    outputs["current_demand"] = demand
    return rates, outputs


def _put(rates, name, rate):
    rates[f"{name}_q"], rates[f"{name}_d"] = rate.real, -rate.imag


def _inner_loops(p, x, qd, rates, u, u_ref, w):
    """Voltage PI, limits, current PI; returns the converter's voltage, and the demand in parts of the limits."""
    omega_b = 2 * np.pi * p["f_n"]
    i_s, i_g = qd("filter.i_s"), qd("transformer.i_g")
    tau, xi, C = p["voltage_control.tau"], p["voltage_control.xi"], p["filter.B_c"] / omega_b
    omega_n = 4 / (tau * xi)
    R_v, X_v = p["virtual_impedance.R_v"], p["virtual_impedance.X_v"]
    slope = (i_g - qd("feed_forward.i_g")) / p["feed_forward.tau"]
    induced = p["virtual_impedance.dynamic"] * X_v / omega_b * slope
    error = u_ref - (R_v + 1j * w * X_v) * i_g - induced - u
    demanded = 2 * p["voltage_control.factor"] * xi * omega_n * C * error + qd("voltage_control.x")
    demanded += 1j * w * p["filter.B_c"] * u + qd("feed_forward.i_g")
    i_q_max, i_d_max = p["voltage_control.i_q_max"], p["voltage_control.i_d_max"]
    i_ref = complex(
        np.clip(demanded.real, -i_q_max, i_q_max), np.clip(demanded.imag, -i_d_max, i_d_max)
    )
    free = abs(demanded.real) < i_q_max, abs(demanded.imag) < i_d_max
    _put(
        rates,
        "voltage_control.x",
        omega_n**2 * C * complex(error.real * free[0], error.imag * free[1]),
    )
    tau, L = p["current_control.tau"], p["filter.X_c"] / omega_b
    _put(rates, "current_control.x", p["filter.R_c"] / tau * (i_ref - i_s))
    _put(rates, "feed_forward.u", (u - qd("feed_forward.u")) / p["feed_forward.tau"])
    _put(rates, "feed_forward.i_g", (i_g - qd("feed_forward.i_g")) / p["feed_forward.tau"])
    demand = max(abs(demanded.real) / i_q_max, abs(demanded.imag) / i_d_max)
    v_c = (
        L / tau * (i_ref - i_s)
        + qd("current_control.x")
        + 1j * w * p["filter.X_c"] * i_s
        + qd("feed_forward.u")
    )
    return v_c, demand


def _stages(p, x, pod):
    """Input of every lead/lag stage, and what leaves the last one in use; one that is not in use passes nothing on."""
    signals = [x[f"{pod}.low_pass"]]
    for stage in range(1, 4):
        state, ratio = x[f"{pod}.lead_lag_{stage}"], p[f"{pod}.T_S1"] / p[f"{pod}.T_S2"]
        used = stage <= p[f"{pod}.N_S"]
        signals.append(state + ratio * (signals[-1] - state) if used else signals[-1])
    return signals


def _pod_output(p, x, pod, sign):
    limit, wanted = p[f"{pod}.limit"], sign * p[f"{pod}.K"] * _stages(p, x, pod)[-1]
    return p[f"{pod}.enabled"] * np.clip(wanted, -limit, limit)


def _pod_rates(p, x, pod, deviation):
    washed = deviation - x[f"{pod}.washout"]
    rates = {
        f"{pod}.washout": washed / p[f"{pod}.T_W"],
        f"{pod}.low_pass": (washed - x[f"{pod}.low_pass"]) / p[f"{pod}.T_f"],
    }
    for stage, entering in enumerate(_stages(p, x, pod)[:-1], start=1):
        name = f"{pod}.lead_lag_{stage}"
        rates[name] = (entering - x[name]) / p[f"{pod}.T_S2"]
    return rates


def scattered(device, seed, size):
    """States around the operating point; the POD's small signals by less, so that some clamp and some do not."""
    rng = np.random.default_rng(seed)
    sizes = {name: size * (5e-3 if name.startswith("pod_") else 1.0) for name in device.states}
    return {
        name: value + sizes[name] * rng.standard_normal() for name, value in device.states.items()
    }


@pytest.mark.parametrize("size", [0.003, 0.05, 0.3])
def test_every_rate_and_output_is_that_of_the_equations_written_by_hand(size):
    device = Evaluated(build_model("gfor"), OTHERWISE)
    clamped = set()
    for seed in range(12):
        x = scattered(device, seed, size)
        v = 1.03 * exp(0.6j) * (1 + 0.5 * size * exp(1j * seed))
        rates, outputs = by_hand(device.parameters, x, v)
        found = device.rates([v.real, v.imag], device.vector(x))
        assert found == pytest.approx(rates, rel=1e-9, abs=1e-9)
        assert device.outputs([v.real, v.imag], device.vector(x)) == pytest.approx(
            outputs, rel=1e-9, abs=1e-9
        )
        clamped.add((rates["voltage_control.x_q"] == 0, rates["voltage_control.x_d"] == 0))
    # Neither axis is clamped, then one of them, then each without the other and both.
    assert len(clamped) == {0.003: 1, 0.05: 2, 0.3: 4}[size]


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_the_converter_starts_at_rest_whatever_its_virtual_impedance(variant):
    device = Evaluated(build_model("gfor"), OTHERWISE | VARIANTS[variant] | REFERENCES_AT_REST)
    v = 1.03 * exp(0.6j)
    assert max(map(abs, device.rates([v.real, v.imag]).values())) < 1e-9
    out = device.outputs([v.real, v.imag])
    assert (out["p"], out["q"]) == pytest.approx((0.55, 0.12), abs=1e-12)


@pytest.mark.parametrize("variant", ["algebraic", "dynamic"])
def test_a_virtual_impedance_takes_from_the_voltage_reference(variant):
    device = Evaluated(build_model("gfor"), OTHERWISE | VARIANTS[variant])
    for seed in range(6):
        x = scattered(device, seed, 0.003)
        v = 1.03 * exp(0.6j)
        rates, outputs = by_hand(device.parameters, x, v)
        assert device.rates([v.real, v.imag], device.vector(x)) == pytest.approx(
            rates, rel=1e-9, abs=1e-9
        )
        assert device.outputs([v.real, v.imag], device.vector(x)) == pytest.approx(
            outputs, rel=1e-9, abs=1e-9
        )


# θ [rad] of a droop converter in PSCAD by the time after P_ref rises from 0.5 to 0.7 pu [ms], at 60 Hz: test 23 of
# PowerSimulationsDynamics.jl (NREL-Sienna), benchmarks/pscad/Test23/Test23_theta.csv
PSCAD_THETA = {
    0: 0.19721, 10: 0.23420, 20: 0.26657, 30: 0.29061, 40: 0.30660, 55: 0.31521, 70: 0.31070, 85: 0.29904,
    100: 0.28609, 120: 0.27309, 140: 0.26765, 160: 0.26842, 180: 0.27208, 200: 0.27573, 240: 0.27827, 280: 0.27673,
    340: 0.27580, 400: 0.27630, 500: 0.27619, 1000: 0.27621,
}  # fmt: skip
DROOP_AT_STIFF_BUS = {
    "S_n": 2.75, "f_n": 60.0, "P_0": 0.5, "Q_0": -0.075 * 0.0275 * 0.25,  # 0 at the converter's bus
    "filter.R_c": 0.003, "filter.X_c": 0.08, "filter.B_c": 0.074,
    "transformer.R_t": 0.01,
    "transformer.X_t": 0.2 + 0.075 * 2.75 / 100,  # with the line to the source
    "virtual_impedance.X_v": 0.2, "droop.R_f": 0.05, "droop.R_V": 0.2, "droop.tau_P": 1 / (2 * np.pi * 5),
    "droop.tau_Q": 1e-3,
}  # fmt: skip
INNER_GAINS = {
    "voltage_control.factor": 1.0, "voltage_control.tau": 3.193e-3, "voltage_control.xi": 0.7086,  # 0.59 and 736
    "current_control.tau": 2.005e-4,  # 1.27
    "feed_forward.tau": 1000.0,  # none
    "internal_step": 2e-5,
}  # fmt: skip


@pytest.mark.parametrize(
    ("model", "values", "step", "most_rms", "most"),
    [("gfor", INNER_GAINS, 2e-4, 0.4, 0.8), ("gfor_phasor", {}, 1e-3, 0.6, 1.4)],
)
def test_a_virtual_reactance_gives_pscads_angle_of_a_droop(
    fmu_path, model, values, step, most_rms, most
):
    """Deviations are in percent of the swing, 0.2 of them from the start on, in PSCAD's steady state."""
    found = []
    with LoadedComponent("device", read_description(fmu_path(model))) as device:
        device.set(DROOP_AT_STIFF_BUS | values)
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        device.set({"droop.delta_P_ref": 0.7 - device.get(["droop.P_ref"])["droop.P_ref"]})
        theta = RealBatch(device, ["droop.theta"])
        for k in range(round(1.0 / step) + 1):
            found.append(float(theta.read()[0]))
            device.step(k * step, step)
    ours = np.array([found[round(at * 1e-3 / step)] for at in PSCAD_THETA])
    wanted = np.array(list(PSCAD_THETA.values()))
    off = 100 * (ours - wanted) / np.ptp(wanted)
    assert np.sqrt(np.mean(off**2)) < most_rms
    assert abs(off).max() < most


@pytest.mark.parametrize("axis", ["q", "d"])
def test_an_integrator_stops_at_the_limit_of_its_own_axis(axis):
    """What an integrator asks for rises from one limit to the other, through all that lies between the two limits."""
    device = Evaluated(build_model("gfor"), OTHERWISE)
    v, name = 1.03 * exp(0.6j), f"voltage_control.x_{axis}"
    # A voltage beside its reference is the error to integrate.
    rest = device.states | {
        f"filter.u_c_{a}": device.states[f"filter.u_c_{a}"] + 0.03 for a in "qd"
    }
    rates = []
    for offset in np.linspace(-1.5, 1.5, 61):
        x = rest | {name: device.states[name] + offset}
        wanted, _ = by_hand(device.parameters, x, v)
        found = device.rates([v.real, v.imag], device.vector(x))
        assert found[name] == pytest.approx(wanted[name], rel=1e-9, abs=1e-9)
        rates.append(found[name] != 0)
    assert 0 < sum(rates) < 61


# -- the limits in dips -------------------------------------------------------------------------


def dipped(path, depth, seconds, P_0, limits, after=0.0):
    """Currents and integrators of the voltage control, q and d, after every step from the dip on; then outputs."""
    values = {
        "P_0": P_0,
        "voltage_control.i_q_max": limits[0],
        "voltage_control.i_d_max": limits[1],
    }
    step = 2e-4
    with LoadedComponent("device", read_description(path)) as device:
        device.set(values)
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        batch = RealBatch(
            device,
            [f"{name}_{axis}" for name in ("filter.i_s", "voltage_control.x") for axis in "qd"],
        )
        dip, rows = round(seconds / step), []
        for k in range(round((seconds + after) / step)):
            if k in (0, dip):
                device.set({"v_re": depth if k < dip else 1.0})
            device.step(k * step, step)
            rows.append(batch.read().copy())
        last = device.get(["p", "q", "u", "i_s"])
    rows = np.array(rows)
    return np.abs(rows[:, :2]), rows[:, 2:], last


@pytest.mark.parametrize("limits", [(1.1, 1.1), (1.0, 0.6), (0.95, 1.3)])
@pytest.mark.parametrize(("depth", "P_0"), [(0.7, 0.9), (0.4, 0.3), (0.1, 0.9), (0.1, -0.6)])
def test_the_current_stays_within_the_limit_of_each_axis_in_a_dip(fmu_path, depth, P_0, limits):
    """Without a limit it is 4.8 to 10.6 pu; with those of the axes in each other's place, one axis exceeds its own."""
    current, _, _ = dipped(fmu_path("gfor"), depth, 0.25, P_0, limits)
    assert (current.max(axis=0) < 1.2 * np.array(limits)).all()
    after_10_ms = current[50:].max(axis=0)
    assert (after_10_ms < 1.003 * np.array(limits)).all()
    assert after_10_ms[1] > 0.99 * limits[1]  # the reactive axis does reach it


@pytest.mark.parametrize("limits", [(1.1, 1.1), (1.0, 0.6)])
def test_both_integrators_stand_still_at_the_limits_and_the_converter_comes_back(fmu_path, limits):
    """With k_i = 6.1 1/s, an error of 0.9 pu would wind them up by 0.5 pu in 0.1 s."""
    current, x, last = dipped(fmu_path("gfor"), 0.1, 0.1, 0.3, limits, after=3.0)
    assert (current[499] > 0.99 * np.array(limits)).all()
    assert x[499] == pytest.approx(x[20], abs=1e-9)
    assert last["p"] == pytest.approx(0.3, abs=5e-3)
    assert last["q"] == pytest.approx(0.0, abs=5e-3)


def test_an_axis_at_its_limit_leaves_the_other_ones_integrator_free(fmu_path):
    current, x, _ = dipped(fmu_path("gfor"), 0.9, 0.2, 0.2, (1.1, 0.3))
    assert current[-1, 1] == pytest.approx(0.3, rel=2e-3)
    assert x[999, 1] == pytest.approx(x[20, 1], abs=1e-9)
    assert abs(x[999, 0] - x[20, 0]) > 1e-4


@pytest.mark.parametrize(("name", "least"), [("xi", 0.1), ("tau", 1e-3)])
def test_how_far_the_voltage_loop_may_be_tuned(name, least):
    (found,) = (v for v in build_model("gfor").parameters if v.name == f"voltage_control.{name}")
    assert found.minimum == least
