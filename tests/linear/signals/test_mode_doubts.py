"""Modes of a signal that may be none of the system, planted one by one."""

import numpy as np
import pytest
import xarray as xr

import orchestrator as gfor
from orchestrator.output.results.comtrade.writing import write_comtrade


def swing(t, hertz, damping, size=1.0, phase=0.3):
    w = 2 * np.pi * hertz
    return size * np.exp(-damping / 100 * w * t) * np.cos(w * t + phase)


def found(y, start=0.0, stop=20.0, noise=0.0, step=0.01):
    t = np.arange(round(20.0 / step) + 1) * step
    values = 1.0 + y(t) + noise * np.random.default_rng(4).standard_normal(len(t))
    run = xr.Dataset(
        {"g.x": ("time", values, {"units": "pu"})},
        coords={"time": t},
        attrs={"scenario": "planted"},
    )
    return gfor.identify(run, "g.x", start, stop)


def measured(folder, y, noise=0.0, start=0.0, seed=4):
    """Of a recording with 50 samples a second."""
    t = np.arange(1001) * 0.02
    values = 50 + y(t) + noise * np.random.default_rng(seed).standard_normal(len(t))
    run = xr.Dataset({"F": ("time", values, {"units": "Hz"})}, coords={"time": t})
    return gfor.identify(write_comtrade(run, ["F"], folder / "rec.cfg")[0], "F", start)


def doubts(modes, hertz):
    return "; ".join(min(modes, key=lambda mode: abs(mode.frequency_hz - hertz)).doubts)


def test_clear_modes_are_not_in_doubt():
    modes = found(lambda t: swing(t, 0.6, 5) + swing(t, 1.1, 8, 0.5) + 0.3 * np.exp(-0.4 * t))
    assert doubts(modes, 0.6) == doubts(modes, 1.1) == ""
    assert not any("short" in text or "doubtful" in text for text in modes.remarks)


@pytest.mark.parametrize(("stop", "told"), [(2.6, True), (4.5, False)])
def test_a_window_needs_two_periods(stop, told):
    modes = found(lambda t: swing(t, 0.5, 5), stop=stop)
    assert ("periods of it" in doubts(modes, 0.5)) is told
    short = [text for text in modes.remarks if "is too short: it has 1.3 periods" in text]
    assert len(short) == told
    assert modes.as_json()[0]["doubts"] == list(modes.modes[0].doubts)


def test_the_record_that_two_close_modes_need_is_said():
    modes = found(lambda t: swing(t, 0.86, 2) + swing(t, 0.95, 2, 0.8), stop=6.0)
    (text,) = [text for text in modes.remarks if "tell two modes apart" in text]
    hertz = sorted(mode.frequency_hz for mode in modes if not modes.is_trend(mode))
    assert f"that lie {0.75 / (modes.stop - modes.start):.2g} Hz or more" in text
    assert f"need {0.75 / (hertz[1] - hertz[0]):.3g} s" in text


@pytest.mark.parametrize(("damping", "told"), [(30, False), (60, True)])
def test_a_damping_that_leaves_nothing_is_in_doubt(damping, told):
    modes = found(lambda t: swing(t, 0.6, 5) + swing(t, 1.1, damping))
    assert ("leaves next to nothing" in doubts(modes, 1.1)) is told


@pytest.mark.parametrize(("size", "told"), [(0.2, False), (0.01, True)])
def test_a_mode_without_energy_is_in_doubt(size, told):
    modes = found(lambda t: swing(t, 0.6, 5) + swing(t, 1.7, 5, size))
    assert ("of the energy of all oscillations" in doubts(modes, 1.7)) is told


def test_what_noise_makes_is_in_doubt_and_the_mode_is_not():
    modes = found(lambda t: swing(t, 0.6, 3), noise=0.02)
    assert doubts(modes, 0.6) == ""
    others = [m for m in modes if m.frequency_hz > 1.0]
    assert others
    assert all(m.doubts for m in others)
    assert any("a model of another order" in text for m in others for text in m.doubts)


def test_a_mode_that_is_there_for_a_part_of_the_window_only():
    """The order and the window decide what a swing that begins late looks like."""
    modes = found(lambda t: swing(t, 0.6, 3) + (t < 1.5) * 0.5 * np.sin(2 * np.pi * 2.3 * t))
    assert any(m.doubts for m in modes if 1.5 < m.frequency_hz < 4)


def test_compare_marks_what_it_doubts():
    t = np.arange(801) * 0.01
    runs = [
        xr.Dataset(
            {"g.x": ("time", swing(t, hertz, 4), {"units": "pu"})},
            coords={"time": t},
            attrs={"scenario": name},
        )
        for name, hertz in (("clear", 0.8), ("slow", 0.2))
    ]
    compared = gfor.compare(*runs, ["g.x"])
    clear, slow = compared.signals[0].modes
    assert (clear.doubts, len(slow.doubts) > 0) == ((), True)
    (text,) = compared.remarks
    assert text.startswith("? slow: g.x at 0.2 Hz is doubtful: the window has 1.2 periods of it")
    assert compared.as_json()[0]["modes"][1]["doubts"] == list(slow.doubts)


@pytest.mark.parametrize("slope", [-0.003, 0.01, 0.05, 0.5])
def test_a_trend_neither_hides_a_mode_nor_takes_its_energy(tmp_path, slope):
    """A straight line comes out as exponentials of huge amplitudes that cancel, or as a swing of 1000 s."""
    modes = measured(tmp_path, lambda t: slope * t + swing(t, 0.6, 5, 0.05))
    mode = min(modes, key=lambda m: abs(m.frequency_hz - 0.6))
    assert (mode.frequency_hz, mode.damping_percent) == (
        pytest.approx(0.6, abs=1e-3),
        pytest.approx(5, abs=0.1),
    )
    assert mode.doubts == ()
    said = [text for text in modes.remarks if "smaller modes may be hidden" in text]
    assert len(said) == (abs(slope) > 0.03)
    assert not said or f"drifts by {20 * slope:g} along a straight line" in said[0]


def test_a_curved_trend_does_not_take_a_modes_energy(tmp_path):
    assert doubts(measured(tmp_path, lambda t: -1e-3 * t**2 + swing(t, 0.6, 5, 0.05)), 0.6) == ""


def test_a_trend_is_named_and_not_taken_for_growth(tmp_path, gfor):
    modes = measured(tmp_path, lambda t: 0.01 * t + swing(t, 0.6, 5, 0.05), noise=0.0005, seed=0)
    trends = [m for m in modes if modes.is_trend(m)]
    assert trends
    assert all(abs(m.eigenvalue) < 0.05 for m in trends)
    assert not any("too short" in text or "doubtful" in text for text in modes.remarks)
    code, out, _ = gfor("signal", "identify", tmp_path / "rec.cfg", "F", "--start", 0)
    rows = [line for line in out.splitlines() if "j" in line]
    assert (code, sum("trend" in row and "100.00" not in row for row in rows)) == (0, len(trends))


def test_a_decay_and_growth_within_the_window_are_no_trends():
    for rate in (-0.4, 0.2):
        modes = found(lambda t, rate=rate: 0.1 * np.exp(rate * t))
        strongest = min(modes, key=lambda m: abs(m.eigenvalue - rate))
        assert not modes.is_trend(strongest)
        assert any(text.startswith("No oscillation above the noise") for text in modes.remarks)


def test_noise_alone_is_said_to_show_nothing(tmp_path):
    modes = measured(tmp_path, lambda t: 0 * t, noise=0.01, seed=0)
    assert (len(modes), modes.remarks[-1]) == (
        0,
        "Nothing above the noise: the window shows no mode.",
    )


def test_too_few_periods_are_not_rounded_to_enough():
    modes = found(lambda t: swing(t, 0.50005, 1), stop=3.99)
    assert "the window has 1.995 periods of it" in "; ".join(modes.modes[0].doubts)
    assert any("it has 1.995 periods of its strongest" in text for text in modes.remarks)


def test_the_amplitude_of_an_oscillation_is_half_of_its_peak_as_the_help_says(gfor):
    code, out, _ = gfor("signal", "identify", "--help")
    assert (code, "half of its peak" in " ".join(out.split())) == (0, True)
    assert found(lambda t: swing(t, 0.6, 5, 0.1)).modes[0].amplitude == pytest.approx(0.05)


def again(t, at, phase=1.5):
    """0.6 Hz with 5 %, excited at 0 s and once more."""
    return swing(t, 0.6, 5, 0.1) + np.where(
        t > at, swing(np.maximum(t - at, 0), 0.6, 5, 0.1, phase), 0
    )


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("start", [0.0, 2.0])
def test_a_second_disturbance_in_the_window_is_in_doubt(tmp_path, start, noise):
    """No model order shows it, as all of them fit one free response to two."""
    strongest = max(
        measured(tmp_path, lambda t: again(t, 10), noise, start=start), key=lambda m: m.amplitude
    )
    assert abs(strongest.eigenvalue - (-0.1887 + 3.77j)) > 0.05
    assert "half of the window shows 0.6" in "; ".join(strongest.doubts)
    assert any(
        "half of the window shows" in d
        for d in measured(tmp_path, lambda t: again(t, 6)).modes[0].doubts
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_lower_order_that_loses_a_mode_is_no_doubt_by_itself(tmp_path, seed):
    """Two modes with so much noise that a lower order has one of them only, or none."""
    both = measured(
        tmp_path, lambda t: swing(t, 0.4, 4, 0.1) + swing(t, 1.0, 4, 0.08, 0.5), 0.005, seed=seed
    )
    assert doubts(both, 0.4) == doubts(both, 1.0) == ""
    assert doubts(measured(tmp_path, lambda t: swing(t, 0.4, 4, 0.1), 0.02, seed=seed), 0.4) == ""


def test_a_mode_that_is_not_there_is_not_said_to_be_moved(tmp_path):
    """The nearest mode of a lower order may be another one."""
    modes = measured(tmp_path, lambda t: swing(t, 0.5, 5, 0.1) + swing(t, 1.2, 3, 0.03), 0.002)
    assert "moves it" not in "; ".join(d for m in modes for d in m.doubts if m.frequency_hz > 1)


def test_close_and_fast_modes_are_not_in_doubt_for_what_a_half_cannot_tell(tmp_path):
    close = measured(
        tmp_path, lambda t: swing(t, 0.5, 5, 0.1) + swing(t, 0.55, 4, 0.1, 2), 0.001, seed=1
    )
    assert "half of the window" not in doubts(close, 0.5) + doubts(close, 0.55)
    assert doubts(measured(tmp_path, lambda t: swing(t, 8, 2, 0.1)), 8) == ""
