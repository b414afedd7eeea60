"""The linear model with inputs and outputs against the running system."""

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.state_space import state_space
from orchestrator.systems.coupling.events import LoadChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.support.scenarios import prepare_one

INPUTS = ("grid.load_2.scale", "sg2.exciter.delta_V_ref")
OUTPUTS = ("sg1.omega", "sg2.omega", "grid.bus_2.v", "gfor.p")


def running(schedule=None):
    ready = prepare_one("two_area", "gfor")
    return Master(ready.system, schedule or ready.schedule, ready.step_size)


@pytest.mark.parametrize("kind", ["gauss-seidel", "jacobi", "continuous"])
def test_the_response_to_a_small_load_step_is_that_of_the_system(kind):
    schedule = jacobi(("sg1", "sg2", "gfor", "grid")) if kind == "jacobi" else None
    recorder = Recorder(OUTPUTS, 50)
    with running(schedule) as master:
        blocks = Blocks(master, inputs=INPUTS, outputs=OUTPUTS, without_step=kind == "continuous")
        model = state_space(blocks, None if kind == "continuous" else master.schedule)
        master.run(2.0, [LoadChange(0.0, "grid", "load_2", 1 + 1e-5)], [recorder])
    assert (model.B.shape[1], model.C.shape[0], model.D.shape) == (2, 4, (4, 2))
    seen = (recorder.values - recorder.values[0])[1:]
    linear = model.step_response([1e-5, 0.0], recorder.times)[1:]
    scale = np.abs(seen).max(axis=0)
    # Voltage and power jump with the load; what is seen there is one communication step of delay, which shrinks with H.
    assert np.all(
        np.abs(linear - seen).max(axis=0) < np.array([1e-3, 1e-3, 1.2e-2, 1.2e-2]) * scale
    )


def test_the_final_value_of_a_step_is_the_static_gain():
    with running() as master:
        model = state_space(
            Blocks(master, inputs=INPUTS[:1], outputs=("sg1.omega",)), master.schedule
        )
    stable = np.linalg.eigvals(model.A)
    assert np.abs(stable).max() < 1 + 1e-9
    late = model.step_response([0.01], np.array([0.0, 60.0, 120.0]))
    assert late[1, 0] == pytest.approx(late[2, 0], rel=1e-3)
    assert late[2, 0] < 0  # more load, lower frequency


@pytest.mark.parametrize(
    ("inputs", "outputs", "word"),
    [
        (["grid.load_9.scale"], [], "no variable 'grid.load_9.scale'"),
        (["sg1.S_n"], [], "fixed parameter"),
        (["sg1.v_re"], [], "is fed by grid"),
        (["gfor.pod_p.enabled"], [], "type Boolean"),
        ([], ["gfor.speed"], "no variable 'gfor.speed'"),
    ],
)
def test_what_cannot_drive_or_be_seen_is_said(inputs, outputs, word):
    with running() as master, pytest.raises(InputError, match=word):
        Blocks(master, inputs=inputs, outputs=outputs)
