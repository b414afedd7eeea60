"""The composed step map against brute force, and the FMUs' own derivatives against exact Jacobians."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.linear.models.component_linearization import linearize_component
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.differences import Differences
from orchestrator.linear.models.limits_close_by import AnswersOfSize
from orchestrator.linear.models.linear_model import HELD
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.linear.models.perturbation import _is_another
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.support.exact import exact_continuous
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import lag_factor, small_fmu

SCENARIOS = ("base", "gfor", "pod_pq")
DEVICES = ("gfor", "sg1", "sg2")


def prepared(scenario: str, **overrides):
    ready = prepare_one(
        "two_area", scenario, {k.replace("__", "."): v for k, v in overrides.items()}
    )
    return ready


def running(ready, schedule=None, step_size=None):
    return Master(ready.system, schedule or ready.schedule, step_size or ready.step_size)


def brute_force(master: Master, size: float = 1e-5) -> np.ndarray:
    """Columns of the coupled step map: every state up and down, one real communication step each."""
    state = CoupledState(master)
    x = state.read()
    columns = []
    for k in range(len(x)):
        step = size * max(1.0, abs(x[k]))
        up, down = x.copy(), x.copy()
        up[k] += step
        down[k] -= step
        columns.append((state.step_from(up) - state.step_from(down)) / (2 * step))
    return np.column_stack(columns)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_composed_step_map_equals_brute_force(scenario):
    with running(prepared(scenario)) as master:
        composed = compose(Blocks(master), master.schedule)
        difference = np.abs(composed.A - brute_force(master)).max()
    assert difference < 1e-8  # truncation and rounding of two central differences of size 1e-5


@pytest.mark.parametrize(
    "schedule",
    [jacobi((*DEVICES, "grid")), gauss_seidel((("sg2",), ("gfor",), ("grid",), ("sg1",)))],
    ids=["jacobi", "a device after the grid"],
)
def test_step_map_equals_brute_force_including_what_the_exchange_remembers(schedule):
    ready = prepared("gfor")
    with running(ready, schedule) as master:
        composed = compose(Blocks(master), schedule)
        state = CoupledState(master)
        x = state.read()
        memory = [
            master.output_names.index(n.removesuffix(HELD))
            for n in composed.names
            if n.endswith(HELD)
        ]
        y = master.y[memory].copy()

        def step(dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
            saved, outputs, index = state._save()
            state.write(x + dx)
            master.y[memory] = y + dy
            master.advance(1)
            result = np.concatenate([state.read(), master.y[memory]])
            state._restore(saved, outputs, index)
            return result

        n, total, size = len(x), len(composed.names), 1e-5
        columns = []
        for k in range(total):
            d = np.zeros(total)
            d[k] = size
            columns.append((step(d[:n], d[n:]) - step(-d[:n], -d[n:])) / (2 * size))
    assert len(memory) == 4  # both bus voltages, real and imaginary part
    assert np.abs(composed.A - np.column_stack(columns)).max() < 1e-8


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize(
    "values", [{}, {"grid__X_L": 0.37}, {"gfor__droop__R_f": 0.02, "sg1__P_0": 0.7}]
)
def test_continuous_model_from_fmus_equals_exact_jacobians(scenario, values):
    if scenario == "base":
        values = {k: v for k, v in values.items() if not k.startswith("gfor")}
    ready = prepared(scenario, **values)
    exact, names = exact_continuous(ready)
    with running(ready) as master:
        model = continuous(Blocks(master, without_step=True))
    assert list(model.names) == names
    scale = np.abs(exact).max(axis=1, keepdims=True)
    assert np.abs((model.A - exact) / scale).max() < 1e-7


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_eigenvalues_of_the_step_map_approach_the_exact_ones_linearly_with_the_step(scenario):
    ready = prepared(scenario)
    exact = np.linalg.eigvals(exact_continuous(ready)[0])
    wanted = exact[(exact.imag > 0.6) & (exact.imag < 12) & (exact.real > -5)]
    with running(ready) as master:
        errors = []
        for step_size in (50e-6, 100e-6):
            found = eigenvalues(compose(Blocks(master, step_size), master.schedule))
            errors.append([np.abs(found - value).min() for value in wanted])
    ratios = np.array(errors[1]) / np.array(errors[0])
    assert np.max(errors[1]) < 3e-3
    assert np.all((ratios > 1.7) & (ratios < 2.3))


def test_linearisation_leaves_the_system_as_it_was():
    with running(prepared("pod_pq")) as master:
        master.advance(7)
        state = CoupledState(master)
        before, outputs = state.read(), master.y.copy()
        compose(Blocks(master), master.schedule)
        assert np.array_equal(state.read(), before)
        assert np.array_equal(master.y, outputs)
        assert master.index == 7


def test_two_perturbation_sizes_agree():
    with running(prepared("pod_pq")) as master:
        assert 0 < Blocks(master).disagreement < 1e-8


@pytest.mark.parametrize("value", [0.0, 3.0, 2e7, -5e9])
def test_a_perturbation_is_as_large_as_its_value_needs(value):
    """At 2e7 a step of 1e-5 is two thousand times the distance of neighbouring numbers: three digits, not nine."""
    system = System()
    system.add("one", small_fmu("lag"), {"T": 0.005, "x_0": value}, {"u": value})
    with Master(system, gauss_seidel((("one",),)), 1e-3) as master:
        found = linearize_component(master.exchanges["one"], 0.0, 1e-3, ["u"], ["y"])
    left = lag_factor(1e-3, 0.005)
    assert found.A.item() == pytest.approx(left, abs=1e-9)
    assert found.B.item() == pytest.approx(1 - left, abs=1e-9)
    assert found.C_o.item() == pytest.approx(1.0, abs=1e-9)
    assert found.disagreement < 1e-9


@pytest.mark.parametrize(("usual", "is_another"), [(3.6e-5, False), (0.4, True)])
def test_the_smallest_size_is_taken_where_it_tells_another_answer_and_not_for_rounding(
    usual, is_another
):
    """A reference that moves the speed by rounding alone, which a stabiliser multiplies by 1e4; and a limit."""
    step = SimpleNamespace(states=("x", "y"), names=("x", "y"))
    nothing = np.array([[1.0], [0.0]]), np.zeros((0, 1))
    floors = 10 * 2e-3, 10.0  # of 1e-8, with a step of 2 ms
    at_rest = np.eye(2)[:, :1]
    change = (nothing[0] - at_rest, nothing[1])
    smallest = AnswersOfSize(change, change, change, floors)
    after = np.array([[1.0, 0.0], [usual, 1.0]])
    wide = Differences(after, np.zeros((0, 2)), *[np.zeros((0, 2))] * 4)
    assert _is_another(step, smallest, wide, [0]).tolist() == [is_another]
