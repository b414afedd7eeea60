"""An event that the recorder's filter has smoothed leaves no verdict; a plant's own slow event is none."""

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.smoothed import ask_of_smoothing
from orchestrator.studies.validation.windows import find_windows
from tests.studies.validation.test_early_event import SLOW, dip
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
BEGIN = 3.0  # of the event [s]
TIMES = np.arange(0.0, 10.0, 1e-3)


def table(voltage, power=0j):
    """A recording of good instruments, every millisecond, of a voltage [pu] and a power's movement [MVA]."""
    random = np.random.default_rng(1)
    noise = np.array([2e-5, 1e-3, 0.03, 0.03])[:, None] * random.standard_normal((4, len(TIMES)))
    columns = {
        "v_pu": np.abs(voltage) + noise[0],
        "angle_deg": np.rad2deg(np.unwrap(np.angle(voltage))) + noise[1],
        "p_mw": 50 + np.real(power) + noise[2],
        "q_mvar": np.imag(power) + noise[3],
    }
    return pd.DataFrame(columns, pd.Index(TIMES.round(6), name="time"))


def step_and_swing(size=0.02, swing=0.1, hertz=0.6):
    """A voltage that steps and then swings, as a trip of a line far away makes it."""
    since = np.clip(TIMES - BEGIN, 0, None)
    wave = np.exp(-0.3 * since) * np.sin(2 * np.pi * hertz * since)
    return (1 - size * (since > 0)) * np.exp(-1j * (size * (since > 0) + swing * wave))


def low_passed(frame, hertz=2.0):
    """All columns behind a low-pass filter of second order without phase lag."""
    filters = scipy_signal.butter(2, hertz, fs=1e3)
    return frame.apply(lambda column: scipy_signal.filtfilt(*filters, column), raw=True)


def means(frame, every):
    return frame.groupby(np.arange(len(frame)) // every).mean().set_index(frame.index[::every])


def asked(frame):
    recording = read_recording(frame.to_xarray(), "made", PortBases(100.0, 50.0))
    windows = find_windows(recording)
    assert windows.seen
    return ask_of_smoothing(recording, windows)


@pytest.mark.parametrize("every", [1, 20, 50])
@pytest.mark.parametrize("hertz", [2.0, 2.5, 3.0])
def test_a_step_behind_a_low_pass_filter_is_asked_about_with_its_frequency(hertz, every):
    (question,) = asked(low_passed(table(step_and_swing()), hertz).iloc[::every])
    assert question.kind is QuestionKind.SMOOTHED
    assert question.keeps_open
    assert question.figures["hertz"] == pytest.approx(hertz, rel=0.3)


@pytest.mark.parametrize("every", [1, 20, 50, 100])
@pytest.mark.parametrize("size", [0.005, 0.02, 0.1])
def test_neither_samples_nor_means_of_a_step_and_a_swing_are_smoothed(size, every):
    frame = table(step_and_swing(size))
    assert not asked(frame.iloc[::every])
    assert not asked(means(frame, every))


@pytest.mark.parametrize("every", [1, 20, 50])
@pytest.mark.parametrize("hertz", [0.3, 0.6, 1.2, 2.0])
def test_a_swing_without_a_step_is_not_smoothed(hertz, every):
    assert not asked(table(step_and_swing(0.0, hertz=hertz)).iloc[::every])


@pytest.mark.parametrize("every", [1, 20])
@pytest.mark.parametrize("name", SLOW)
def test_a_slow_event_of_the_grid_is_not_smoothed(name, every):
    voltage = SLOW[name](np.clip(TIMES - BEGIN, 0, None)) * np.ones(len(TIMES), complex)
    assert not asked(table(voltage).iloc[::every])


@pytest.mark.parametrize("every", [1, 20, 50])
@pytest.mark.parametrize("at", [0.4, 3.0])
def test_a_dip_is_not_smoothed(at, every):
    assert not asked(table(dip(at)(TIMES)).iloc[::every])


def test_a_filter_that_hides_a_wrong_model_leaves_no_verdict(tmp_path):
    """The plant's P rests, and the model's answers the step: a limit that it breaks is met behind the filter."""
    limits = tmp_path / "limits.toml"
    limits.write_text('source = "mine"\n[windows.during.p]\nmean_abs_error = 0.01\n')
    whole = table(step_and_swing())
    found = [
        gfor_in_python.validate(
            "gfor_phasor", frame, values={"S_n": 100.0}, limits=limits, step="1 ms"
        )
        for frame in (whole, low_passed(whole).iloc[::50])
    ]
    assert [one.verdict for one in found] == ["not met", "open"]
    assert [one.verdict for one in found[1].result.criteria] == ["met"]
