"""What a point that cannot be computed leaves."""

from types import SimpleNamespace

import pytest

from orchestrator.core import spelling
from orchestrator.core.errors import InputError, Problem
from orchestrator.core.options import Option
from orchestrator.studies.points import task as points
from orchestrator.studies.points.failure import failure_kept


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (InputError("no licence"), "no licence"),
        (ZeroDivisionError("division"), "ZeroDivisionError: division"),
    ],
)
def test_an_error_becomes_the_points_failure(error, said):
    result = SimpleNamespace(failure=None, figure=0)
    with failure_kept(result):
        result.figure = 1
        raise error
    assert str(result.failure) == said
    assert result.figure == 1


def test_no_error_leaves_no_failure():
    result = SimpleNamespace(failure=None)
    with failure_kept(result):
        pass
    assert result.failure is None


def test_an_interrupt_ends_all_points():
    result = SimpleNamespace(failure=None)
    with pytest.raises(KeyboardInterrupt), failure_kept(result):
        raise KeyboardInterrupt
    assert result.failure is None


def test_texts_of_a_point_name_options_as_they_are_typed_whoever_computes_it(monkeypatch):
    """A worker process has not begun as a command, and its texts are shown by one."""
    monkeypatch.setattr(spelling, "_commanded", [])
    monkeypatch.setattr(points, "same_case", lambda *wanted: None)
    text = "write `gfor new --reactive-limits`, or " + Option.SET + " grid.X=1"
    question = Problem("own.raw", text)
    asked = SimpleNamespace(study=SimpleNamespace(reference="", fingerprint="", trust_fmus=False))
    asked.study.varied = asked.study.line_ends = frozenset()
    assert points.computed(asked, lambda task, case: str(question)) == (
        "own.raw: write `gfor new --reactive-limits`, or --set grid.X=1"
    )
    assert str(question).endswith("or values grid.X=1")
