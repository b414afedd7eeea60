"""Excitations and what is read from their responses, on a linear map whose response is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.black_box import frequency_response
from orchestrator.studies.black_box.frequency_response import (
    Excitation,
    _by_multisine,
    _drifts_evenly,
    line_response,
    multisine,
    odd_lines,
    pulse_response,
)

H = 1e-3
A = np.array([[0.97, 0.1], [-0.1, 0.95]])
B = np.array([0.2, 1.0])
C = np.array([[1.0, 0.3], [0.2, -0.5]])
PERIOD = 2000


def simulate(u, periods=1):
    """Outputs at the end of every step."""
    x, y = np.zeros(2), []
    for value in np.tile(u, periods):
        x = A @ x + B * value
        y.append(C @ x)
    return np.array(y)


def exact(frequencies):
    return np.array(
        [C @ np.linalg.solve(np.exp(2j * np.pi * f * H) * np.eye(2) - A, B) for f in frequencies]
    )


def test_the_lines_are_odd_distinct_and_reach_both_ends():
    lines = odd_lines(0.05, 1000.0, 120)
    assert (lines % 2 == 1).all()
    assert (np.diff(lines) > 0).all()
    assert lines[0] == 1
    assert lines[-1] * 0.05 == pytest.approx(1000.0, abs=0.1)
    assert 60 < len(lines) <= 120


def test_a_multisine_has_its_amplitude_equal_lines_and_nothing_else():
    lines = odd_lines(1 / (PERIOD * H), 200.0, 40)
    u = multisine(lines, PERIOD, 0.01)
    assert np.abs(u).max() == pytest.approx(0.01)
    spectrum = np.abs(np.fft.rfft(u))
    assert np.ptp(spectrum[lines]) < 1e-12 * spectrum.max()
    assert np.delete(spectrum, lines).max() < 1e-12 * spectrum.max()
    # as a sum in phase it would be the root of twice their number
    assert np.abs(u).max() / u.std() < 4


def test_both_ways_give_the_exact_response():
    lines = odd_lines(1 / (PERIOD * H), 400.0, 40)
    frequencies = lines / (PERIOD * H)
    u = multisine(lines, PERIOD, 1.0)
    by_lines = line_response(u, simulate(u, 3)[-PERIOD:], lines)
    pulse = np.zeros(PERIOD * 2)
    pulse[0] = 1.0
    by_pulse = pulse_response(simulate(pulse), frequencies, H)
    wanted = exact(frequencies)
    assert np.abs(by_lines - wanted).max() < 1e-10
    assert np.abs(by_pulse - wanted).max() < 1e-10


@pytest.mark.parametrize(
    ("course", "even"),
    [
        (lambda k: 7e-5 * k, True),
        (lambda k: 1e-2 * k, False),
        (lambda k: 0.02 * np.exp(-k / 8), False),
        (lambda k: 1e-3 * np.exp(k / 5 - 8), False),
    ],
)
def test_only_a_small_change_at_one_rate_is_a_drift(course, even):
    """The response of a battery follows its charge; what dies away, grows or changes much is not measured."""
    found = [np.full((3, 2), 1 + course(k), complex) for k in range(41)]
    assert _drifts_evenly(found, 1) == even


@pytest.mark.parametrize("growth", [0.0, 1e-5], ids=["settled", "drifts evenly"])
def test_what_comes_back_in_a_period_is_told_by_its_mean_and_by_the_swing_around_it(
    growth, monkeypatch
):
    """Of a period of 1 s in steps of 10 ms; what drifts grows by a hundred-thousandth in each."""
    told = []
    monkeypatch.setattr(
        frequency_response,
        "_check_returned",
        lambda bench, column, mean, swing: told.append((column, mean, swing)),
    )
    bench = SimpleNamespace(step_size=0.01, inputs=("v_re", "v_im"))

    def respond(periods):
        for k, deviations in enumerate(periods):
            yield 0.4 + (1 + growth * k) * 0.5 * deviations[:, 1:]

    runs, asked = SimpleNamespace(respond=respond), Excitation(lowest_hz=1.0, settled=1e-6)
    lines = np.array([1, 3, 7])
    *_, seconds = _by_multisine(runs, bench, asked, lines, 1, 0.02)
    ((column, mean, swing),) = told
    grown = 1 + growth * (round(seconds) - 1)
    u = multisine(lines, 100, 0.02)
    assert (column, mean) == (1, pytest.approx(0.4, rel=1e-6))
    assert swing == pytest.approx(0.5 * grown * np.abs(u).max(), rel=1e-6)
