"""Currents beside a voltage near zero: those that flowed, with the noise that a power's noise makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.validation.figures import errors_in, noise_in, signals_of
from orchestrator.studies.validation.limits import (
    ErrorLimits,
    LimitTables,
    LimitVerdict,
    OpenCause,
    judge_limits,
)
from orchestrator.studies.validation.record import Recording, at_port
from orchestrator.studies.validation.transformer import AT_PORT
from orchestrator.studies.validation.windows import Windows

INTERVAL, PERIOD = 1e-3, 0.02  # [s]
TIMES = INTERVAL * np.arange(3000)
FAULT = (TIMES >= 1.0) & (TIMES < 1.15)
WINDOWS = Windows(1.0, 1.15, float(TIMES[-1]))
CURRENT = 0.9  # [pu], which a converter at its limit keeps
NOISE = 1e-3  # of P and Q [pu]


def recorded(depth, noise, current=CURRENT):
    """A plant that keeps its active current while the voltage falls to ``depth`` [pu]."""
    voltage = np.where(FAULT, depth, 1.0).astype(complex)
    random = np.random.default_rng(1).standard_normal((2, len(TIMES)))
    power = voltage * current + noise * (random[0] + 1j * random[1])
    everywhere = np.ones(len(TIMES), dtype=bool)
    of_port = (everywhere, everywhere, 50.0, False, PERIOD, {})
    return at_port(Recording("rec", 0.0, INTERVAL, voltage, power, *of_port), AT_PORT)


def judged(depth, model_current, noise=NOISE):
    """The mean error of the active current during the fault beside a limit of 0.1 pu."""
    recording = recorded(depth, noise)
    own = recorded(depth, 0.0, model_current).power
    measured, simulated = (signals_of(recording, x) for x in (recording.power, own))
    errors = {name: simulated[name] - measured[name] for name in measured}
    scatter = noise_in(recording, errors["i_p"], WINDOWS)
    found = errors_in(recording, errors, WINDOWS, ("during", "i_p"), scatter)
    comparison = SimpleNamespace(
        event=SimpleNamespace(recording=recording), errors={"during": {"i_p": found}}, doubt=None
    )
    limits = {"during": {"i_p": ErrorLimits(mean_abs_error=0.1)}}
    (criterion,) = judge_limits(LimitTables(source="here", windows=limits), comparison)
    return criterion


@pytest.mark.parametrize("depth", [0.5, 0.1, 0.0017])
def test_a_current_that_stays_is_measured_as_it_flows_however_deep_the_fault(depth):
    """The mean of a power over the momentary voltage was a current of 500 pu at its first sample."""
    recording = recorded(depth, noise=0.0)
    assert signals_of(recording, recording.power)["i_p"] == pytest.approx(CURRENT, rel=1e-9)


@pytest.mark.parametrize(
    ("depth", "model_current", "verdict", "why"),
    [
        (0.5, CURRENT, LimitVerdict.MET, None),
        (0.5, 0.7, LimitVerdict.NOT_MET, None),
        (0.0012, CURRENT, LimitVerdict.OPEN, OpenCause.LOW_VOLTAGE),
        (0.0012, 0.7, LimitVerdict.OPEN, OpenCause.LOW_VOLTAGE),
    ],
)
def test_a_limit_of_a_current_is_open_where_noise_makes_as_much(depth, model_current, verdict, why):
    found = judged(depth, model_current)
    assert (found.verdict, found.why_open) == (verdict, why)


def test_without_noise_a_current_is_judged_at_any_voltage():
    assert judged(0.0017, CURRENT, noise=0.0).verdict is LimitVerdict.MET
    assert judged(0.0017, 0.7, noise=0.0).verdict is LimitVerdict.NOT_MET
