"""A phasor model that runs in long steps sees a jump of the voltage late: that is no error of the model."""

import re

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor
from orchestrator.core.errors import ComponentError
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.view import parts

S_N = 200.0  # rating [MVA]
JUMP, LENGTH, STEP = 1.0, 2.0, 5e-5  # [s]
LIMITS = """
source = "made up"

[windows.during.q]
max_error = 0.06
"""


def droop_at(times, voltage, droop_f=0.05):
    """The equations of `gfor_phasor` by Euler's steps: P-f and Q-V droop behind the transformer."""
    impedance, droop_v, lag = 0.002 + 0.15j, 0.067, 0.1
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


def dip():
    """To 0.8 pu at once."""
    times = np.arange(0.0, LENGTH, STEP)
    return times, np.where(times < JUMP - STEP / 2, 1.0, 0.8)


def swing():
    """Of the grid: magnitude and angle move without any jump."""
    times = np.arange(0.0, 2 * LENGTH, STEP)
    since = np.clip(times - JUMP, 0, None)
    wave = np.sin(2 * np.pi * 0.8 * since)
    magnitude = 1 - 0.03 * wave * np.exp(-since)
    return times, magnitude * np.exp(0.15j * wave * np.exp(-0.5 * since))


def recording(plant, seed=1):
    times, voltage, power = (values[::20] for values in plant)  # 1 ms
    random = np.random.default_rng(seed)
    noise = 0.1 * random.standard_normal((2, len(times)))
    measured = S_N * np.stack([power.real, power.imag]) + noise
    columns = {
        "v_pu": np.abs(voltage),
        "angle_deg": np.rad2deg(np.angle(voltage)),
        "p_mw": measured[0],
        "q_mvar": measured[1],
    }
    return pd.DataFrame(columns, pd.Index(times.round(6), name="time"))


def judged(step, limits):
    found = gfor.validate(
        "gfor_phasor",
        recording(droop_at(*dip())),
        values={"S_n": S_N},
        step=step,
        limits=str(limits),
    )
    windows = {one["name"]: one for one in found.as_json()["events"][0]["windows"]}
    return found.verdict, windows["during"]["q"]


def test_what_a_long_step_makes_of_a_jump_does_not_accuse_the_model(tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text(LIMITS)
    verdict, fine = judged("100 us", limits)
    assert verdict == "met"
    verdict, coarse = judged("1 ms", limits)
    assert verdict == "met"
    assert coarse["max_error_pu"] < 1.5 * fine["max_error_pu"]


def test_a_step_so_long_that_it_shows_a_jump_late_is_counted_as_a_doubt(tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text(LIMITS)
    _, fine = judged("100 us", limits)
    verdict, coarse = judged("10 ms", limits)
    assert coarse["max_error_pu"] > 2 * fine["max_error_pu"]
    assert coarse["max_of_noise_pu"] > 0.5 * coarse["max_error_pu"]
    assert verdict != "not met"


def test_a_verdict_that_a_long_step_leaves_open_names_a_step_that_closes_it(tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text(LIMITS.replace("0.06", "0.02"))

    def found(step):
        frame = recording(droop_at(*dip()))
        return gfor.validate(
            "gfor_phasor", frame, values={"S_n": S_N}, step=step, limits=str(limits)
        )

    coarse = found("10 ms")
    assert coarse.verdict == "open"
    (criterion,) = coarse.as_json()["criteria"]
    assert criterion["why_open"] == "step"
    (typed,) = re.findall(r"give --step '([^']*)'", str(next(iter(parts(coarse)))))
    assert found(typed).verdict == "met"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_fit_in_long_steps_finds_the_plants_droop_within_its_interval(seed):
    """A voltage that is held from a step's begin comes half a step late, and more than the interval is that worth."""
    frame = recording(droop_at(*swing(), droop_f=0.048), seed)
    rows = {
        step: gfor.validate(
            "gfor_phasor", frame, values={"S_n": S_N}, step=step, fit="droop.R_f"
        ).fitted()
        for step in ("100 us", "1 ms")
    }
    fine, coarse = rows["100 us"], rows["1 ms"]
    assert coarse.low.item() <= 0.048 <= coarse.high.item()
    assert coarse.value.item() == pytest.approx(fine.value.item(), abs=1e-5)


def refuse_other_steps(monkeypatch, allowed):
    """Let devices refuse each communication step but these [s], as a vendor's DLL with a fixed one does."""
    play = PlayedDevice.play

    def picky(device, recording, start):
        if not any(np.isclose(device.step_size, one) for one in allowed):
            said = f"only steps of {allowed} s"
            raise ComponentError(device.name, "fmi2DoStep", "error", said, 0.0)
        return play(device, recording, start)

    monkeypatch.setattr(PlayedDevice, "play", picky)


def open_limit(step, tmp_path, most="0.02"):
    limits = tmp_path / "limits.toml"
    limits.write_text(LIMITS.replace("0.06", most))
    frame = recording(droop_at(*dip()))
    return gfor.validate("gfor_phasor", frame, values={"S_n": S_N}, step=step, limits=str(limits))


def test_a_device_that_refuses_half_its_step_is_doubted_by_twice_the_step(tmp_path, monkeypatch):
    free = open_limit("10 ms", tmp_path).as_json()["events"][0]["windows"][1]["q"]
    refuse_other_steps(monkeypatch, (0.01, 0.02))
    found = open_limit("10 ms", tmp_path)
    fixed = found.as_json()["events"][0]["windows"][1]["q"]
    assert 0.3 < fixed["max_of_noise_pu"] / free["max_of_noise_pu"] < 3
    assert found.verdict == "open"
    (criterion,) = found.as_json()["criteria"]
    assert criterion["why_open"] == "fixed step"
    first = str(next(iter(parts(found))))
    assert "refuses a shorter one" in first
    assert "--step" not in first  # no remedy that the device refuses


def test_a_device_that_takes_one_step_alone_is_compared_and_its_doubt_said_to_be_unknown(
    tmp_path, monkeypatch
):
    refuse_other_steps(monkeypatch, (0.01,))
    found = open_limit("10 ms", tmp_path, most="10")  # met by far, but for the doubt
    (event,) = found.as_json()["events"]
    assert event["windows"][1]["q"]["max_error_pu"] > 0
    (question,) = [one for one in event["questions"] if one["kind"] == "doubt unknown"]
    assert question["keeps_open"]
    assert found.verdict == "open"
