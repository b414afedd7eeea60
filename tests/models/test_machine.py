"""Machine, exciters and stabiliser of the synchronous generator, against equations written a second time by hand."""

from cmath import exp

import numpy as np
import pytest

from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.excitation.without_ceilings import ac4a, st1, st4b
from fmus.synchronous_generator.machine import Start
from fmus.synchronous_generator.stabilization.norm631 import pss2a
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr
from tests.support.evaluated import Evaluated

UNEQUAL = {
    "P_0": 0.7,
    "Q_0": 0.15,
    "v_0": 1.02,
    "theta_0": -0.4,
    "S_n": 560.0,
    "S_base": 120.0,
    "f_n": 60.0,
    "transformer.R_t": 0.004,
    "transformer.X_t": 0.13,
    "machine.R_s": 0.003,
    "machine.H": 4.3,
    "machine.D": 1.7,
    "machine.X_l": 0.16,
    "machine.X_d": 1.9,
    "machine.X_d1": 0.36,
    "machine.X_d2": 0.25,
    "machine.T_d10": 6.1,
    "machine.T_d20": 0.031,
    "machine.X_q": 1.75,
    "machine.X_q1": 0.52,
    "machine.X_q2": 0.27,
    "machine.T_q10": 0.8,
    "machine.T_q20": 0.052,
    "governor.enabled": 0,
}


# -- the machine --------------------------------------------------------------------------------


def by_hand(p, x, v, E_fd, P_m):
    """Rates of fluxes, speed and angle, and the stator current, from the equations in machine.py's first lines."""
    omega_b, w = 2 * np.pi * p["f_n"], x["machine.omega"]
    R, H, D = p["machine.R_s"] + p["transformer.R_t"], p["machine.H"], p["machine.D"]
    in_frame = v * exp(-1j * x["machine.delta"])
    v_q, v_d = in_frame.real, -in_frame.imag
    i, airgap, rotor = {}, {}, {}
    for axis, slow, fast in (("d", "psi_f", "psi_1d"), ("q", "psi_1q", "psi_2q")):
        X = [p[f"machine.{name}"] for name in (f"X_m{axis}", f"{axis}_X_1", f"{axis}_X_2")]
        leakage = p["machine.X_l"] + p["transformer.X_t"]
        psi_1, psi_2 = x[f"machine.{slow}"], x[f"machine.{fast}"]
        # Three unknown: the air-gap flux ψ_m = X_m·(i_1 + i_2 − i), with ψ = ψ_m − leakage·i and ψ_k = ψ_m + X_k·i_k.
        equations = np.array(
            [[1, X[0], -X[0], -X[0]], [1, -leakage, 0, 0], [1, 0, X[1], 0], [1, 0, 0, X[2]]]
        )  # of (ψ_m, i, i_1, i_2)
        known = [0.0, x[f"machine.psi_{axis}"], psi_1, psi_2]
        airgap[axis], i[axis], *rotor[axis] = np.linalg.solve(equations, known)
    psi_d, psi_q = x["machine.psi_d"], x["machine.psi_q"]
    torque = psi_d * i["q"] - psi_q * i["d"]
    rates = {
        "machine.psi_q": omega_b * (v_q + R * i["q"] - w * psi_d),
        "machine.psi_d": omega_b * (v_d + R * i["d"] + w * psi_q),
        "machine.psi_f": omega_b * p["machine.d_R_1"] * (E_fd / p["machine.X_md"] - rotor["d"][0]),
        "machine.psi_1d": -omega_b * p["machine.d_R_2"] * rotor["d"][1],
        "machine.psi_1q": -omega_b * p["machine.q_R_1"] * rotor["q"][0],
        "machine.psi_2q": -omega_b * p["machine.q_R_2"] * rotor["q"][1],
        "machine.omega": (P_m / w - torque - D * (w - 1)) / (2 * H),
        "machine.delta": omega_b * (w - 1),
    }
    current = complex(i["q"], -i["d"]) * exp(1j * x["machine.delta"])
    return rates, current, torque


@pytest.mark.parametrize("exciter", ["ac4a", "st1", "st4b"])
def test_every_rate_of_the_machine_is_that_of_the_equations_written_by_hand(exciter):
    machine = Evaluated(build_model(f"synchronous_generator_{exciter}"), UNEQUAL)
    rng = np.random.default_rng(3)
    for _ in range(10):
        x = {name: value + 0.03 * rng.standard_normal() for name, value in machine.states.items()}
        v = 1.02 * exp(-0.4j) * (1 + 0.05 * complex(*rng.standard_normal(2)))
        y = machine.outputs([v.real, v.imag], machine.vector(x))
        rates, current, torque = by_hand(machine.parameters, x, v, y["E_fd"], y["P_m"])
        found = machine.rates([v.real, v.imag], machine.vector(x))
        assert {name: found[name] for name in rates} == pytest.approx(rates, rel=1e-9, abs=1e-9)
        scale = UNEQUAL["S_n"] / UNEQUAL["S_base"]
        assert complex(y["i_re"], y["i_im"]) == pytest.approx(current * scale, rel=1e-9)
        power = v * current.conjugate()
        assert (y["p"], y["q"], y["T_e"]) == pytest.approx(
            (power.real, power.imag, torque), rel=1e-9
        )


def swing_mode(**values):
    """The machine's swing against its bus [rad/s]."""
    machine = Evaluated(build_model("synchronous_generator_st4b_pss2a"), UNEQUAL | values)
    bus = 1.02 * exp(-0.4j)
    poles = np.linalg.eigvals(machine.blocks([bus.real, bus.imag])[0])
    return min((pole for pole in poles if 3 < pole.imag < 20), key=lambda pole: abs(pole - 9j))


def test_the_damping_torque_damps_the_swing():
    """D adds −D/2H to the trace: half of it to each of the pair, as far as the pair is the swing alone."""
    values = {"pss.enabled": 0}
    without, having = (
        swing_mode(**values, **{"machine.D": 0.0}),
        swing_mode(**values, **{"machine.D": 4.0}),
    )
    assert having.real - without.real == pytest.approx(-4.0 / (4 * 4.3), rel=0.1)
    assert having.imag == pytest.approx(without.imag, rel=0.01)


def test_the_stabiliser_damps_the_swing():
    without, having = swing_mode(**{"pss.enabled": 0}), swing_mode(**{"pss.enabled": 1})
    assert having.real < without.real - 0.2


# -- the exciters -------------------------------------------------------------------------------

START = Start(Expr(1.01), Expr(2.2), Expr(0.7), Phasor(1.0, 0.0), Phasor(0.7, -0.1))


def excited(exciter, values):
    """An exciter between the terminal voltage, the field current and a stabiliser's signal, and its field voltage."""
    m = ModelBuilder("alone", "The exciter alone")
    v_t, I_fd, v_s = (
        m.input(name, "pu", name, base="S_n", start=start)
        for name, start in (("v_t", 1.01), ("I_fd", 2.2), ("v_s", 0))
    )
    E_fd, _ = exciter(m, Regulated(START, lambda E: Phasor(v_t, 0.0), I_fd, v_s))
    m.output("E_fd", E_fd, "pu", "Field voltage", base="E_fd")
    return Evaluated(m.build(), {f"exciter.{name}": value for name, value in values.items()})


AT_REST = [1.01, 2.2, 0.0]
REGULATORS = {
    "ac4a": (ac4a, {"K_A": 150.0, "T_A": 0.02, "T_B": 8.0, "T_C": 0.9, "T_R": 0.012}),
    "st1": (st1, {"K_A": 150.0, "T_B": 8.0, "T_C": 0.9, "T_R": 0.012}),
    "st4b": (st4b, {"K_PR": 3.5, "K_IR": 2.9, "T_A": 0.03, "K_P": 6.1, "K_C": 0.11, "T_R": 0.025}),
}


@pytest.mark.parametrize("hertz", [0.1, 0.6, 1.4, 8.0])
@pytest.mark.parametrize("name", REGULATORS)
def test_an_exciter_is_its_block_diagram_and_a_signal_raises_the_field_voltage(name, hertz):
    exciter, p = REGULATORS[name]
    found = excited(exciter, p)
    assert found.outputs(AT_REST)["E_fd"] == pytest.approx(2.2, rel=1e-12)
    assert max(map(abs, found.rates(AT_REST).values())) < 1e-12
    s = 2j * np.pi * hertz
    of_current = of_voltage = 0.0
    if name == "st4b":
        # Fed from the terminal: E_fd = control·(K_P·v_t − 0.577·K_C·I_fd).
        bridge = p["K_P"] * 1.01 - 0.577 * p["K_C"] * 2.2
        gain = (p["K_PR"] + p["K_IR"] / s) / (1 + p["T_A"] * s) * bridge
        of_current, of_voltage = -0.577 * p["K_C"] * 2.2 / bridge, p["K_P"] * 2.2 / bridge
    else:
        gain = p["K_A"] * (1 + p["T_C"] * s) / (1 + p["T_B"] * s) / (1 + p.get("T_A", 0.0) * s)
    assert found.response(s, AT_REST) == pytest.approx(
        {
            ("E_fd", "v_s"): gain,
            ("E_fd", "v_t"): of_voltage - gain / (1 + p["T_R"] * s),
            ("E_fd", "I_fd"): of_current,
        },
        rel=1e-9,
        abs=1e-12,
    )


@pytest.mark.parametrize("name", REGULATORS)
def test_a_raised_reference_raises_the_field_voltage(name):
    exciter, p = REGULATORS[name]
    raised = excited(exciter, p | {"delta_V_ref": 0.01})
    signal = excited(exciter, p)
    x = signal.x
    assert raised.outputs(AT_REST, x) == pytest.approx(
        signal.outputs([1.01, 2.2, 0.01], x), rel=1e-12
    )
    assert raised.rates(AT_REST, x) == pytest.approx(signal.rates([1.01, 2.2, 0.01], x), rel=1e-12)


# -- the stabiliser -----------------------------------------------------------------------------


def stabiliser(**values):
    m = ModelBuilder("alone", "The stabiliser alone")
    speed, power = (
        m.input("speed", "pu", "w − 1", base="f_n"),
        m.input("power", "pu", "P_e", base="S_n", start=0.8),
    )
    m.output("v_s", pss2a(m, speed, power, Expr(0.8)), "pu", "Signal", base="S_n")
    return Evaluated(m.build(), {f"pss.{name}": value for name, value in values.items()})


PSS = {
    "T_w1": 2.5,
    "T_w2": 3.0,
    "T_w3": 3.5,
    "T_w4": 4.0,
    "T_6": 0.03,
    "T_7": 2.2,
    "T_8": 0.5,
    "T_9": 0.11,
    "K_s1": 13.0,
    "K_s2": 0.2,
    "K_s3": 0.9,
    "T_1": 0.22,
    "T_2": 0.05,
    "T_3": 0.31,
    "T_4": 0.14,
}


@pytest.mark.parametrize("hertz", [0.08, 0.5, 1.2, 4.0])
def test_the_stabiliser_with_all_its_blocks_is_the_standards_diagram(hertz):
    s, p = 2j * np.pi * hertz, PSS
    speed = s * 2.5 / (1 + s * 2.5) * s * 3.0 / (1 + s * 3.0) / (1 + s * 0.03)
    power = s * 3.5 / (1 + s * 3.5) * s * 4.0 / (1 + s * 4.0) * p["K_s2"] / (1 + s * 2.2)
    ramp = (1 + s * 0.5) / (1 + s * 0.11) ** 5
    leads = (1 + s * 0.22) / (1 + s * 0.05) * (1 + s * 0.31) / (1 + s * 0.14)
    wanted = {
        ("v_s", "speed"): 13 * leads * ramp * speed,
        ("v_s", "power"): 13 * leads * (ramp * 0.9 - 1) * power,
    }
    assert stabiliser(**PSS).response(s, [0.0, 0.8]) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("limit", [0.05, 0.1, 0.17])
def test_the_stabilisers_signal_stays_within_its_limit(limit):
    unlimited, limited = stabiliser(**PSS, limit=10.0), stabiliser(**PSS, limit=limit)
    rng, seen = np.random.default_rng(5), []
    for _ in range(40):
        x = unlimited.x + 0.01 * rng.standard_normal(len(unlimited.x))
        wanted = unlimited.outputs([0.0, 0.8], x)["v_s"]
        assert limited.outputs([0.0, 0.8], x)["v_s"] == pytest.approx(
            np.clip(wanted, -limit, limit), rel=1e-12
        )
        seen.append(wanted)
    assert min(seen) < -0.17
    assert max(seen) > 0.17
    assert min(map(abs, seen)) < 0.05
