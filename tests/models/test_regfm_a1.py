"""REGFM_A1 against its specification's equations, written a second time by hand, and against their steady states."""

from cmath import exp

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.support.evaluated import Evaluated

NAME, STEP = "regfm_a1_phasor", 1e-3
OTHERWISE = {
    "P_0": 0.6,
    "Q_0": 0.1,
    "v_0": 1.02,
    "theta_0": 0.5,
    "f_n": 60.0,
    "RL": 0.01,
    "XL": 0.12,
    "mp": 0.02,
    "mq": 0.07,
    "kpv": 0.4,
    "kiv": 4.0,
    "kppmax": 0.03,
    "kipmax": 0.2,
    "kpqmax": 0.2,
    "kiqmax": 9.0,
    "TPf": 0.02,
    "TQf": 0.03,
    "TVf": 0.04,
    "TIf": 0.005,
    "Pmax": 0.65,
    "Pmin": 0.55,
    "Qmax": 0.2,
    "Qmin": 0.05,
    "Emax": 1.2,
    "Emin": 0.9,
    "ImaxF": 1.2,
    "delta_Pref": 0.02,
    "delta_Qref": 0.03,
    "delta_Vref": -0.01,
}


def by_hand(p, x, v):
    """Rates of the specification's states, frequency, internal voltage and current."""
    Z, omega_b = complex(p["RL"], p["XL"]), 2 * np.pi * p["f_n"]
    seen = complex(x["V_seen_re"], x["V_seen_im"])

    def beyond(name, kp, ki):
        above, below = p[f"{name}max"] - x[f"{name}f"], p[f"{name}min"] - x[f"{name}f"]
        down, up = x[f"x_{name}max"], x[f"x_{name}min"]
        rates[f"x_{name}max"] = min(ki * above, -down / 0.01)
        rates[f"x_{name}min"] = max(ki * below, -up / 0.01)
        return min(kp * above + down, 0.0) + max(kp * below + up, 0.0)

    rates = {}
    omega = (
        1
        + p["mp"] * (p["Pref"] + p["delta_Pref"] - x["Pf"])
        + beyond("P", p["kppmax"], p["kipmax"])
    )
    command = p["Vref"] + p["delta_Vref"] + p["mq"] * (p["Qref"] + p["delta_Qref"] - x["Qf"])
    command += beyond("Q", p["kpqmax"], p["kiqmax"])
    error = command - x["Vf"]
    E = np.clip(p["kpv"] * error + x["x_V"] if p["VFlag"] else command, p["Emin"], p["Emax"])
    stopped = (x["x_V"] >= p["Emax"] and error > 0) or (x["x_V"] <= p["Emin"] and error < 0)
    rates["x_V"] = 0.0 if stopped or not p["VFlag"] else p["kiv"] * error
    wanted = (E - seen) / Z
    limited = E if abs(wanted) <= p["ImaxF"] else seen + Z * wanted * p["ImaxF"] / abs(wanted)
    bus = v * exp(-1j * x["delta_droop"])
    i = (limited - bus) / Z
    s = bus * i.conjugate()
    for name, now in (("P", s.real), ("Q", s.imag), ("V", abs(v))):
        rates[f"{name}f"] = (now - x[f"{name}f"]) / p[f"T{name}f"]
    rates["delta_droop"] = omega_b * (omega - 1)
    rates |= {"V_seen_re": (bus - seen).real / p["TIf"], "V_seen_im": (bus - seen).imag / p["TIf"]}
    return rates, {
        "omega": omega,
        "E_droop": E,
        "I": abs(i),
        "fault_current": abs(wanted) / p["ImaxF"],
    }


@pytest.mark.parametrize("controlled", [1, 0])
@pytest.mark.parametrize("size", [0.001, 0.15])
def test_every_rate_and_output_is_that_of_the_specification_written_by_hand(size, controlled):
    device = Evaluated(build_model(NAME), OTHERWISE | {"VFlag": controlled})
    limited = set()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = {name: value + size * rng.standard_normal() for name, value in device.states.items()}
        v = 1.02 * exp(0.5j) * (1 + 0.5 * size * exp(1j * seed))
        rates, outputs = by_hand(device.parameters, x, v)
        found = device.rates([v.real, v.imag], device.vector(x))
        assert {k: found[k] for k in rates} == pytest.approx(rates, rel=1e-9, abs=1e-9)
        assert set(found) - set(rates) == {"source.e_q", "source.e_d"}
        seen = device.outputs([v.real, v.imag], device.vector(x))
        assert {k: seen[k] for k in outputs} == pytest.approx(outputs, rel=1e-9, abs=1e-9)
        limited.add(outputs["fault_current"] > 1)
    assert limited == ({False} if size < 0.1 else {False, True})


@pytest.mark.parametrize("controlled", [1, 0])
def test_the_power_flow_is_a_steady_state(controlled):
    device = Evaluated(
        build_model(NAME),
        {"P_0": 0.4, "Q_0": -0.2, "v_0": 1.04, "theta_0": 2.0, "VFlag": controlled},
    )
    v = 1.04 * exp(2j)
    assert max(map(abs, device.rates([v.real, v.imag]).values())) < 1e-12
    found = device.outputs([v.real, v.imag])
    assert (found["p"], found["q"], found["omega"]) == pytest.approx((0.4, -0.2, 1.0), abs=1e-12)


def settled(path, seconds, *watched, turning=0.0, v=1.0, **values):
    """Outputs after so long on a bus voltage of that magnitude that turns by so many rad/s."""
    with LoadedComponent("device", read_description(path)) as device:
        device.set(values | {"communication_step": STEP})
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        for k in range(round(seconds / STEP)):
            bus = v * exp(1j * turning * (k + 0.5) * STEP)
            device.set({"v_re": bus.real, "v_im": bus.imag})
            device.step(k * STEP, STEP)
        return device.get(list(watched))


@pytest.mark.parametrize("deviation", [-0.002, 0.003])
def test_the_droop_gives_power_by_the_grids_frequency(deviation, fmu_path):
    found = settled(
        fmu_path(NAME), 3.0, "p", "omega", turning=2 * np.pi * 50 * deviation, P_0=0.5, mp=0.02
    )
    assert found["p"] == pytest.approx(0.5 - deviation / 0.02, abs=1e-3)
    assert found["omega"] == pytest.approx(1 + deviation, abs=3e-6)


@pytest.mark.parametrize(("deviation", "limit"), [(-0.004, 0.8), (0.004, 0.3)])
def test_the_limits_of_active_power_hold_it_where_the_droop_would_leave_them(
    deviation, limit, fmu_path
):
    values = {"P_0": 0.5, "mp": 0.01, "Pmax": 0.8, "Pmin": 0.3}
    found = settled(
        fmu_path(NAME), 6.0, "p", "x_Pmax", "x_Pmin", turning=2 * np.pi * 50 * deviation, **values
    )
    assert found["p"] == pytest.approx(limit, abs=1e-3)
    # The integrator carries what the droop would give: 1 + mp·(Pref − P) + x is the grid's frequency.
    assert found["x_Pmax"] + found["x_Pmin"] == pytest.approx(
        deviation - 0.01 * (0.5 - limit), abs=2e-5
    )


@pytest.mark.parametrize(("v", "q"), [(0.99, 0.2), (1.01, -0.2), (0.96, 0.44), (1.04, -0.44)])
def test_the_q_v_droop_and_its_limits(v, q, fmu_path):
    """The voltage control holds V = Vref + mq·(Qref − Q), and 0.05·Q = 1 − V within ±0.44."""
    found = settled(fmu_path(NAME), 6.0, "q", "V", v=v, P_0=0.5)
    assert found["V"] == pytest.approx(v, abs=1e-9)
    assert found["q"] == pytest.approx(q, abs=2e-3)


@pytest.mark.parametrize("v", [0.0, 0.3])
def test_in_a_fault_the_current_stays_within_its_limit_and_keeps_its_direction(v, fmu_path):
    found = settled(fmu_path(NAME), 0.05, "I", "fault_current", v=v, P_0=0.5, ImaxF=1.5)
    assert found["fault_current"] > 2.0
    assert found["I"] == pytest.approx(1.5, rel=5e-3)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"P_0": 1.1}, "Pmax: lower P_0"),
        ({"Q_0": 0.5}, "Qmax: lower Q_0"),
        ({"P_0": 0.5, "ImaxF": 0.4}, "ImaxF"),
    ],
)
def test_a_dispatch_beyond_a_limit_is_refused(values, text, fmu_path):
    with pytest.raises(Exception, match=text):
        settled(fmu_path(NAME), STEP, "p", **values)
