"""Modes in noise against those of the systems that the noise shakes."""

import json

import numpy as np
import pytest

import orchestrator as gfor_api
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.signals.ambient import ambient_modes
from tests.support.forced_records import model, record, sine, times_of

pytestmark = pytest.mark.usefixtures("undrawn")


def shaken(modes, length=120.0, seed=0, rate=20.0):
    """Two signals of modes (Hz, %) that white noise shakes, with opposite signs in the second mode."""
    t, rng = times_of(length, rate), np.random.default_rng(seed)
    values = np.zeros((len(t), 2))
    for k, (frequency, percent) in enumerate(modes):
        w, d = 2 * np.pi * frequency, percent / 100
        pole = np.exp((-d + 1j * np.sqrt(1 - d * d)) * w / rate)
        white, z = (
            rng.standard_normal((len(t), 2)) @ np.array([1, 1j]),
            np.zeros(len(t) + 200, complex),
        )
        for n in range(len(z) - 1):
            z[n + 1] = pole * z[n] + white[n % len(t)]
        one = z[200:].real / z.real.std()
        values += one[:, None] * np.array([1.0, (-1.0) ** k])
    return t, values + 0.05 * rng.standard_normal(values.shape)


def test_two_modes_with_their_intervals_and_shapes():
    truth = ((0.5, 5.0), (1.2, 2.0))
    met = 0
    for seed in range(8):
        found = ambient_modes(*shaken(truth, seed=seed))
        for k, (frequency, percent) in enumerate(truth):
            one = min(found, key=lambda m: abs(m.frequency_hz - frequency))
            assert one.frequency_hz == pytest.approx(frequency, rel=0.05)
            assert one.damping_percent == pytest.approx(percent, abs=3.5)
            assert np.real(one.shape[0] * np.conj(one.shape[1])) * (-1.0) ** k > 0.2
            met += abs(one.damping_percent - percent) < one.damping_error_percent
    assert met >= 13


def windows(count, length):
    """Frequency [Hz] and damping [%] of the mode of the areas in windows with noise of loads, and how often in view."""
    found = []
    for seed in range(count):
        measured = record(
            "two_area", {}, times=times_of(length), loads=5e-3, measuring=5e-5, seed=seed
        )
        speeds = np.column_stack([np.gradient(p.angle, measured.interval) for p in measured.places])
        near = [
            m for m in ambient_modes(measured.times, speeds) if abs(m.frequency_hz - 0.58) < 0.1
        ]
        if near:
            one = min(near, key=lambda m: abs(m.frequency_hz - 0.58))
            found.append((one.frequency_hz, one.damping_percent, one.damping_error_percent))
    return np.array(found).T


def true_mode():
    (value,) = [v for v in model("two_area").eigenvalues if 0.5 < v.imag / 2 / np.pi < 0.7]
    return value.imag / 2 / np.pi, -100 * value.real / abs(value)


def test_a_few_windows_of_a_run_with_noise():
    (frequency, damping), (f, d, error) = true_mode(), windows(6, 120.0)
    assert len(f) >= 5
    assert f.mean() == pytest.approx(frequency, abs=0.02)
    assert d.mean() == pytest.approx(damping, abs=3.0)
    assert (np.abs(d - damping) < error).mean() >= 0.6


def test_a_hundred_windows_of_a_minute():
    """Bias and spread as in the guide."""
    (frequency, damping), (f, d, error) = true_mode(), windows(100, 60.0)
    assert len(f) >= 85
    assert abs(f.mean() - frequency) < 0.01
    assert -2.5 < d.mean() - damping < 0.5
    assert d.std() < 3.5
    assert (np.abs(d - damping) < error).mean() > 0.8


def csv(path, times, values):
    np.savetxt(
        path,
        np.column_stack([times, values]),
        delimiter=",",
        header="time [s],a.f,b.f",
        comments="",
    )
    return path


def test_alarms_over_windows(gfor, tmp_path):
    file = csv(tmp_path / "noise.csv", *shaken(((1.2, 1.0),), length=180.0))
    given = ("--ambient", "--window", "60 s", "--alarm", "5 %", "--out", tmp_path / "out")
    code, out, _ = gfor("signal", "identify", file, "a.f", "b.f", *given, "--json")
    said = json.loads(out)
    assert code == 0
    assert [round(w["start"]) for w in said["windows"]] == [0, 30, 60, 90, 120]
    alarms = [{m["alarm"] for m in w["modes"]} - {""} for w in said["windows"]]
    assert all(alarms)
    assert sum("below" in one for one in alarms) >= 4
    assert json.loads((tmp_path / "out" / "ambient.json").read_text()) == said
    assert {p.suffix for p in (tmp_path / "out").iterdir()} >= {".json", ".csv", ".png", ".html"}
    assert (
        gfor_api.ambient(file, ["a.f", "b.f"], window="60 s", level=5.0).as_json()["windows"]
        == said["windows"]
    )
    assert "surely below 5 %" in gfor("signal", "identify", file, "a.f", *given[:5])[1]


def test_a_well_damped_mode_raises_no_alarm():
    found = [m for seed in range(8) for m in ambient_modes(*shaken(((0.8, 12.0),), seed=seed))]
    assert not [m for m in found if m.damping_percent + m.damping_error_percent < 3]


def test_a_forced_oscillation_is_no_mode_without_damping(tmp_path):
    t, values = shaken(((0.5, 8.0),))
    found = gfor_api.ambient(
        csv(tmp_path / "f.csv", t, values + 1.5 * sine(t, 0.9, 1.0, begin=0.0)[:, None]), "a.f"
    )
    (one,) = [m for m in found.windows[0].modes if abs(m.frequency_hz - 0.9) < 0.02]
    assert found.alarm(one) == "forced"


def test_what_cannot_be_used_is_refused(gfor, tmp_path):
    t, values = shaken(((0.5, 5.0),), length=60.0)
    with pytest.raises(AnalysisError, match="without gaps"):
        ambient_modes(np.delete(t, slice(300, 320)), np.delete(values, slice(300, 320), axis=0))
    with pytest.raises(AnalysisError, match="too short"):
        ambient_modes(t[:100], values[:100])
    with pytest.raises(AnalysisError, match="constant"):
        ambient_modes(t, np.ones((len(t), 1)))
    file = csv(tmp_path / "noise.csv", t, values)
    for more, text in (
        (("--alarm", "3 %"), "--ambient"),
        (("--ambient", "--window", "90 s"), "shorter window"),
    ):
        code, _, error = gfor("signal", "identify", file, "a.f", *more)
        assert (code, text in error) == (2, True)
