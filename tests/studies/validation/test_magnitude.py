"""A P without its sign is asked about, a model out of step is no such P, and notes are told from questions."""

from types import SimpleNamespace

import numpy as np

from orchestrator.studies.validation.averaging import averaged
from orchestrator.studies.validation.magnitude import _question_of
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.view import Validation

TIMES = np.arange(0.0, 6.0, 0.01)
TURNS = 1.5 * np.cos(2 * np.pi * TIMES)  # of a model out of step [pu]


def asked(measured, simulated):
    """Kinds of what is asked about a measured P beside a simulated one [pu]."""
    recording = SimpleNamespace(
        power=measured + 0j,
        voltage=np.ones(len(TIMES), complex),
        good=np.ones(len(TIMES), bool),
        channels={"p": SimpleNamespace(column="p_mw")},
        average=0.0,
        interval=0.01,
    )
    comparison = SimpleNamespace(near_power=lambda event: simulated + 0j)
    event = SimpleNamespace(recording=recording)
    return [one.kind for one in _question_of(event, "p", simulated + 0j, comparison)]


def test_a_power_without_its_sign_is_asked_about():
    assert asked(np.abs(TURNS), TURNS) == [QuestionKind.MAGNITUDE]


def test_a_model_that_falls_out_of_step_is_no_power_without_its_sign():
    assert not asked(0.9 + 0.05 * np.sin(2 * np.pi * TIMES), TURNS)


def test_what_leaves_a_verdict_standing_is_a_note_and_no_question():
    steady = Question(QuestionKind.NO_STEADY_STATE, {"moves": 0.1})
    slow = Question(QuestionKind.SLOW_SAMPLES, {"interval": 0.05, "fastest": 10.0, "such": ""})
    event = SimpleNamespace(recording=SimpleNamespace(label="rec"))
    one = SimpleNamespace(event=event, questions=(steady, slow))
    found = Validation(SimpleNamespace(comparisons=[one], others=[]))
    assert [len(found.open_questions), len(found.notes)] == [1, 1]
    assert "every 50 ms" in found.notes[0]
    assert found.questions == found.open_questions + found.notes


def test_a_power_that_lost_its_sign_before_its_mean_is_asked_about():
    """It swings within a period: its mean is near zero, and that of its size is not."""
    times = 1e-3 * np.arange(2000)
    swings = 0.2 * np.sin(2 * np.pi * 50 * times) * ((times > 1.0) & (times < 1.1)) + 0.004
    swings -= 0.05 * (times > 1.5)

    def mean(values):
        return averaged(times, values + 0j, 0.02, times)

    def play(recording, start):
        return SimpleNamespace(power=swings + 0j if recording.average == 0 else mean(swings))

    everywhere = np.ones(len(times), dtype=bool)
    recording = Recording(
        label="rec",
        begin=0.0,
        interval=1e-3,
        voltage=everywhere + 0j,
        power=mean(np.abs(swings)),
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=0.02,
        channels={"p": SimpleNamespace(column="p_mw")},
    )
    event = SimpleNamespace(recording=recording, start=None)
    comparison = SimpleNamespace(
        near_power=lambda event: mean(swings), device=SimpleNamespace(play=play)
    )
    (question,) = _question_of(event, "p", mean(swings), comparison)
    assert question.kind is QuestionKind.MAGNITUDE
    assert question.figures["left"] < 1e-6
