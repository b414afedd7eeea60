"""Machines of `synchronous_generator` against equations of the literature written by hand."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.parts import MACHINES
from tests.models.parts import AT_BUS, BUS, refused
from tests.support.evaluated import Evaluated

BOTH_KINDS = [name for name in MACHINES if name != "genrou_rated_speed"]
WOUND = ("two_axis", "gensal", "genrou")
DATA = {
    "R_s": 0.003,
    "H": 4.3,
    "D": 1.7,
    "X_l": 0.16,
    "X_d": 1.9,
    "X_d1": 0.36,
    "X_d2": 0.25,
    "T_d10": 6.1,
    "T_d20": 0.031,
    "X_q": 1.75,
    "X_q1": 0.52,
    "X_q2": 0.25,
    "T_q10": 0.8,
    "T_q20": 0.052,
    "s_10": 0.11,
    "s_12": 0.42,
}


def machine(name, factory=synchronous_generator, **values):
    model = factory(machine=name)
    known = {v.name for v in model.parameters}
    data = {f"machine.{key}": value for key, value in DATA.items() if f"machine.{key}" in known}
    return Evaluated(model, AT_BUS | data | values)


def S(x):
    """Saturation through (1.0, 0.11) and (1.2, 0.42), by the two points."""
    ratio = np.sqrt(DATA["s_10"] / (1.2 * DATA["s_12"]))
    A = (1 - 1.2 * ratio) / (1 - ratio)
    return DATA["s_10"] / (1 - A) ** 2 * max(x - A, 0) ** 2 / x


# -- the published equations --------------------------------------------------------------------


def shifted(device, seed):
    rng = np.random.default_rng(seed)
    return {name: value + 0.03 * rng.standard_normal() for name, value in device.states.items()}


def current(device, x):
    """(i_d, i_q) of the stator [pu, S_n] from the port's current."""
    y = device.outputs([BUS.real, BUS.imag], device.vector(x))
    in_frame = complex(y["i_re"], y["i_im"]) * np.exp(-1j * x["machine.delta"])
    return -in_frame.imag, in_frame.real


REVERSED = {"T_d10": 0.02, "T_q10": 0.01}
"""Transient time constants below the subtransient ones, as New England's generator 30 of the IEEE PES has them."""


IN_ANOTHER_ORDER = {
    "usual": {},
    "reversed": REVERSED,
    "X'' > X'd": {"X_d2": 0.4},
    "X'' > X'q": {"X_d1": 0.6, "X_d2": 0.55},
    "X_l > X''": {"X_l": 0.3},
    "X_l > X'": {"X_l": 0.4},
    "X'q = Xq": {"X_q1": DATA["X_q"]},
}
"""Data of GENROU that PSS/E warns of, and computes with; the last are those of many hydro units."""


@pytest.mark.parametrize("order", IN_ANOTHER_ORDER)
@pytest.mark.parametrize("seed", range(5))
def test_genrou_is_the_model_of_stability_programs_with_saturation(seed, order):
    """Sauer and Pai's two-winding axes in E'_q, ψ_1d, E'_d, ψ_2q; saturation as PSS/E's diagram adds it."""
    changes = IN_ANOTHER_ORDER[order]
    values = {f"machine.{name}": x for name, x in changes.items()}
    device, p = machine("genrou", **values), DATA | changes
    assert not refused(device)
    x = shifted(device, seed)
    i_d, i_q = current(device, x)
    X_md, X_mq = p["X_d"] - p["X_l"], p["X_q"] - p["X_l"]
    p = p | {"X_q1": min(p["X_q1"], p["X_q"] - 1e-4 * X_mq)}  # so that E'_d can be told
    to_E, to_E_d = (p["X_d"] - p["X_d1"]) / X_md, (p["X_q"] - p["X_q1"]) / X_mq  # X_m/(X_m + X_1)
    E_q, E_d = x["machine.psi_f"] * to_E, -x["machine.psi_1q"] * to_E_d
    psi_1d, psi_2q = x["machine.psi_1d"], x["machine.psi_2q"]
    d1, d2 = p["X_d1"] - p["X_l"], p["X_d2"] - p["X_l"]
    q1, q2 = p["X_q1"] - p["X_l"], p["X_d2"] - p["X_l"]
    psi_d = E_q * d2 / d1 + psi_1d * (d1 - d2) / d1
    psi_q = -E_d * q2 / q1 + psi_2q * (q1 - q2) / q1
    S_now = S(np.hypot(psi_d, psi_q))
    E_fd = device.outputs([BUS.real, BUS.imag], device.vector(x))["E_fd"]
    wanted = {
        "machine.psi_f": (
            E_fd
            - E_q
            - (p["X_d"] - p["X_d1"]) * (i_d - (d1 - d2) / d1**2 * (psi_1d + d1 * i_d - E_q))
            - S_now * psi_d
        )
        / p["T_d10"]
        / to_E,
        "machine.psi_1d": (-psi_1d + E_q - d1 * i_d) / p["T_d20"],
        "machine.psi_1q": -(
            -E_d
            + (p["X_q"] - p["X_q1"]) * (i_q - (q1 - q2) / q1**2 * (psi_2q + q1 * i_q + E_d))
            + S_now * psi_q * X_mq / X_md
        )
        / p["T_q10"]
        / to_E_d,
        "machine.psi_2q": (-psi_2q - E_d - q1 * i_q) / p["T_q20"],
    }
    found = device.rates([BUS.real, BUS.imag], device.vector(x))
    rounding = 1e-7 if order == "X'q = Xq" else 1e-9  # the flux is 1e4 times what is left of it
    assert {name: found[name] for name in wanted} == pytest.approx(wanted, rel=rounding)


TYPE_J = DATA | {"X_q2": 0.22, "K_is": 0.08}


def type_j(fluxes, factors, currents, E_fd):
    """Rates of GENTPJ's four states, in the form of its block diagram; E'_d is the q axis' E' with the other sign."""
    (E_q, E_d, psi_d2, psi_q2), (S_d, S_q), (i_d, i_q), p = fluxes, factors, currents, TYPE_J
    d, d1, d2 = (p[name] for name in ("X_d", "X_d1", "X_d2"))
    q, q1, q2 = (p[name] for name in ("X_q", "X_q1", "X_q2"))
    E_q1 = (E_q * (d - d2) - psi_d2 * (d - d1)) / (d1 - d2)
    E_q2 = (psi_d2 - E_q + i_d * (d1 - d2) / S_d) * (d - d2) / (d1 - d2)
    E_d1 = (psi_q2 * (q - q1) + E_d * (q - q2)) / (q1 - q2)
    E_d2 = -(E_d + psi_q2) * (q - q2) / (q1 - q2) - i_q * (q - q2) / S_q
    return (
        (E_fd - S_d * E_q1) / p["T_d10"],
        -S_q * E_d1 / p["T_q10"],
        -S_d * (d1 - d2) / (d - d2) * E_q2 / p["T_d20"],
        S_q * (q1 - q2) / (q - q2) * E_d2 / p["T_q20"],
    )


@pytest.mark.parametrize("seed", range(5))
def test_gentpj_is_its_block_diagram_with_saturation_of_flux_and_current(seed):
    values = {f"machine.{name}": TYPE_J[name] for name in ("X_q2", "K_is")}
    device, p = machine("gentpj", **values), TYPE_J
    assert not refused(device)
    x = shifted(device, seed)
    i_d, i_q = current(device, x)
    s = x["machine.saturation"]
    S_d, S_q = 1 + s, 1 + s * p["X_q"] / p["X_d"]
    psi_d = x["machine.psi_1d"] - (p["X_l"] + (p["X_d2"] - p["X_l"]) / S_d) * i_d
    psi_q = x["machine.psi_2q"] - (p["X_l"] + (p["X_q2"] - p["X_l"]) / S_q) * i_q
    assert (psi_d, psi_q) == pytest.approx((x["machine.psi_d"], x["machine.psi_q"]), rel=1e-9)
    to_E = (p["X_d"] - p["X_d1"]) / (p["X_d"] - p["X_d2"])
    to_E_d = (p["X_q"] - p["X_q1"]) / (p["X_q"] - p["X_q2"])
    E_fd = device.outputs([BUS.real, BUS.imag], device.vector(x))["E_fd"]
    E_q, E_d = to_E * x["machine.psi_f"], -to_E_d * x["machine.psi_1q"]
    fluxes = E_q, E_d, x["machine.psi_1d"], x["machine.psi_2q"]
    wanted = type_j(fluxes, (S_d, S_q), (i_d, i_q), E_fd)
    found = device.rates([BUS.real, BUS.imag], device.vector(x))
    scaled = (to_E, "psi_f"), (-to_E_d, "psi_1q"), (1.0, "psi_1d"), (1.0, "psi_2q")
    assert [k * found[f"machine.{name}"] for k, name in scaled] == pytest.approx(wanted, rel=1e-9)
    leak = np.hypot(psi_d + p["X_l"] * i_d, psi_q + p["X_l"] * i_q)
    S_now = S(leak + p["K_is"] * np.hypot(i_d, i_q))
    assert found["machine.saturation"] == pytest.approx((S_now - s) / 0.005, rel=1e-9)


def test_gentpj_swings_as_its_equations_without_a_lag():
    """Beside the machine at a stiff bus, its diagram's equations with S, current and torque solved at every instant."""
    p = TYPE_J | {"D": 0.0, "R_s": 0.0}
    lags = {"machine.T_saturation": 1e-3, "machine.T_saliency": 1e-3, "machine.speed_in_emf": 0}
    values = {f"machine.{name}": p[name] for name in ("X_q2", "K_is", "D", "R_s")}
    device = machine("gentpj", synchronous_generator_phasor, **values, **lags)
    start = device.states
    to_E = (p["X_d"] - p["X_d1"]) / (p["X_d"] - p["X_d2"])
    to_E_d = (p["X_q"] - p["X_q1"]) / (p["X_q"] - p["X_q2"])
    y = device.outputs([BUS.real, BUS.imag])

    def rates(x):
        E_q, E_d, psi_d2, psi_q2, w, delta = x
        v = BUS * np.exp(-1j * delta)

        def currents(s):
            S_d, S_q = 1 + s, 1 + s * p["X_q"] / p["X_d"]
            X_d = p["X_l"] + (p["X_d2"] - p["X_l"]) / S_d
            X_q = p["X_l"] + (p["X_q2"] - p["X_l"]) / S_q
            return S_d, S_q, (psi_d2 - v.real) / X_d, (psi_q2 - v.imag) / X_q

        def misfit(s):
            _, _, i_d, i_q = currents(s)
            leak = np.hypot(v.real + p["X_l"] * i_d, v.imag + p["X_l"] * i_q)
            return S(leak + p["K_is"] * np.hypot(i_d, i_q)) - s

        S_d, S_q, i_d, i_q = currents(brentq(misfit, 0.0, 1.0, xtol=1e-15))
        fluxes = type_j((E_q, E_d, psi_d2, psi_q2), (S_d, S_q), (i_d, i_q), y["E_fd"])
        torque = v.real * i_q - v.imag * i_d
        motion = (y["T_e"] - torque) / (2 * p["H"]), 100 * np.pi * (w - 1)
        return np.array([*fluxes, *motion])

    names = ("psi_f", "psi_1q", "psi_1d", "psi_2q", "omega", "delta")
    x0 = np.array([start[f"machine.{name}"] for name in names]) * [to_E, -to_E_d, 1, 1, 1, 1]
    assert rates(x0) == pytest.approx(np.zeros(6), abs=1e-9)
    columns = [(rates(x0 + h) - rates(x0 - h)) / 2e-6 for h in 1e-6 * np.eye(6)]
    wanted = np.linalg.eigvals(np.array(columns).T)
    found = np.linalg.eigvals(device.blocks([BUS.real, BUS.imag])[0])
    for pole in wanted:
        assert min(abs(found - pole)) < 0.01 * max(abs(pole), 1), pole


@pytest.mark.parametrize("seed", range(5))
def test_gensal_saturates_the_d_axis_by_its_transient_emf(seed):
    device, p = machine("gensal"), DATA
    x = shifted(device, seed)
    i_d, i_q = current(device, x)
    d1, d2 = p["X_d1"] - p["X_l"], p["X_d2"] - p["X_l"]
    ratio = (p["X_d"] - p["X_d1"]) / (p["X_d"] - p["X_l"])  # X_md/(X_md + X_f)
    E_q, psi_1d = x["machine.psi_f"] * ratio, x["machine.psi_1d"]
    E_fd = device.outputs([BUS.real, BUS.imag], device.vector(x))["E_fd"]
    excited = i_d - (d1 - d2) / d1**2 * (psi_1d + d1 * i_d - E_q)
    found = device.rates([BUS.real, BUS.imag], device.vector(x))
    wanted = (E_fd - E_q - (p["X_d"] - p["X_d1"]) * excited - S(E_q) * E_q) / p["T_d10"] / ratio
    assert found["machine.psi_f"] == pytest.approx(wanted, rel=1e-9)
    to_last = (p["X_q"] - p["X_d2"]) / (p["X_q"] - p["X_l"])  # X_mq/(X_mq + X_1q)
    last = x["machine.psi_1q"] * to_last
    wanted = (-last - (p["X_q"] - p["X_d2"]) * i_q) / p["T_q20"] / to_last
    assert found["machine.psi_1q"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_two_axis_machine_is_sauer_and_pais(seed):
    device, p = machine("two_axis"), DATA
    x = shifted(device, seed)
    i_d, i_q = current(device, x)
    to_d, to_q = (p["X_d"] - p["X_d1"]) / p["X_d"], (p["X_q"] - p["X_q1"]) / p["X_q"]
    E_q, E_d = x["machine.psi_f"] * to_d, -x["machine.psi_1q"] * to_q
    y = device.outputs([BUS.real, BUS.imag], device.vector(x))
    found = device.rates([BUS.real, BUS.imag], device.vector(x))
    wanted = (y["E_fd"] - E_q - (p["X_d"] - p["X_d1"]) * i_d) / p["T_d10"]
    assert found["machine.psi_f"] * to_d == pytest.approx(wanted, rel=1e-9)
    wanted = (-E_d + (p["X_q"] - p["X_q1"]) * i_q) / p["T_q10"]
    assert -found["machine.psi_1q"] * to_q == pytest.approx(wanted, rel=1e-9)
    psi_d, psi_q = x["machine.psi_d"], x["machine.psi_q"]
    assert psi_d == pytest.approx(E_q - p["X_d1"] * i_d, rel=1e-9)
    assert psi_q == pytest.approx(-E_d - p["X_q1"] * i_q, rel=1e-9)
    motion = (y["P_m"] / x["machine.omega"] - y["T_e"] - p["D"] * (x["machine.omega"] - 1)) / (
        2 * p["H"]
    )
    assert found["machine.omega"] == pytest.approx(motion, rel=1e-9)


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
def test_the_classical_machine_swings_as_the_textbooks_formula_says(factory):
    """√(K_s·ω_b/2H) with K_s = E'·v·cos δ/X'."""
    values = {"machine.D": 0.0, "machine.R_s": 0.0, "machine.X_d1": 0.3}
    device = machine("classical", factory, **values)
    i = np.conj(complex(AT_BUS["P_0"], AT_BUS["Q_0"]) / BUS)
    E = BUS + 0.3j * i
    stiffness = abs(E) * abs(BUS) * np.cos(np.angle(E / BUS)) / 0.3
    wanted = np.sqrt(stiffness * 100 * np.pi / (2 * DATA["H"]))
    poles = np.linalg.eigvals(device.blocks([BUS.real, BUS.imag])[0])
    swing = min((z for z in poles if z.imag > 0), key=lambda z: abs(z - 1j * wanted))
    assert swing.imag == pytest.approx(wanted, rel=3e-3)
    assert abs(swing.real) < 0.02
    assert device.outputs([BUS.real, BUS.imag])["E_fd"] == pytest.approx(abs(E), rel=1e-12)


# -- steady states ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "factory"),
    [(n, synchronous_generator) for n in BOTH_KINDS]
    + [(n, synchronous_generator_phasor) for n in MACHINES],
)
def test_a_machine_starts_in_its_steady_state_with_the_power_flows_power(name, factory):
    device = machine(name, factory, **{"transformer.R_t": 0.004, "transformer.X_t": 0.13})
    assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-10
    y = device.outputs([BUS.real, BUS.imag])
    assert (y["p"], y["q"]) == pytest.approx((0.7, 0.15), abs=1e-12)
    assert not refused(device)


@pytest.mark.parametrize("v", [0.7, 1.0, 1.2])
@pytest.mark.parametrize("name", ["gensal", "genrou", "gensae", "genroe", "gentpj"])
def test_saturation_is_that_of_the_open_circuit_curve(name, v):
    """A data sheet's S(1.0) and S(1.2): the field's share beyond the air-gap line."""
    device = machine(name, P_0=0.0, Q_0=0.0, v_0=v)
    E_fd = device.outputs([BUS.real, BUS.imag])["E_fd"]
    exponent = np.log(DATA["s_12"] / DATA["s_10"]) / np.log(1.2)
    below = DATA["s_10"] * v**exponent if name in ("gensae", "genroe") else 0.0
    share = {1.0: DATA["s_10"], 1.2: DATA["s_12"]}.get(v, below)
    assert E_fd == pytest.approx(v * (1 + share), rel=1e-12)


@pytest.mark.parametrize("name", WOUND)
def test_without_saturation_the_steady_state_is_the_phasor_diagrams(name):
    device = machine(
        name, **({"machine.s_10": 0.0, "machine.s_12": 0.0} if name != "two_axis" else {})
    )
    i = np.conj(complex(AT_BUS["P_0"], AT_BUS["Q_0"]) / BUS)
    delta = np.angle(BUS + (DATA["R_s"] + 1j * DATA["X_q"]) * i)
    v_q, i_d, i_q = (
        (BUS * np.exp(-1j * delta)).real,
        -(i * np.exp(-1j * delta)).imag,
        (i * np.exp(-1j * delta)).real,
    )
    y = device.outputs([BUS.real, BUS.imag])
    assert y["delta"] == pytest.approx(delta, rel=1e-12)
    assert y["E_fd"] == pytest.approx(v_q + DATA["R_s"] * i_q + DATA["X_d"] * i_d, rel=1e-12)


# -- bases and special data ---------------------------------------------------------------------


@pytest.mark.parametrize("name", BOTH_KINDS)
def test_data_on_another_base_are_the_same_machine(name):
    """S_n = 247.5 MVA and data on 100 MVA, as textbooks print them."""
    own = machine(name, S_n=247.5)
    scaled = {}
    for key, value in DATA.items():
        if key.startswith("X_") or key == "R_s":
            scaled[f"machine.{key}"] = value * 100 / 247.5
        elif key in ("H", "D"):
            scaled[f"machine.{key}"] = value * 247.5 / 100
    known = {v.name for v in own.model.parameters}
    given = {key: value for key, value in scaled.items() if key in known}
    other = machine(name, S_n=247.5, **given, **{"machine.S_data": 100.0})
    assert other.states == pytest.approx(own.states, rel=1e-12)
    x = shifted(own, 1)
    u = [BUS.real, BUS.imag]
    assert other.rates(u, own.vector(x)) == pytest.approx(
        own.rates(u, own.vector(x)), rel=1e-9, abs=1e-9
    )


@pytest.mark.parametrize("name", ["two_axis", "genrou"])
def test_a_q_axis_without_a_slow_winding_is_allowed(name):
    device = machine(name, **{"machine.X_q1": DATA["X_q"]})
    assert not refused(device)
    assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-6
    poles = np.linalg.eigvals(device.blocks([BUS.real, BUS.imag])[0])
    assert max(pole.real for pole in poles) < 0


@pytest.mark.parametrize("name", ["genrou", "gensal"])
def test_a_leakage_reactance_of_the_subtransient_ones_size_is_the_limit_of_smaller_ones(name):
    """The stability programs' equations have no division by X'' − X_l."""
    poles = []
    for X_l in (DATA["X_d2"], DATA["X_d2"] * (1 - 1e-4)):
        device = machine(name, **{"machine.X_l": X_l})
        assert not refused(device)
        assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-6
        poles.append(sorted(np.linalg.eigvals(device.blocks([BUS.real, BUS.imag])[0]), key=abs))
    assert poles[0] == pytest.approx(poles[1], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "values", "rule"),
    [
        ("genrou", {"machine.X_q1": 1.8}, "machine.X_q1 must not exceed machine.X_q"),
        ("genrou", {"machine.X_l": 0.36}, "machine.X_l must differ from machine.X_d1"),
        ("genrou", {"machine.X_l": 0.52}, "machine.X_l must differ from machine.X_q1"),
        ("gensal", {"machine.X_l": 1.8}, "machine.X_q must exceed machine.X_l"),
        ("gensal", {"machine.X_d": 0.3}, "machine.X_d must exceed machine.X_d1"),
        ("two_axis", {"machine.X_d1": 1.9}, "machine.X_d must exceed machine.X_d1"),
        ("gensal", {"machine.s_12": 0.05}, "saturation must rise"),
        ("genroe", {"machine.s_10": 0.0}, "no power of the flux goes through 0"),
        ("gentpj", {"machine.X_d2": 0.37}, "machine.X_d1 must exceed machine.X_d2"),
        ("gentpj", {"machine.X_q1": 1.8}, "machine.X_q1 must not exceed machine.X_q"),
        ("gentpj", {"machine.X_l": 0.26}, "machine.X_l must not exceed machine.X_d2"),
    ],
)
def test_data_that_are_no_machine_are_refused(name, values, rule):
    assert any(rule in text for text in refused(machine(name, **values)))


def test_constant_torque_and_constant_power_differ_by_the_power_over_2H():
    """∂ẇ/∂w is 0 with a constant torque and −P_0/2H with a constant power."""
    slopes = {}
    for governor in ("constant_torque", "constant_power"):
        device = Evaluated(synchronous_generator(machine="classical", governor=governor), AT_BUS)
        k = [s.name for s in device.model.states].index("machine.omega")
        slopes[governor] = device.blocks([BUS.real, BUS.imag])[0][k, k]
    H, P = 6.5, device.outputs([BUS.real, BUS.imag])["P_m"]
    assert slopes["constant_torque"] == pytest.approx(0.0, abs=1e-12)
    assert slopes["constant_power"] == pytest.approx(-P / (2 * H), rel=1e-9)


# -- the emf at rated speed ---------------------------------------------------------------------


@pytest.mark.parametrize(("name", "factor"), [("genrou", 1.02), ("genrou_rated_speed", 1.0)])
def test_at_rated_speed_the_emf_behind_the_subtransient_reactance_is_without_the_speed(
    name, factor
):
    device, p = machine(name, synchronous_generator_phasor), DATA
    x = shifted(device, 3) | {"machine.omega": 1.02}
    i_d, i_q = current(device, x)
    to_E, to_E_d = (
        (p[X] - p[X1]) / (p[X] - p["X_l"]) for X, X1 in (("X_d", "X_d1"), ("X_q", "X_q1"))
    )
    d1, d2, q1 = p["X_d1"] - p["X_l"], p["X_d2"] - p["X_l"], p["X_q1"] - p["X_l"]
    psi_d = x["machine.psi_f"] * to_E * d2 / d1 + x["machine.psi_1d"] * (d1 - d2) / d1
    psi_q = x["machine.psi_1q"] * to_E_d * d2 / q1 + x["machine.psi_2q"] * (q1 - d2) / q1
    v = BUS * np.exp(-1j * x["machine.delta"])
    assert v.real == pytest.approx(factor * psi_d - p["R_s"] * i_q - p["X_d2"] * i_d, abs=1e-12)
    assert -v.imag == pytest.approx(-factor * psi_q - p["R_s"] * i_d + p["X_d2"] * i_q, abs=1e-12)


def test_a_machine_for_phasors_alone_is_refused_with_stator_transients():
    with pytest.raises(ValueError, match="'genrou_rated_speed': its emf is that of rated speed"):
        synchronous_generator(machine="genrou_rated_speed")


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
def test_without_inertia_the_classical_machine_is_an_infinite_bus(factory):
    """PSS/E's reading of GENCLS with H = 0: neither power nor voltage moves the speed, so the angle stands still."""
    torn = [0.3 * BUS.real, -0.8 * BUS.imag]

    def rates(H):
        device = machine("classical", factory, **{"machine.H": H, "machine.D": 0.0})
        return device.rates(torn, device.vector(shifted(device, 3) | {"machine.omega": 1.0}))

    infinite, moving = rates(0.0), rates(4.0)
    assert infinite["machine.omega"] == infinite["machine.delta"] == 0
    assert abs(moving["machine.omega"]) > 1e-3
