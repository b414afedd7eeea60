"""Rows at longer intervals, of which each is a weighted mean of the steps around it."""

from ctypes import CFUNCTYPE, c_int, c_size_t, c_void_p
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.systems.coupling import compiled_loop as loops
from orchestrator.systems.coupling import recorder as module
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.filtered_recorder import FilteredRecorder
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.system import System
from tests.support.late import LateLibrary
from tests.systems.coupling.small_fmus import small_fmu

scipy_signal = LateLibrary("scipy.signal")
STEP = 1e-3


class Batch:
    def __init__(self, component, names):
        self.component, self.names = component, names

    def read(self):
        return self.component.values(self.component.run.index)[: len(self.names)]


@pytest.fixture
def system(monkeypatch):
    monkeypatch.setattr(module, "RealBatch", Batch)

    def make(values):
        run = SimpleNamespace(index=0, time=0.0, components={}, rows_of_steps=lambda *_: None)
        description = SimpleNamespace(variables={"y": None, "z": None})
        run.components["a"] = SimpleNamespace(run=run, description=description, values=values)
        return run

    return make


def record(run, recorder, steps, begin=0):
    run.index, run.time = begin, begin * STEP
    recorder.begin(run, steps)
    recorder.observe(run)
    for run.index in range(begin + 1, steps + 1):
        run.time = run.index * STEP
        recorder.observe(run)


def test_rows_are_the_convolution_with_the_ends_held(system):
    inputs = np.random.default_rng(3).normal(size=(1237, 2)).cumsum(axis=0)
    run = system(lambda k: inputs[k])
    recorder = FilteredRecorder(["a.y", "a.z"], 20)
    record(run, recorder, 1236)
    recorder.end(run)
    weights = scipy_signal.firwin(1001, 0.9 / 20, window=("kaiser", 7.857))
    padded = np.concatenate(
        [np.repeat(inputs[:1], 500, axis=0), inputs, np.repeat(inputs[-1:], 500, axis=0)]
    )
    expected = np.column_stack([np.convolve(column, weights, mode="valid") for column in padded.T])[
        ::20
    ]
    assert recorder.values.shape == expected.shape == (62, 2)
    assert np.allclose(recorder.values, expected, rtol=0, atol=1e-9)
    assert np.allclose(recorder.times, 20 * STEP * np.arange(62), rtol=1e-14)


@pytest.mark.parametrize(
    ("hertz", "left"),
    [(0.0, 1.0), (5.0, 1.0), (19.0, 1.0), (26.0, 0.0), (40.0, 0.0), (48.0, 0.0), (313.0, 0.0)],
)
def test_what_rows_cannot_show_is_taken_away_and_the_rest_is_not_delayed(system, hertz, left):
    """Rows every 20 ms show up to 25 Hz; 20 Hz pass. Without the filter 48 Hz would pass for 2 Hz."""
    run = system(lambda k: np.array([np.cos(2 * np.pi * hertz * k * STEP)]))
    recorder = FilteredRecorder(["a.y"], 20)
    record(run, recorder, 4000)
    recorder.end(run)
    middle = (recorder.times > 1) & (recorder.times < 3)
    expected = left * np.cos(2 * np.pi * hertz * recorder.times[middle])
    assert np.abs(recorder.values[middle, 0] - expected).max() < 3e-4


def test_an_interval_of_one_step_is_not_filtered(system):
    run = system(lambda k: np.array([k % 3]))
    recorder = FilteredRecorder(["a.y"], 1)
    record(run, recorder, 100)
    recorder.end(run)
    assert recorder.values[:, 0].tolist() == [k % 3 for k in range(101)]


@pytest.mark.parametrize("at", [1, 100, 733])
def test_it_is_taken_up_again_to_the_last_bit(system, at):
    inputs = np.random.default_rng(4).normal(size=(1501, 1))
    run = system(lambda k: inputs[k])
    whole = FilteredRecorder(["a.y"], 7)
    record(run, whole, 1500)
    whole.end(run)
    first = FilteredRecorder(["a.y"], 7)
    record(run, first, at)
    position = first.position()
    second = FilteredRecorder(["a.y"], 7)
    second.resume(position)
    record(run, second, 1500, begin=at)
    second.end(run)
    assert np.array_equal(second.times, whole.times)
    assert np.array_equal(second.values, whole.values)


def ring_of_two():
    system = System()
    system.add("a", small_fmu("integrator"), {"gain": 30.0, "x_0": 1.0})
    system.add("b", small_fmu("integrator"), {"gain": -20.0, "x_0": 0.5})
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    return system


@pytest.mark.skipif(loops.loop_library() is None, reason="no compiler for this platform")
def test_the_loop_in_c_reads_the_steps_that_the_loop_in_python_lets_be_read(monkeypatch):
    """Through a change that falls into a block of steps, and to an end that does."""
    found, looks = [], []
    for library in (loops.loop_library(), None):
        monkeypatch.setattr(loops, "loop_library", lambda library=library: library)
        recorder = FilteredRecorder(["b.y", "a.y", "b.u"], 7)
        with Master(ring_of_two(), jacobi(("a", "b")), STEP) as master:
            master.run(0.4, [ParameterChange(0.1, "a", "gain", 40.0)], [recorder])
        found.append(np.column_stack([recorder.times, recorder.values]))
        looks.append(recorder.every)
    assert np.array_equal(*found)
    assert looks == [252, 1]


@pytest.mark.skipif(loops.loop_library() is None, reason="no compiler for this platform")
def test_a_reading_that_an_fmu_refuses_ends_the_run_at_its_time_with_the_rows_before():
    recorder, calls = FilteredRecorder(["b.y", "a.y"], 1), []
    with Master(ring_of_two(), jacobi(("a", "b")), STEP) as master:
        component = master.components["a"]
        read = component.get_real

        @CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, c_void_p)
        def refuse_the_fifth(*arguments):
            calls.append(1)
            return 3 if len(calls) == 5 else read(*arguments)

        component.get_real = refuse_the_fifth
        with pytest.raises(ComponentError, match=r"'a' at t = 0\.004 s: fmi2GetReal"):
            master.run(0.4, [], [recorder])
    assert recorder.times.tolist() == [k * STEP for k in range(4)]
