"""A setpoint that steps while the voltage rests is asked about, with its step and its moment."""

import numpy as np
import pytest

from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.setpoint import ask_of_setpoint
from orchestrator.studies.validation.windows import Windows

INTERVAL, LENGTH = 5e-3, 4.0  # [s]
TIMES = np.arange(0.0, LENGTH + INTERVAL / 2, INTERVAL)
SIMULATED = np.full(len(TIMES), 0.6 + 0.1j)
EVENT = Windows(begin=0.5, end=0.6, length=LENGTH)
STEP_AT = 2.0  # [s]


def asked(change):
    """What is asked of a recording whose P and Q differ from the model's by a change."""
    everywhere = np.ones(len(TIMES), dtype=bool)
    recording = Recording(
        label="rec",
        begin=10.0,
        interval=INTERVAL,
        voltage=np.ones(len(TIMES), dtype=complex),
        power=SIMULATED + change,
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=INTERVAL,
        channels={},
    )
    return ask_of_setpoint(recording, EVENT, SIMULATED)


@pytest.mark.parametrize(("signal", "axis"), [("p", 1.0), ("q", 1j)])
@pytest.mark.parametrize("step", [0.1, -0.04])
def test_a_step_is_asked_about_with_its_size_and_its_moment(signal, axis, step):
    (question,) = asked(axis * step * (TIMES > STEP_AT))
    assert question.kind is QuestionKind.SETPOINT
    assert question.figures["signal"] == signal
    assert question.figures["offset"] == pytest.approx(step, rel=1e-9)
    assert question.figures["at"] == pytest.approx(10.0 + STEP_AT, abs=2 * INTERVAL)
    assert question.figures["stop"] < 10.0 + STEP_AT


def test_an_error_that_goes_away_is_no_setpoint():
    assert not asked(0.1 * (TIMES < STEP_AT))
    assert not asked(np.zeros(len(TIMES)))
