"""A phasor model that runs in long steps sees a jump of the voltage late: that is no error of the model."""

import numpy as np
import pandas as pd

import orchestrator as gfor

S_N = 200.0  # rating [MVA]
JUMP, LENGTH, STEP = 1.0, 2.0, 5e-5  # [s]
LIMITS = """
source = "made up"

[windows.during.q]
max_error = 0.06
"""


def droop_at_a_dip():
    """The equations of `gfor_phasor` by Euler's steps: P-f and Q-V droop behind the transformer, at a dip to 0.8 pu."""
    impedance, droop_f, droop_v, lag = 0.002 + 0.15j, 0.05, 0.067, 0.1
    times = np.arange(0.0, LENGTH, STEP)
    voltage = np.where(times < JUMP - STEP / 2, 1.0, 0.8)
    start = 0.5 + 0.0j
    emf = 1.0 + impedance * start.conjugate()
    reference = filtered = emf * start
    theta, level = np.angle(emf), abs(emf)
    power = np.empty(len(times), complex)
    for k, v in enumerate(voltage):
        emf = (level + droop_v * (reference - filtered).imag) * np.exp(1j * theta)
        current = (emf - v) / impedance
        power[k] = v * current.conjugate()
        theta += STEP * 100 * np.pi * droop_f * (reference - filtered).real
        filtered += STEP / lag * (emf * current.conjugate() - filtered)
    return times, voltage, power


def recording():
    times, voltage, power = (values[::20] for values in droop_at_a_dip())  # 1 ms
    random = np.random.default_rng(1)
    noise = 0.1 * random.standard_normal((2, len(times)))
    measured = S_N * np.stack([power.real, power.imag]) + noise
    zero = np.zeros_like(times)
    columns = {"v_pu": voltage, "angle_deg": zero, "p_mw": measured[0], "q_mvar": measured[1]}
    return pd.DataFrame(columns, pd.Index(times.round(6), name="time"))


def judged(step, limits):
    found = gfor.validate(
        "gfor_phasor", recording(), values={"S_n": S_N}, step=step, limits=str(limits)
    )
    windows = {one["name"]: one for one in found.as_json()["events"][0]["windows"]}
    return found.verdict, windows["during"]["q"]


def test_what_a_long_step_makes_of_a_jump_does_not_accuse_the_model(tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text(LIMITS)
    verdict, fine = judged("100 us", limits)
    assert verdict == "met"
    verdict, coarse = judged("1 ms", limits)
    assert coarse["max_error_pu"] > 2 * fine["max_error_pu"]
    assert coarse["max_of_noise_pu"] > 0.5 * coarse["max_error_pu"]
    assert verdict != "not met"
