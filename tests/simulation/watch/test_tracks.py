"""What the inner loop notes of every coupled output at every step, in C and in Python, and where it stops."""

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError, NotFiniteError
from orchestrator.simulation.watch.seen import Watcher
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.systems.coupling.test_master import H, inner_loop, oscillator, system_of  # noqa: F401


def test_extremes_and_turns_between_two_looks_are_those_of_every_step():
    every, steps = 250, 1000
    recorder, watcher = Recorder(["a.y", "b.y"], 1), Watcher(["a.x"], every)
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        master.run(steps * H, (), [recorder, watcher])
    seen = watcher.seen(recorder)
    assert seen.times.tolist() == [k * every * H for k in range(steps // every + 1)]
    assert set(seen.values) == {"a.x", "a.y", "b.y"}
    for column, name in enumerate(("a.y", "b.y")):
        y = recorder.values[:, column]
        # the step at which it goes the other way
        turned = np.flatnonzero(np.diff(np.sign(np.diff(y))) != 0) + 2
        for look in range(1, steps // every + 1):
            stretch = y[(look - 1) * every : look * every + 1]
            assert seen.low[name][look] == stretch.min()
            assert seen.high[name][look] == stretch.max()
            assert (
                seen.turns[name][look]
                == ((turned > (look - 1) * every) & (turned <= look * every)).sum()
            )
            assert seen.last[name][look] == y[look * every]
    assert seen.turns["a.y"].sum() > 5


def root(x_0):
    """y = √(0.05 − x) with ẋ = 1: no number from t = 0.05 s − x_0 on; the FMU itself says nothing of it."""
    return system_of(
        [("x.y", "root.u"), ("root.y", "k.u")],
        x=("integrator", {"x_0": x_0}, {"u": 1.0}),
        root=("root",),
        k=("gain",),
    )


def test_the_component_that_gives_no_number_is_named_and_not_the_one_that_is_fed_with_it():
    recorder = Recorder(["root.y"], 1)
    with (
        Master(root(5e-4), jacobi(("x", "root", "k")), H) as master,
        pytest.raises(NotFiniteError) as caught,
    ):
        master.run(1.0, (), [recorder])
    error = caught.value
    assert (error.component, error.variable) == ("root", "y")
    assert error.time == pytest.approx(0.051)  # the step that begins with x = 0.0505
    assert "component 'root' at t = 0.051 s" in str(error)
    assert "y is no finite number (nan)" in str(error)
    assert isinstance(error, ComponentError)
    assert recorder.times[-1] == pytest.approx(0.05)
    assert np.isfinite(recorder.values).all()


def test_at_the_start():
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        # as an FMU that checks nothing would give it
        master.exchanges["b"].outputs.values[:] = np.inf
        with pytest.raises(NotFiniteError) as caught:
            master.run(1.0)
    assert (caught.value.component, caught.value.value, caught.value.time) == ("b", np.inf, 0.0)


def test_at_an_event():
    event = ParameterChange(0.01, "root", "offset", float("-1"))
    with (
        Master(root(0.0), jacobi(("x", "root", "k")), H) as master,
        pytest.raises(NotFiniteError) as caught,
    ):
        master.run(1.0, [event])
    assert (caught.value.component, caught.value.variable, caught.value.time) == ("root", "y", 0.01)
