"""What a box does at once, measured at a component that is a matrix."""

import ctypes
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.many_steps import Steps
from orchestrator.studies.black_box import bench
from orchestrator.studies.black_box.bench import Runs
from orchestrator.studies.black_box.frequency_response import odd_lines

CALLED_STEP = 2
"""Number of the call that steps, as ``many_steps.h`` has it."""

GET_SET = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.c_uint32),
    ctypes.c_size_t,
    ctypes.POINTER(ctypes.c_double),
)
DO_STEP = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int
)


def test_the_direct_effect_is_half_the_difference_of_both_ways(monkeypatch):
    D, rest, at = np.array([[0.5, -2.0, 0.0], [3.0, 0.25, 1.0]]), np.array([1.0, -2.0, 0.5]), {}

    class Batch:
        def __init__(self, _, names):
            self.values = np.zeros(len(names))

        def write(self):
            at["u"] = self.values.copy()

        def read(self):
            return D @ at["u"] + np.array([7.0, -4.0])

    monkeypatch.setattr(bench, "RealBatch", Batch)
    run = object.__new__(Runs)
    run._bench = SimpleNamespace(outputs=["p", "q"], inputs=["a", "b", "c"], rest=rest)
    run._component = object()
    monkeypatch.setattr(run, "_rewind", lambda: None)
    np.testing.assert_allclose(run.feedthrough(0.01), D, atol=1e-12)
    assert at["u"].tolist() == rest.tolist(), "and everything is put back"


@pytest.mark.parametrize(("highest", "last"), [(101.0, 101), (102.9, 101), (100.0, 99)])
def test_the_highest_odd_multiple_in_the_range_is_a_line(highest, last):
    lines = odd_lines(1.0, highest, 9)
    assert (lines[0], lines[-1]) == (1, last)
    assert (lines % 2 == 1).all()


def test_a_response_is_the_deviation_from_the_operating_point(monkeypatch):
    rest, at_rest = np.array([1.0, -2.0]), np.array([7.0, -4.0, 0.5])
    D = np.array([[0.5, -2.0], [3.0, 0.25], [0.0, 1.0]])
    run = object.__new__(Runs)
    run._bench = SimpleNamespace(rest=rest)
    run.operating_point = at_rest
    monkeypatch.setattr(run, "_rewind", lambda: None)
    monkeypatch.setattr(run, "_drive", lambda inputs: at_rest + (inputs - rest) @ D.T)
    deviations = np.array([[0.0, 0.0], [0.1, -0.3]])
    (found,) = run.respond([deviations])
    np.testing.assert_allclose(found, deviations @ D.T, atol=1e-12)


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (
            lambda t: 0.01 * np.sin(600 * np.pi * t),
            r"swings by 0\.02 pu at 300 Hz of the turning frame after 5 s",
        ),
        (lambda t: np.exp(-t / 20) * np.sin(600 * np.pi * t), "moves by .* give it more time"),
        (lambda t: 0.01 * t, "moves by 0.01 pu in a second after 5 s"),
    ],
)
def test_a_device_that_emits_a_line_is_told_apart_from_one_that_is_not_yet_at_rest(course, words):
    run, h = object.__new__(Runs), 1e-4
    named = SimpleNamespace(path=Path("vendor.fmu"))
    run._bench = SimpleNamespace(description=named, step_size=h, longest_wait=5.0)
    run._index = 0
    run._means = lambda outputs: outputs

    def hold(count):
        times = h * (run._index + np.arange(count))
        run._index += count
        return np.stack([course(times), 0.5 * course(times)], axis=1)

    run._hold = hold
    with pytest.raises(AnalysisError, match=words):
        run._come_to_rest()


def three_steps(references, inputs, outputs, step_size, **more):
    """Steps behind seven that were made: one input, whose reference comes first, and one output."""
    return Steps(
        input_references=ctypes.addressof(references),
        output_references=ctypes.addressof(references) + ctypes.sizeof(ctypes.c_uint32),
        n_in=1,
        n_out=1,
        inputs=inputs.ctypes.data,
        outputs=outputs.ctypes.data,
        index=7,
        count=3,
        step_size=step_size,
        **more,
    )


@pytest.mark.parametrize(("refused", "told"), [(0.0, None), (0.8, (1, CALLED_STEP))])
def test_steps_begin_at_their_times_each_behind_its_inputs(refused, told):
    """Seven steps of 0.1 s were made before; the functions are an FMU's, which may refuse the step from 0.8 s."""
    calls, inputs, late = [], np.array([[1.0], [2.0], [3.0]]), np.array([[10.0], [20.0], [30.0]])
    outputs, failed, h = np.zeros((3, 1)), (ctypes.c_int64 * 2)(), 0.1

    def put(_, references, count, values):
        calls.append(("set", references[0], values[0]))
        return 0

    def step(_, time, size, keep):
        calls.append(("step", round(time, 9), size))
        return 3 * (round(time, 9) == refused)

    def read(_, references, count, values):
        values[0] = calls[-1][2] + 0.5
        calls.append(("get", references[0], values[0]))
        return 0

    put, step, read = GET_SET(put), DO_STEP(step), GET_SET(read)
    references = (ctypes.c_uint32 * 2)(7, 9)
    asked = three_steps(references, inputs, outputs, h, late=late.ctypes.data)
    functions = [ctypes.cast(one, ctypes.c_void_p) for one in (put, read, step)]
    status = bench._library().drive(None, *functions, ctypes.byref(asked), failed)
    each = [
        (
            ("set", 7, u),
            ("step", round(0.7 + h * k, 9), h),
            ("set", 7, 10 * u),
            ("get", 9, 10 * u + 0.5),
        )
        for k, u in enumerate((1.0, 2.0, 3.0))
    ]
    if told is None:
        assert status == 0
        assert calls == [call for one in each for call in one]
        assert outputs.ravel().tolist() == [10.5, 20.5, 30.5]
    else:
        assert (status, tuple(failed)) == (3, told)
        assert calls == [*each[0], *each[1][:2]]


STEP_STACK = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.POINTER(ctypes.c_void_p),
    ctypes.c_size_t,
    ctypes.c_double,
    ctypes.c_double,
    ctypes.POINTER(ctypes.c_int),
)


def test_steps_side_by_side_begin_at_their_times_without_one_that_refused():
    """Seven steps of 0.1 s were made before; the second component refuses the step from 0.8 s."""
    inputs = [np.array([[1.0], [2.0], [3.0]]), np.array([[4.0], [5.0], [6.0]])]
    outputs, h, given, steps = [np.zeros((3, 1)), np.zeros((3, 1))], 0.1, {}, []

    def put(component, references, count, values):
        given[component] = values[0]
        return 0

    def step(components, count, time, size, status):
        steps.append(([components[k] for k in range(count)], round(time, 9), size))
        for k in range(count):
            status[k] = 3 * (components[k] == 2 and round(time, 9) == 0.8)
        return 0

    def read(component, references, count, values):
        values[0] = given[component] + 0.5
        return 0

    put, step, read = GET_SET(put), STEP_STACK(step), GET_SET(read)
    references = (ctypes.c_uint32 * 2)(7, 9)
    asked = (Steps * 2)(
        *(
            three_steps(references, own, found, h)
            for own, found in zip(inputs, outputs, strict=True)
        )
    )
    components, refused = (ctypes.c_void_p * 2)(1, 2), (ctypes.c_int * 2)()
    functions = [ctypes.cast(one, ctypes.c_void_p) for one in (put, read, step)]
    bench._library().drive_beside(components, *functions, ctypes.byref(asked), 2, refused)
    assert steps == [([1, 2], 0.7, h), ([1, 2], 0.8, h), ([1], 0.9, h)]
    assert outputs[0].ravel().tolist() == [1.5, 2.5, 3.5]
    assert outputs[1].ravel().tolist() == [4.5, 0.0, 0.0]
    assert list(refused) == [0, 3]
