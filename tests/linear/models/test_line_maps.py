"""The step map of schedules of second order: that of the running system, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.face.api.case import load
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.linear_model import HELD
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import midpoint, newton
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu
from tests.systems.coupling.test_master import oscillator, ring, system_of

IN_TURN = (("a",), ("b",))


@pytest.mark.parametrize(("schedule", "memories"), [("midpoint", 4), ("newton", 0)])
def test_step_map_is_that_of_finite_differences_of_the_whole_step(schedule, memories):
    """At 500 µs in five parts; the last outputs of the grid are memory where they are extrapolated."""
    ready = load("two_area").scenario("pod_pq", step=5e-4, schedule=schedule).prepared
    with running(ready) as master:
        find_operating_point(master)
        composed = compose(Blocks(master), master.schedule)
        state = CoupledState(master)
        x, y = state.read(), master.y.copy()
        memory = [
            master.output_names.index(n.removesuffix(HELD))
            for n in composed.names
            if n.endswith(HELD)
        ]

        def step(dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
            with state.put_back():
                state.write(x + dx)
                before = y.copy()
                before[memory] += dy
                master.before, now = before, master.y[memory].copy()
                master.advance(1)
                return np.concatenate([state.read(), now])

        # Without memory the lines' first guess does not matter, with it all outputs that are taken too early are in it.
        n, size, columns = len(x), 1e-5, []
        for k in range(len(composed.names)):
            d = np.zeros(len(composed.names))
            d[k] = size
            columns.append((step(d[:n], d[n:]) - step(-d[:n], -d[n:])) / (2 * size))
    assert len(memory) == memories
    assert np.abs(composed.A - np.column_stack(columns)).max() < 1e-7


@pytest.mark.parametrize("schedule", [midpoint(IN_TURN, 1e-3), newton(IN_TURN, 1e-3)])
def test_eigenvalues_are_those_of_the_simulated_ring_down(schedule):
    """At a step that moves the mode by 1 %: of two states, x_k+1 = t·x_k − d·x_k−1 after what is fast is gone."""
    step_size = 1e-2
    recorder = Recorder(["a.y"], 1)
    with Master(oscillator(), schedule, step_size) as master:
        values = eigenvalues(compose(Blocks(master), schedule))
        master.run(200 * step_size, observers=[recorder])
    seen = values[values.imag > 0][0]
    x = recorder.values[20:, 0]
    t, d = np.linalg.lstsq(np.column_stack([x[1:-1], -x[:-2]]), x[2:], rcond=None)[0]
    rung = np.log(np.roots([1, -t, d])[0]) / step_size
    assert complex(rung.real, abs(rung.imag)) == pytest.approx(seen, abs=1e-6)
    assert abs(seen - 1j * np.sqrt(600)) > 1e-3 * np.sqrt(600)


def test_an_fmu_that_hides_a_direct_dependency_is_refused():
    system = System()
    hiding = replace(small_fmu("gain"), output_dependencies={"y": ()})
    system.add("a", small_fmu("integrator"), {"gain": -10.0})
    system.add("b", hiding, {"K": 0.5})
    for source, target in ring("a", "b"):
        system.connect(source, target)
    with (
        Master(system, midpoint(IN_TURN), 1e-3) as master,
        pytest.raises(
            AnalysisError,
            match=r"component 'b': its FMU declares that y does not depend on u .* \(0\.5\)",
        ),
    ):
        compose(Blocks(master), master.schedule)


def test_blocks_of_other_parts_are_refused():
    system = system_of(ring("a", "b"), a=("integrator",), b=("lag",))
    with (
        Master(system, midpoint(IN_TURN, 1e-3), 2e-3) as master,
        pytest.raises(
            ValueError, match="linearised for 2 parts of a step, and schedule 'midpoint' has 1"
        ),
    ):
        compose(Blocks(master), midpoint(IN_TURN))
