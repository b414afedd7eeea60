"""What a process in which foreign code runs may answer."""

import pytest

from orchestrator.devices.sandbox.answer_forms import NotAnAnswerError, content_of


@pytest.mark.parametrize("answer", [{}, {"result": 1, "done": 2}, ["result"], None, "result", 3])
def test_what_is_no_single_answer_is_refused(answer):
    with pytest.raises(NotAnAnswerError, match="in place of an answer"):
        content_of(answer, "box")


def test_an_answer_gives_its_content():
    assert content_of({"result": [1, 2]}, "box") == [1, 2]
