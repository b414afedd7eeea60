"""Moves of one variable each: the same answers from C as from Python, and the same words where a call fails."""

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.linear.models import answers_to_moves as module
from orchestrator.linear.models.answers_to_moves import Moves, answers_to_moves
from orchestrator.linear.models.differences import PerturbedStep
from orchestrator.linear.models.linearization import Blocks
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import lag_factor, small_fmu

H, T = 2e-3, 0.01


@pytest.fixture(params=["C", "Python"])
def way(request, monkeypatch):
    if request.param == "Python":
        monkeypatch.setattr(module, "_library", lambda: None)
    elif module._library() is None:
        pytest.skip("there is no compiler here")
    return request.param


@pytest.fixture
def lag():
    system = System()
    system.add("lag", small_fmu("lag"), {"T": T, "x_0": 0.3}, {"u": 0.3})
    with Master(system, gauss_seidel((("lag",),)), H) as master:
        yield master.components["lag"]


def answers(component, places, values, steps):
    moved, outputs, slopes, states = (
        RealBatch(component, names)
        for names in (("x", "u"), ("y",), component.description.rates, ("x",))
    )
    moved.read()
    moves = Moves(
        moved,
        np.array(places),
        np.array(values),
        np.array(steps),
        before=(outputs, slopes),
        after=states,
        time=0.0,
        step_size=H,
    )
    saved = component.save_state()
    try:
        return answers_to_moves(component, moves, saved)
    finally:
        component.free_state(saved)


def test_each_move_begins_where_the_component_rests(lag, way, monkeypatch):
    """Twice the same move, with another between: x moved to 0.5, u to 0.7, and one that no step follows."""
    monkeypatch.setattr(module, "_AT_ONCE", 3)
    found = answers(lag, [0, 1, 0, 1], [0.5, 0.7, 0.5, 0.7], [True, True, True, False])
    left = lag_factor(H, T)
    expected = [0.3 + 0.2 * left, 0.7 - 0.4 * left, 0.3 + 0.2 * left, 0.0]
    assert found.after[:, 0] == pytest.approx(expected, abs=1e-12)
    assert found.before[0][:, 0].tolist() == [0.5, 0.3, 0.5, 0.3]
    assert found.before[1][:, 0] == pytest.approx([-0.2 / T, 0.4 / T] * 2, rel=1e-12)
    assert RealBatch(lag, ("x", "u")).read().tolist() == [0.3, 0.3]


def test_answers_to_one_side_are_measured_from_rest(lag, way):
    """The lag is linear: what it answers upwards alone is its rate's derivative."""
    step = PerturbedStep(lag, ("u",), ("y",), 0.0, H)
    found = step.differences(range(2), 1e-5, lag.description.rates)
    assert found.slopes_up[0] == pytest.approx([-1 / T, 1 / T], rel=1e-8)
    assert found.outputs_up[0] == pytest.approx([1.0, 0.0], rel=1e-8)


def test_two_sizes_at_once_are_what_each_gives(lag, way):
    step, sizes = PerturbedStep(lag, ("u",), ("y",), 0.0, H), (1e-5, 2e-5)
    both = step.differences_of_sizes(range(2), sizes)
    for one, size in zip(both, sizes, strict=True):
        for part, alone in zip(one, step.differences(range(2), size), strict=True):
            assert np.array_equal(part, alone)
    assert not np.array_equal(both[0].after, both[1].after)


def test_a_call_that_fails_is_named(lag, way):
    with pytest.raises(ComponentError, match="fmi2DoStep"):
        answers(lag, [0, 0], [0.5, np.inf], [True, True])


def test_c_gives_what_python_gives_to_the_last_bit(monkeypatch):
    """Machines and a converter that are compiled, and a network behind Python, with derivatives."""
    if module._library() is None:
        pytest.skip("there is no compiler here")
    ready = prepare_one("two_area_rms", "gfor")
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        in_c = Blocks(master, without_step=True)
        monkeypatch.setattr(module, "_library", lambda: None)
        in_python = Blocks(master, without_step=True)
    for name, one in in_c.components.items():
        other = in_python.components[name]
        for matrix in ("A", "B", "C", "D", "A_c", "B_c"):
            assert getattr(one, matrix).tobytes() == getattr(other, matrix).tobytes(), (
                name,
                matrix,
            )
        assert one.disagreement == other.disagreement
