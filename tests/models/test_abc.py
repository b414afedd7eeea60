"""The converter with instantaneous phase quantities against the one with v_re and v_im, on the same grid voltage."""

from contextlib import ExitStack

import numpy as np
import pytest

from fmus.toolchain.frames import Phasor, of_phases, phases
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

OMEGA_B = 2 * np.pi * 50
S_N, V_N = 1500.0, 230.0
VOLT = V_N * 1e3 * np.sqrt(2 / 3)
AMPERE = S_N / V_N * 1e3 * np.sqrt(2 / 3)
STEP = 1e-4
SIGNALS = ("omega", "delta_p_pod", "delta_q_pod", "u", "i_s")
START = {
    "P_0": 0.9,
    "Q_0": 0.05,
    "v_0": 1.0,
    "theta_0": 0.3,
    "pod_p.enabled": True,
    "pod_q.enabled": True,
}
START_VOLTAGE = np.exp(0.3j)


def after(time, change):
    """A voltage relative to the one at the start: 1 until a time."""
    return lambda t: change(t - time) if t >= time else 1.0


VOLTAGES = {
    "balanced": lambda t: 1.0,
    "dip": after(0.1, lambda t: 0.95 * np.exp(-0.01j) if t < 0.15 else 1.0),
    "frequency deviation": after(0.1, lambda t: np.exp(1j * OMEGA_B * 2e-3 * t)),
    "load step": after(
        0.1, lambda t: 1 + 0.02 * np.exp(-0.5 * t) * (-np.cos(4 * t) / 2 + 1j * np.sin(4 * t))
    ),
    # 2 % of negative sequence: in the network frame it turns backwards at twice the frequency
    "unbalanced": after(0.1, lambda t: 1 + 0.02 * np.exp(-2j * OMEGA_B * t)),
}


def three_phases(phasor, time, zero=0.0):
    """Instantaneous values of a phasor in the network frame, phase a first, with a zero sequence."""
    turned = phasor * np.exp(1j * OMEGA_B * time)
    return [(turned * np.exp(-2j * np.pi / 3 * k)).real + zero for k in range(3)]


def start(release, path, values, inputs):
    device = release.enter_context(LoadedComponent("device", read_description(path)))
    device.set(values)
    device.setup(0.0, None)
    device.enter_initialization_mode()
    device.set(inputs)
    device.exit_initialization_mode()
    return device


def of_the_phases(values):
    return dict(zip(("v_a", "v_b", "v_c"), np.array(values) * VOLT, strict=True))


@pytest.fixture
def pair(fmu_path):
    """The variant with a complex port, and the one with phases, at the same operating point."""
    with ExitStack() as release:
        at_start = {"v_re": START_VOLTAGE.real, "v_im": START_VOLTAGE.imag}
        yield (
            start(release, fmu_path("gfor"), START, at_start),
            start(
                release,
                fmu_path("gfor_abc"),
                START,
                of_the_phases(three_phases(START_VOLTAGE, 0.0)),
            ),
        )


@pytest.mark.parametrize("voltage", VOLTAGES.values(), ids=VOLTAGES)
def test_both_variants_give_the_same_currents(voltage, pair):
    """Within what rounding of the frame's angle can do.

    φ grows by ω_b·H a step and is rounded to half a unit in the last place of ω_b·t, 7.1e-15 rad at 0.4 s: to the
    converter that is a frequency wrong by 7.1e-15/(ω_b·H) = 2.3e-13. Droop and POD-P answer with 1/R_f + K = 220 times
    that, and POD-Q with 200·R_V = 13 times in voltage, which the reactance of 0.15 turns into 100 times in current.
    All begins at 0.1 s; a longer run rounds more, and would hide more.
    """
    complex_port, phase_port = pair
    end, worst = 0.4, 0.0
    tolerance = (220 + 100) * np.spacing(OMEGA_B * end) / 2 / (OMEGA_B * STEP)
    assert tolerance < 8e-11
    for k in range(round(end / STEP)):
        time, v = k * STEP, START_VOLTAGE * voltage(k * STEP)
        complex_port.set({"v_re": v.real, "v_im": v.imag})
        phase_port.set(of_the_phases(three_phases(v, time, zero=0.1)))
        for device in pair:
            device.step(time, STEP)
        wanted = complex_port.get(["i_re", "i_im", *SIGNALS])
        found = phase_port.get(["i_a", "i_b", "i_c", *SIGNALS])
        i = complex(wanted["i_re"], wanted["i_im"]) * 100 / S_N
        currents = np.array([found[f"i_{phase}"] for phase in "abc"]) / AMPERE
        worst = max(worst, np.abs(currents - three_phases(i, time + STEP)).max())
        worst = max(worst, *(abs(found[s] - wanted[s]) for s in SIGNALS))
    assert abs(i) > 0.5
    assert worst < tolerance


def test_powers_are_in_megawatts_and_those_of_the_phases(pair):
    complex_port, phase_port = pair
    phase_port.set(of_the_phases(three_phases(START_VOLTAGE, 0.0)))
    found = phase_port.get(["p", "q", "i_a", "i_b", "i_c"])
    assert (found["p"], found["q"]) == pytest.approx((0.9 * S_N, 0.05 * S_N), rel=1e-12)
    volts = of_the_phases(three_phases(START_VOLTAGE, 0.0))
    instantaneous = sum(volts[f"v_{x}"] * found[f"i_{x}"] for x in "abc") / 1e6
    assert instantaneous == pytest.approx(0.9 * S_N, rel=1e-12)  # balanced: the same at any instant
    assert complex_port.get(["p"])["p"] == pytest.approx(0.9, rel=1e-12)


def test_phase_voltages_held_as_they_are_would_err_by_half_a_step_of_the_frame(fmu_path):
    """What the held angle avoids: within a step the voltage's image turns back by ω_b·H."""
    parts, lag = 10, OMEGA_B * STEP / 2
    with ExitStack() as release:
        values = {"P_0": 0.9, "Q_0": 0.05, "theta_0": -lag, "internal_step": STEP / parts}
        device = start(
            release, fmu_path("gfor"), values, {"v_re": np.cos(lag), "v_im": -np.sin(lag)}
        )
        for k in range(3000):
            for part in range(parts):
                v = np.exp(-1j * OMEGA_B * (part + 0.5) * STEP / parts)
                device.set({"v_re": v.real, "v_im": v.imag})
                device.step(k * STEP + part * STEP / parts, STEP / parts)
        i = device.get(["i_re", "i_im"])
    error = abs(complex(i["i_re"], i["i_im"]) * 100 / S_N - (0.9 - 0.05j))
    assert error == pytest.approx(0.9 * lag, rel=0.05)  # 1.4 % of the rated current at 100 µs


def test_a_run_goes_on_from_a_saved_state_with_the_same_phase(pair):
    _, device = pair

    def advance(first, count):
        rows = []
        for k in range(first, first + count):
            device.set(of_the_phases(three_phases(START_VOLTAGE * (1 + 1e-3j * k), k * STEP)))
            device.step(k * STEP, STEP)
            rows.append(list(device.get(["i_a", "i_b", "i_c", "omega", "frame.angle"]).values()))
        return rows

    advance(0, 10)
    saved = device.save_state()
    try:
        once = advance(10, 10)
        device.restore_state(saved)
        assert advance(10, 10) == once
    finally:
        device.free_state(saved)
    assert once[-1][-1] == pytest.approx(20 * OMEGA_B * STEP, rel=1e-14)


def test_the_frame_may_start_at_any_angle(fmu_path):
    """A start at t ≠ 0, or a phase a that is a sine: ``angle_0``."""
    with ExitStack() as release:
        turned = start(
            release,
            fmu_path("gfor_abc"),
            {"angle_0": -np.pi / 2, "theta_0": 0.3, "P_0": 0.9},
            of_the_phases(three_phases(np.exp(1j * (0.3 - np.pi / 2)), 0.0)),
        )
        found = turned.get(["p", "q", "i_a"])
        assert (found["p"], found["q"]) == pytest.approx((0.9 * S_N, 0.0), abs=1e-9)
        assert found["i_a"] == pytest.approx(0.9 * AMPERE * np.cos(0.3 - np.pi / 2), rel=1e-12)


def loops_at(s, resistance):
    """Current into the converter for 1 pu at its bus, at s in its frame [rad/s], from the loops' equations alone."""
    X_c, R_c, B_c, X_t, R_t = 0.15, 0.005, 0.15, 0.15, 0.002
    R_cap, tau_v, xi, tau_i, lag = 1 / (30 * B_c), 0.05, 0.707, 1e-3, 1 / (1 + 1e-4 * s)
    omega_n, C_c, turn = 4 / (tau_v * xi), B_c / OMEGA_B, s / OMEGA_B + 1j
    voltage = 2 * xi * omega_n * C_c * 100 + omega_n**2 * C_c / s
    current = X_c / OMEGA_B / tau_i + R_c / tau_i / s
    # unknowns: i_s, u_c, i_g, u, the bridge's voltage; the negative sequence is told from i_g without error at s = −2jω
    rows = [
        [R_c + X_c * turn, 0, 0, 1, -1],
        [-1, B_c * turn, 1, 0, 0],
        [0, 0, R_t + X_t * turn, -1, 0],
        [-R_cap, -1, R_cap, 1, 0],
        [
            current - 1j * X_c,
            0,
            current * (voltage * resistance - lag),
            current * (voltage - 1j * B_c) - lag,
            1,
        ],
    ]
    return -np.linalg.solve(np.array(rows), np.array([0, 0, -1, 0, 0]))[2]


@pytest.mark.parametrize("resistance", [0.0, 0.5, 1.0])
def test_the_negative_sequence_meets_the_loops_and_the_resistance(resistance, fmu_path):
    """2 % of it at a stiff bus, against the linear equations of the loops at −2ω in the converter's frame.

    The droops are left out there: their filter of 0.1 s lets through 1.6 % of the swing of P and Q at 100 Hz."""
    steps, look = 12000, 2000
    with ExitStack() as release:
        device = start(
            release,
            fmu_path("gfor_abc"),
            {"P_0": 0.5, "negative_sequence.R": resistance},
            of_the_phases(three_phases(1.0, 0.0)),
        )
        volts, amperes = [], []
        for k in range(steps):
            v = 1 + 0.02 * np.exp(-2j * OMEGA_B * (k + 0.5) * STEP)
            device.set(of_the_phases(three_phases(v, k * STEP)))
            device.step(k * STEP, STEP)
            volts.append(v)
            found = device.get(["i_a", "i_b", "i_c"])
            space = np.exp(2j * np.pi / 3 * np.arange(3)) @ list(found.values()) * 2 / 3 / AMPERE
            amperes.append(space * np.exp(-1j * OMEGA_B * (k + 1) * STEP))
    at = (np.arange(steps) + 0.5)[-look:] * STEP
    v, i = (
        np.mean(np.array(x)[-look:] * np.exp(2j * OMEGA_B * time))
        for x, time in ((volts, at), (amperes, at + STEP / 2))
    )
    assert -i / v == pytest.approx(loops_at(-2j * OMEGA_B, resistance), rel=0.01)


@pytest.mark.parametrize("angle", [0.0, 1.1, 300.0])
def test_phases_and_frame_are_each_others_inverse_and_the_zero_sequence_drops_out(angle):
    value = Phasor(0.7, -0.4)
    there = [float(x) for x in phases(value, angle)]
    assert sum(there) == pytest.approx(0, abs=1e-15)
    back = of_phases([x + 5.0 for x in there], angle)
    assert (float(back.re), float(back.im)) == pytest.approx((0.7, -0.4), abs=1e-14)
