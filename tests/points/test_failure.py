"""What a point that cannot be computed leaves, and signals among a stored point's arrays."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.errors import InputError
from orchestrator.points.failure import failure_kept
from orchestrator.points.signals import signal_arrays, take_signals
from orchestrator.points.store import PointStore


@pytest.mark.parametrize(
    ("error", "said"),
    [(InputError("no licence"), "no licence"), (ZeroDivisionError("division"), "ZeroDivisionError: division")],
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


def test_signals_come_back_as_they_were_stored(tmp_path):
    store = PointStore(tmp_path)
    times, signals = np.arange(3.0), {"p": np.array([1.0, 2.0, 3.0]), "signal v": np.ones(3)}
    store.save("key", {}, {"eigenvalues": np.ones(2), **signal_arrays(times, signals)})
    _, arrays = store.load("key")
    again, found = take_signals(arrays)
    assert again.tolist() == times.tolist()
    assert {name: values.tolist() for name, values in found.items()} == {n: v.tolist() for n, v in signals.items()}
    assert set(arrays) == {"eigenvalues"}


def test_a_signal_that_was_cut_off_is_no_signal():
    with pytest.raises(ValueError, match="signal p has another length"):
        take_signals(signal_arrays(np.arange(3.0), {"p": np.ones(2)}))
