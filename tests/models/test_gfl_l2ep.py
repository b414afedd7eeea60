"""The benchmark's converter against its published equations, written a second time by hand, and their steady states."""

from cmath import exp

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.support.evaluated import Evaluated

OTHERWISE = {
    "P_0": 0.55,
    "Q_0": 0.12,
    "v_0": 1.03,
    "theta_0": 0.6,
    "S_n": 340.0,
    "S_base": 120.0,
    "f_n": 60.0,
    "transformer.R": 0.007,
    "transformer.X": 0.17,
    "transformer.ratio": 1.04,
    "pll.f_0": 6.0,
    "pll.xi": 0.9,
    "measurement.tau": 0.005,
    "active_power.K_p": 0.05,
    "active_power.K_i": 12.0,
    "active_power.delta_P_ref": 0.03,
    "reactive_power.K_p": 0.12,
    "reactive_power.K_i": 40.0,
    "reactive_power.delta_ref": -0.02,
    "reactive_power.support.V_1": 0.93,
    "reactive_power.support.V_2": 0.6,
    "current_limit.I_max": 0.9,
    "pll.freezing.V_low": 0.75,
    "pll.freezing.V_high": 0.9,
    "current_limit.tau": 0.003,
    "current_limit.recovery": 2.0,
    "current_control.K_p": 0.5,
    "current_control.K_i": 7.0,
}


def by_hand(p, x, v):
    """Rates in the benchmark's own axes, d along the voltage and q ahead of it; ``v`` is the bus voltage."""
    w_N, r, theta = 2 * np.pi * p["f_n"], p["transformer.ratio"], x["pll.theta"]
    R, L, I_max = p["transformer.R"], p["transformer.X"], p["current_limit.I_max"]
    i_d, i_q = x["transformer.i_q"], -x["transformer.i_d"]
    M_d, M_q = x["current_control.x_q"], -x["current_control.x_d"]
    bus = v * exp(-1j * theta)
    v_d, v_q = bus.real / r, bus.imag / r
    w_0 = 2 * np.pi * p["pll.f_0"]
    awake = x["pll.freezing.awake"]
    runs = float(awake > 0.5)
    held = (
        0.0
        if abs(v) < p["pll.freezing.V_low"]
        else 1.0
        if abs(v) > p["pll.freezing.V_high"]
        else runs
    )
    w = 1 + runs * 2 * p["pll.xi"] * w_0 / w_N * bus.imag + x["pll.x"]
    rates = {
        "pll.x": runs * w_0**2 / w_N * bus.imag,
        "pll.theta": runs * w_N * (w - 1),
        "pll.freezing.awake": (held - awake) / 1e-3,
    }
    s = v * (complex(i_d, i_q) / r * exp(1j * theta)).conjugate()
    inside = abs(complex(v_d + R * i_d - L * i_q, v_q + R * i_q + L * i_d))
    I_active = np.clip(x["current_limit.I_active"], 0, I_max)
    rest = np.sqrt(max(I_max**2 - i_q**2, 1e-3 * I_max**2))
    rates["current_limit.I_active"] = min(
        (rest - x["current_limit.I_active"]) / p["current_limit.tau"], p["current_limit.recovery"]
    )
    e_P = p["active_power.P_ref"] + p["active_power.delta_P_ref"] - x["active_power.P_f"]
    rates["active_power.P_f"] = (s.real - x["active_power.P_f"]) / p["measurement.tau"]
    x_P, x_Q = x["active_power.x"], x["reactive_power.x"]
    rates["active_power.x"] = (
        0.0 if abs(x_P) > I_active and x_P * e_P > 0 else p["active_power.K_i"] * e_P
    )
    asked_d = p["active_power.K_p"] * e_P + np.clip(x_P, -I_active, I_active)

    by_voltage = p["reactive_power.mode"] == 1
    seen, reference = (
        (inside, p["reactive_power.U_ref"]) if by_voltage else (s.imag, p["reactive_power.Q_ref"])
    )
    low, high = p["reactive_power.support.V_2"], p["reactive_power.support.V_1"]
    e_Q = (
        x["reactive_power.measured"] - reference - p["reactive_power.delta_ref"]
        if abs(v) >= low
        else 0.0
    )
    rates["reactive_power.measured"] = (seen - x["reactive_power.measured"]) / p["measurement.tau"]
    i_d0 = p["P_0"] / (p["v_0"] / r)
    most = np.sqrt(I_max**2 - i_d0**2)
    rates["reactive_power.x"] = (
        0.0 if abs(x_Q) > most and x_Q * e_Q > 0 else p["reactive_power.K_i"] * e_Q
    )
    asked_q = np.clip(p["reactive_power.K_p"] * e_Q + np.clip(x_Q, -most, most), -most, most)
    asked_q -= I_max * np.clip((high - abs(v)) / (high - low), 0, 1)

    error_d, error_q = (
        np.clip(asked_d, -I_active, I_active) - i_d,
        np.clip(asked_q, -I_max, I_max) - i_q,
    )
    K_p, K_i = p["current_control.K_p"], p["current_control.K_i"]
    v_md = v_d - w * L * i_q + K_p * error_d + M_d
    v_mq = w * L * i_d + K_p * error_q + M_q
    di_d, di_q = (
        w_N / L * (v_md - v_d - R * i_d + w * L * i_q),
        w_N / L * (v_mq - v_q - R * i_q - w * L * i_d),
    )
    dM_d, dM_q = K_i * error_d, K_i * error_q
    if not p["connected"]:
        di_d, di_q, dM_d, dM_q = (-value / 1e-3 for value in (i_d, i_q, M_d, M_q))
        rates |= {"active_power.x": -x_P / 1e-3, "reactive_power.x": -x_Q / 1e-3}
    rates |= {"transformer.i_q": di_d, "transformer.i_d": -di_q}
    rates |= {"current_control.x_q": dM_d, "current_control.x_d": -dM_q}
    injected = complex(i_d, i_q) / r * exp(1j * theta) * p["S_n"] / p["S_base"]
    outputs = {
        "i_re": injected.real,
        "i_im": injected.imag,
        "p": s.real,
        "q": s.imag,
        "omega": w,
        "u_c": inside,
    }
    return rates, outputs | {
        "i": np.hypot(i_d, i_q),
        "current_demand": np.hypot(asked_d, asked_q) / I_max,
    }


@pytest.mark.parametrize("connected", [1, 0])
@pytest.mark.parametrize("size", [0.003, 0.4])
@pytest.mark.parametrize("mode", [0, 1])
def test_every_rate_and_output_is_that_of_the_equations_written_by_hand(mode, size, connected):
    device = Evaluated(
        build_model("gfl_l2ep"), OTHERWISE | {"reactive_power.mode": mode, "connected": connected}
    )
    limited, held = set(), set()
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = {name: value + size * rng.standard_normal() for name, value in device.states.items()}
        v = 1.03 * exp(0.6j) * (1 + size * exp(1j * seed))
        rates, outputs = by_hand(device.parameters, x, v)
        assert device.rates([v.real, v.imag], device.vector(x)) == pytest.approx(
            rates, rel=1e-9, abs=1e-9
        )
        assert device.outputs([v.real, v.imag], device.vector(x)) == pytest.approx(
            outputs, rel=1e-9, abs=1e-9
        )
        limited.add(outputs["current_demand"] > 1)
        held.add((x["pll.freezing.awake"] > 0.5, abs(v) < 0.75, abs(v) > 0.9))
    assert limited == ({False} if size < 0.1 else {False, True})
    # running and standing, below, between and above the thresholds
    assert len(held) == (1 if size < 0.1 else 6)


@pytest.mark.parametrize("mode", [0, 1])
@pytest.mark.parametrize("name", ["gfl_l2ep", "gfl_l2ep_phasor"])
@pytest.mark.parametrize(
    ("P", "Q", "v", "theta"), [(0.83, 0.0, 1.0, 0.0), (-0.94, -0.1, 1.02, 4.0)]
)
def test_the_power_flow_is_a_steady_state(name, mode, P, Q, v, theta):
    values = {
        "P_0": P,
        "Q_0": Q,
        "v_0": v,
        "theta_0": theta,
        "transformer.ratio": 1.04,
        "reactive_power.mode": mode,
    }
    device = Evaluated(build_model(name), values)
    bus = v * exp(1j * theta)
    assert max(map(abs, device.rates([bus.real, bus.imag]).values())) < 1e-9
    found = device.outputs([bus.real, bus.imag])
    assert (found["p"], found["q"], found["omega"]) == pytest.approx((P, Q, 1.0), abs=1e-12)


def test_the_defaults_are_the_gains_of_the_data():
    p = Evaluated(build_model("gfl_l2ep")).parameters
    w_N, T = 100 * np.pi, 0.1
    w_0 = 2 * np.pi * p["pll.f_0"]
    assert 2 * p["pll.xi"] * w_0 / w_N == pytest.approx(10 / (T * w_N), rel=1e-12)
    assert w_0**2 / w_N == pytest.approx(25 / (T**2 * w_N), rel=1e-12)
    assert p["active_power.K_p"] == pytest.approx(p["active_power.K_i"] / 300, rel=2e-3)
    assert p["current_control.K_p"] == pytest.approx(p["transformer.X"] * 1200 / w_N, rel=1e-4)


@pytest.mark.parametrize("hertz", [0.5, 5.0, 16.0])
def test_without_a_step_the_phasor_variant_has_the_currents_of_the_emt_variant(hertz):
    """Into a stiff bus both are the same equations, but for (s·τ)² of the extrapolated bus voltage."""
    values, s = {"P_0": 0.8, "v_0": 1.0, "bus_voltage.tau": 1e-3}, 2j * np.pi * hertz
    phasor = Evaluated(build_model("gfl_l2ep_phasor"), values).response(s, [1.0, 0.0])
    emt = Evaluated(build_model("gfl_l2ep"), {"P_0": 0.8, "v_0": 1.0}).response(s, [1.0, 0.0])
    for y in ("i_re", "i_im"):
        for v in ("v_re", "v_im"):
            assert abs(phasor[y, v] - emt[y, v]) < 2 * abs(s * 1e-3) ** 2 * max(
                abs(emt[k]) for k in emt if "i_" in k[0]
            )


def started(device, values):
    device.set(values)
    device.setup(0.0, None)
    device.enter_initialization_mode()
    device.set({"v_re": 1.0, "v_im": 0.0})
    device.exit_initialization_mode()


def test_a_dispatch_beyond_the_current_limit_is_refused(fmu_path):
    refusal = pytest.raises(
        ComponentError, match=r"current_limit\.I_max: lower P_0 or Q_0, or raise S_n"
    )
    with LoadedComponent("wp", read_description(fmu_path("gfl_l2ep"))) as device, refusal:
        started(device, {"P_0": 1.1})


def test_in_a_dip_reactive_current_goes_first_and_active_current_comes_back_at_the_recovery_rate(
    fmu_path,
):
    """Below 0.5 pu all of the current is reactive; what is left for active current then grows by 0.5 pu a second."""
    step, found = 1e-4, []
    with LoadedComponent("wp", read_description(fmu_path("gfl_l2ep"))) as device:
        started(device, {"P_0": 0.8, "internal_step": 1e-4})
        for k in range(6000):
            device.set({"v_re": 0.4 if 1000 <= k < 2000 else 1.0})
            device.step(k * step, step)
            found.append(list(device.get(["p", "q", "i"]).values()))
    p, q, i = np.array(found).T
    assert (p[1990], q[1990], i[1990]) == pytest.approx((0.0, 0.4, 1.0), abs=0.02)
    assert (p[4500] - p[3000]) / 0.15 == pytest.approx(0.5, rel=0.02)
    assert p[3000] == pytest.approx(0.5 * 0.1 + 0.03, abs=0.03)


def test_the_pll_stands_in_a_deep_dip_and_until_the_voltage_is_clearly_back(fmu_path):
    """The bus voltage jumps by 30 degrees: in between the thresholds the angle follows only if it did before."""
    turned, step = exp(1j * np.pi / 6), 1e-3
    followed = {}
    for way in ((0.45,), (0.3,), (0.3, 0.45), (0.3, 0.45, 0.55)):
        with LoadedComponent("wp", read_description(fmu_path("gfl_l2ep"))) as device:
            started(device, {"P_0": 0.8})
            for part, size in enumerate(way):
                v = size * turned
                device.set({"v_re": v.real, "v_im": v.imag})
                for k in range(300):
                    device.step((300 * part + k) * step, step)
            followed[way] = device.get(["pll.theta"])["pll.theta"]
    assert followed[0.45,] == pytest.approx(np.pi / 6, abs=0.05)
    assert followed[0.3, 0.45, 0.55] == pytest.approx(np.pi / 6, abs=0.05)
    assert 0 <= followed[0.3,] < 0.1
    assert followed[0.3, 0.45] == followed[0.3,]


def test_thresholds_of_the_pll_the_wrong_way_round_are_refused(fmu_path):
    refusal = pytest.raises(
        ComponentError, match=r"pll\.freezing\.V_high must be above pll\.freezing\.V_low"
    )
    with LoadedComponent("wp", read_description(fmu_path("gfl_l2ep"))) as device, refusal:
        started(device, {"pll.freezing.V_low": 0.6})


def test_native_and_python_backed_fmus_give_the_same_bits_through_a_dip(fmu_path):
    """The PLL stands and runs again in it."""
    found = []
    for native in (False, True):
        with LoadedComponent("wp", read_description(fmu_path("gfl_l2ep", native))) as device:
            started(device, {"P_0": 0.8})
            rows = []
            for k in range(400):
                device.set(
                    {"v_re": 0.3 if 100 <= k < 200 else 0.98, "v_im": 0.2 if k >= 200 else 0.0}
                )
                device.step(k * 1e-3, 1e-3)
                rows.append(
                    list(
                        device.get(
                            ["i_re", "i_im", "omega", "pll.theta", "pll.freezing.awake"]
                        ).values()
                    )
                )
        found.append(np.array(rows))
    assert found[0][:, 4].min() < 0.5 < found[0][-1, 4]
    assert (found[0] == found[1]).all()
