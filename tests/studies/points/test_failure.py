"""What a point that cannot be computed leaves."""

from types import SimpleNamespace

import pytest

from orchestrator.core.errors import InputError
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
