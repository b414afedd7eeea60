"""Induction motors: their equivalent circuit, eigenvalues by other equations and by ANDES, torque laws, the relay."""

import json

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from fmus.induction_machine.dyr_records import INDUCTION_RECORDS
from fmus.induction_machine.model import induction_generator_phasor, induction_motor_phasor
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.benchmarks import andes_motors as andes
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

MODEL = induction_motor_phasor()
GENERATOR = induction_generator_phasor()
OMEGA_B = 2 * np.pi * 60
DATA = {"RA": 0.013, "XA": 0.067, "XM": 3.8, "R1": 0.009, "X1": 0.17, "H": 0.7, "f_n": 60.0}
CAGES = {
    "one": {},
    "two beside each other": {"R2": 0.05, "X2": 0.1},
    "two nested": {"IT": 2, "R1": 0.06, "R2": 0.012, "X2": 0.11},
}
AT = {"P_0": -0.8, "Q_0": -0.35, "v_0": 1.02, "theta_0": -0.4}
BUS = [1.02 * np.cos(-0.4), 1.02 * np.sin(-0.4)]
PEER = json.loads(andes.PLACE.read_text("utf-8"))


def motor(cages="one", **values):
    return Evaluated(MODEL, DATA | CAGES[cages] | AT | values)


def branches(p, slip):
    """The rotor's impedance by its branches, as the circuit is drawn."""
    first = p["R1"] / slip + 1j * p["X1"]
    if not p.get("R2"):
        return first
    if p.get("IT", 1) == 1:
        return 1 / (1 / first + 1 / (p["R2"] / slip + 1j * p["X2"]))
    return 1j * p["X1"] + 1 / (slip / p["R1"] + 1 / (p["R2"] / slip + 1j * p["X2"]))


def drawn(p, slip, v):
    """P + jQ and the air gap's power by the equivalent circuit."""
    rotor, magnetising = branches(p, slip), 1j * p["XM"]
    inner = rotor * magnetising / (rotor + magnetising)
    i = v / (p["RA"] + 1j * p["XA"] + inner)
    across = i * inner
    return v * np.conj(i), (across * np.conj(across / rotor)).real


@pytest.mark.parametrize("power", [-0.8, -0.2, 0.6, -1.3])
@pytest.mark.parametrize("cages", CAGES)
def test_it_starts_at_rest_at_the_slip_of_its_equivalent_circuit(cages, power):
    device = motor(cages, P_0=power)
    assert not refused(device)
    assert max(map(abs, device.rates(BUS).values())) < 1e-8
    p, slip, found = DATA | CAGES[cages], device.parameters["slip_0"], device.outputs(BUS)
    s, across = drawn(p, slip, complex(*BUS))
    assert s.real == pytest.approx(-power, abs=1e-9)
    assert found["p"] == pytest.approx(power)
    assert found["q"] == pytest.approx(AT["Q_0"])
    assert found["T_e"] == pytest.approx(across)
    assert found["T_L"] == pytest.approx(across)
    # the shunt generates what the motor draws more than the power flow
    assert device.parameters["B_shunt"] * AT["v_0"] ** 2 == pytest.approx(s.imag + AT["Q_0"])
    # the stable side of the pull-out point: more slip, more power
    assert drawn(p, slip + 1e-4, 1.02)[0].real > s.real


@pytest.mark.parametrize("cages", CAGES)
def test_it_settles_where_torque_and_load_are_equal_by_the_circuit(cages):
    """The voltage falls to 0.9 pu: the new slip is the circuit's, for a torque of the speed's square."""
    device = motor(cages, A=1.0, D=0.0)
    low = [0.9 * x / 1.02 for x in BUS]
    found, _ = integrated(device, lambda t: low, 3.0, step=2e-3)
    p, slip = DATA | CAGES[cages], 1 - found[-1]["speed"]
    torque_0, speed_0 = drawn(p, device.parameters["slip_0"], 1.02)[1], device.states["w"]
    _, across = drawn(p, slip, 0.9)
    assert across == pytest.approx(torque_0 * ((1 - slip) / speed_0) ** 2, rel=1e-6)
    assert found[-1]["T_e"] == pytest.approx(across, rel=1e-6)


def linearised(p, v, slip, torque_slope):
    """Rates at rest and eigenvalues of fluxes and slip, by finite differences.

    At fluxes ψ of the cages, stator and cages are three linear equations in three currents. ``torque_slope``: of the
    load's torque by the speed."""
    two = "R2" in p
    nested = p.get("IT", 1) == 2
    leakage = np.diag([p["X1"], p.get("X2", 1.0)]).astype(complex)
    if nested:
        leakage += p["X1"] * np.array([[0, 1], [1, 1]])
    R = np.array([p["R1"], p.get("R2", 0.0)])

    def currents(psi):
        M = np.zeros((3, 3), complex)
        M[0] = [p["RA"] + 1j * (p["XA"] + p["XM"]), -1j * p["XM"], -1j * p["XM"]]
        M[1:, 0] = p["XM"]
        M[1:, 1:] = -p["XM"] - leakage
        if not two:
            M[:2, 2], M[2] = 0, [0, 0, 1]
        return np.linalg.solve(M, [v, psi[0], psi[1] if two else 0])

    def rates(x):
        psi, s = x[:4].view(complex), x[4]
        i = currents(psi)
        d_psi = OMEGA_B * (R * i[1:] - 1j * s * psi)
        gap = p["XM"] * (i[0] - i[1] - i[2])
        torque = (np.conj(gap) * i[0]).imag
        d_s = (torque_0 + torque_slope * (slip - s) - torque) / (2 * p["H"])
        return np.array([*d_psi.view(float), d_s])

    s_drawn, torque_0 = drawn(p, slip, v)
    i_s = np.conj(s_drawn / v)
    across = v - (p["RA"] + 1j * p["XA"]) * i_s
    first = 1 / (p["R1"] / slip + 1j * p["X1"])
    i_1, i_2 = across * first, 0j
    if two and not nested:
        i_2 = across / (p["R2"] / slip + 1j * p["X2"])
    if nested:
        behind = across - 1j * p["X1"] * across / branches(p, slip)
        i_1, i_2 = behind * slip / p["R1"], behind / (p["R2"] / slip + 1j * p["X2"])
    psi = R * np.array([i_1, i_2]) / (1j * slip)
    at = np.array([*psi.view(float), slip])
    states = range(5) if two else (0, 1, 4)
    step = 1e-6
    columns = [(rates(at + step * u) - rates(at - step * u)) / (2 * step) for u in np.eye(5)]
    whole = np.array(columns).T[np.ix_(states, states)]
    return rates(at)[list(states)], np.linalg.eigvals(whole)


@pytest.mark.parametrize("cages", CAGES)
def test_its_eigenvalues_are_those_of_its_circuits_differential_equations(cages):
    device = motor(cages, D=0.0, B=1.0)
    slip = device.parameters["slip_0"]
    slope = device.outputs(BUS)["T_L"] / (1 - slip)
    at_rest, wanted = linearised(DATA | CAGES[cages], complex(*BUS), slip, slope)
    assert max(abs(at_rest)) < 1e-8
    ours = np.linalg.eigvals(device.blocks(BUS)[0])
    distance = np.abs(ours[:, None] - wanted) / (1 + np.abs(wanted))
    assert max(distance[linear_sum_assignment(distance)]) < 1e-6


def behind_line(device, bus, Z):
    """Eigenvalues of the motor behind a line at a stiff bus: v = v_∞ + Z·i closes the loop."""
    A, B, C, D = device.blocks(bus)
    names = [v.name for v in device.model.outputs]
    rows = [names.index("i_re"), names.index("i_im")]
    turn = np.array([[Z.real, -Z.imag], [Z.imag, Z.real]])
    C, D = C[rows], D[rows]
    columns = [[v.name for v in device.model.inputs].index(name) for name in ("v_re", "v_im")]
    B, D = B[:, columns], D[:, columns]
    return np.linalg.eigvals(A + B @ turn @ np.linalg.solve(np.eye(2) - D @ turn, C))


@pytest.mark.parametrize("name", andes.MOTORS)
def test_slip_and_eigenvalues_are_those_of_andes(name):
    peer, (_, p) = PEER[name], andes.MOTORS[name]
    (active, reactive), (size, angle) = peer["power"], peer["voltage"]
    values = {
        **{"RA": p["rs"], "XA": p["xs"], "XM": p["xm"], "R1": p["rr1"], "X1": p["xr1"]},
        **{"H": p["Hm"], "A": p["c3"], "B": p["c2"], "C0": p["c1"], "D": 0.0},
        "f_n": andes.FREQUENCY,
        **{"P_0": -active, "Q_0": -reactive, "v_0": size, "theta_0": angle},
    }
    device = Evaluated(MODEL, values)
    assert not refused(device)
    assert device.parameters["slip_0"] == pytest.approx(peer["slip"], rel=1e-5)
    assert device.parameters["B_shunt"] == pytest.approx(0, abs=1e-5)
    bus = [size * np.cos(angle), size * np.sin(angle)]
    wanted = np.array([complex(*pair) for pair in peer["modes"]])
    ours = behind_line(device, bus, complex(andes.R, andes.X))
    distance = np.abs(ours[:, None] - wanted) / (1 + np.abs(wanted))
    assert max(distance[linear_sum_assignment(distance)]) < 1e-4


LAWS = {
    "CIM5, D = 2": ({"E": 2.0}, lambda w, w_0: (w / w_0) ** 2),
    "CIM6": (
        {"A": 0.3, "B": 0.2, "C0": 0.1, "D": 0.4, "E": 1.5},
        lambda w, w_0: (
            (0.3 * w**2 + 0.2 * w + 0.1 + 0.4 * w**1.5)
            / (0.3 * w_0**2 + 0.2 * w_0 + 0.1 + 0.4 * w_0**1.5)
        ),
    ),
    "CIMW": (
        {"A": 0.3, "B": 0.2, "C0": 99.0, "C0_of_start": 1.0, "D": 0.4, "E": 1.5},
        lambda w, w_0: 1 + 0.3 * (w**2 - w_0**2) + 0.2 * (w - w_0) + 0.4 * (w**1.5 - w_0**1.5),
    ),
}


@pytest.mark.parametrize("law", LAWS)
def test_the_load_brakes_by_its_law(law):
    values, wanted = LAWS[law]
    device = motor(**values)
    w_0, torque = device.states["w"], device.outputs(BUS)["T_L"]
    for w in (0.5, 0.9, 1.02):
        found = device.outputs(BUS, device.vector(device.states | {"w": w}))["T_L"]
        assert found == pytest.approx(torque * wanted(w, w_0)), w


def test_a_load_without_torque_is_refused():
    assert any("give no torque" in text for text in refused(motor(D=0.0)))


@pytest.mark.parametrize("power", [-3.0, 4.0])
def test_a_power_beyond_the_pull_out_point_is_refused(power):
    assert any("pull-out point" in text for text in refused(motor(P_0=power)))


def test_the_power_at_the_pull_out_point_is_where_refusals_begin():
    """The most power of the circuit by its own curve: just below it the motor starts, just above not."""
    slips = np.geomspace(1e-3, 1.0, 20001)
    most = max(drawn(DATA, slip, 1.02)[0].real for slip in slips)
    assert not refused(motor(P_0=-0.999 * most))
    assert refused(motor(P_0=-1.001 * most))


def tripped_at(v, **values):
    """Time [s] at which a motor's port opens after its voltage has fallen; None if it does not."""
    device = motor(VI=0.7, TI=6.0, TB=3.0, **values)
    found, _ = integrated(device, lambda t: [v, 0.0], 0.4, step=1e-3)
    opened = [k for k, out in enumerate(found) if out["y_re"] == out["y_im"] == 0]
    return (opened[0] + 1) * 1e-3 if opened else None


def test_the_relay_opens_after_its_cycles_and_stays_open():
    assert tripped_at(0.69) == pytest.approx((6 + 3) / 60, abs=5e-3)
    assert tripped_at(0.71) is None
    assert tripped_at(0.1, f_n=50.0) == pytest.approx(9 / 50, abs=5e-3)
    device = motor(VI=0.7, TI=6.0, TB=3.0)
    back = integrated(device, lambda t: [0.2 if t < 0.16 else 1.0, 0.0], 0.5, step=1e-3)[0]
    assert back[-1]["y_im"] == 0
    short = integrated(device, lambda t: [0.2 if t < 0.09 else 1.0, 0.0], 0.5, step=1e-3)[0]
    assert short[-1]["y_im"] != 0


def test_without_a_voltage_of_the_relay_it_never_opens():
    device = motor(TI=0.0, TB=0.0)
    found, _ = integrated(device, lambda t: [0.05, 0.0], 0.5, step=1e-3)
    assert found[-1]["y_im"] != 0


def test_a_motor_that_is_cut_off_comes_to_a_standstill_and_not_beyond():
    device = motor(connected=0.0)
    found, x = integrated(device, lambda t: BUS, 4.0, step=1e-3)
    assert found[-1]["speed"] == pytest.approx(0, abs=1e-6)
    assert found[-1]["p"] == 0
    assert np.isfinite(x).all()


# -- by reactances ----------------------------------------------------------------------------------


def by_reactances(p):
    """Reactances and time constants of a circuit: what a test at the open stator would show."""
    one = p["XM"] * p["X1"] / (p["XM"] + p["X1"])
    found = {"RA": p["RA"], "Xl": p["XA"], "X": p["XA"] + p["XM"], "Xp": p["XA"] + one}
    found["Tp"] = (p["XM"] + p["X1"]) / (OMEGA_B * p["R1"])
    if "R2" in p:
        found["Xpp"] = p["XA"] + one * p["X2"] / (one + p["X2"])
        found["Tpp"] = (p["X2"] + one) / (OMEGA_B * p["R2"])
    return found


@pytest.mark.parametrize("power", [0.7, -0.7])
@pytest.mark.parametrize("cages", ["one", "two beside each other"])
def test_a_generator_by_its_reactances_is_its_circuit(cages, power):
    p = DATA | CAGES[cages]
    values = by_reactances(p) | {"H": p["H"], "f_n": 60.0, "E": 0.0} | AT | {"P_0": power}
    device = Evaluated(GENERATOR, values)
    assert not refused(device)
    assert max(map(abs, device.rates(BUS).values())) < 1e-8
    slip, found = device.parameters["slip_0"], device.outputs(BUS)
    s, across = drawn(p, slip, complex(*BUS))
    assert (s.real, across) == pytest.approx((-power, found["T_e"]))
    assert (found["p"], found["q"]) == pytest.approx((power, AT["Q_0"]))
    _, wanted = linearised(p, complex(*BUS), slip, 0.0)
    ours = np.linalg.eigvals(device.blocks(BUS)[0])
    distance = np.abs(ours[:, None] - wanted) / (1 + np.abs(wanted))
    assert max(distance[linear_sum_assignment(distance)]) < 1e-6


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"X": 0.15}, "X must exceed Xp"),
        ({"Xl": 0.2}, "Xp must exceed Xl"),
        ({"Xpp": 0.19, "Tpp": 0.02}, "Xp must exceed Xpp, or write Tpp = 0"),
        ({"Xpp": 0.05, "Tpp": 0.02}, "Xpp must exceed Xl, or write Tpp = 0"),
    ],
)
def test_reactances_that_are_of_no_circuit_are_refused(values, rule):
    assert any(rule in text for text in refused(Evaluated(GENERATOR, AT | values)))


RECORD = "9 '{name}' 1 1.2 0.02 1.5 4.0 0.2 0.15 0.1 1.0 0.1 1.2 0.4 2 -0.5 /\n"


@pytest.mark.parametrize(("name", "power"), [("CIMTR1", -1.0), ("CIMTR3", -1.0)])
def test_a_generators_record_keeps_its_power_constant(name, power, tmp_path):
    found = parameters(name, tmp_path)
    assert "E" not in found
    device = Evaluated(GENERATOR, found | {"P_0": 0.7})
    w = device.states["w"]
    moved = device.rates([1.0, 0.0], device.vector(device.states | {"w": 1.1 * w}))["w"]
    torque = device.outputs([1.0, 0.0])["T_e"]
    assert moved == pytest.approx(torque * (1 - 1.1**power) / (2 * 1.5))


@pytest.mark.parametrize("name", ["CIMTR2", "CIMTR4"])
def test_a_motors_record_has_the_torque_of_its_load(name, tmp_path):
    found = parameters(name, tmp_path)
    wanted = {"Tp": 1.2, "Tpp": 0.02, "H": 1.5, "X": 4.0, "Xp": 0.2, "Xpp": 0.15, "Xl": 0.1}
    assert found == wanted | {"E": 2.0, "RA": 0.01}


def parameters(name, folder):
    """Parameters that a record sets, and the resistance of ZSORCE."""
    assert INDUCTION_RECORDS[name].part == "induction_generator_phasor"
    (folder / "wind.dyr").write_text(RECORD.format(name=name))
    machine = Machine(9, "1", 1, 70.0, 1.0, 100.0, 0.01 + 0.15j, -100.0, 100.0)
    (model,) = machine_models(read_dyr(folder / "wind.dyr"), [machine]).values()
    assert model.converter == "induction_generator_phasor"
    return dict(model.parameters)
