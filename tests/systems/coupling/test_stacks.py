"""FMUs of one kind that step together, in a running system: the bits that each has by itself."""

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.systems.coupling import compiled_loop
from orchestrator.systems.coupling.compiled_loop import FEWEST, SIDE_BY_SIDE
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling.test_threads import native

H = 1e-3

pytestmark = pytest.mark.skipif(
    compiled_loop.loop_library() is None, reason="no compiler for this platform"
)


@pytest.fixture
def apart(monkeypatch):
    """Every FMU steps by itself."""

    def bind(component):
        kept(component)
        component.step_stack = None

    kept = LoadedComponent._bind_functions
    monkeypatch.setattr(LoadedComponent, "_bind_functions", bind)


def ring(kinds):
    """FMUs of some kinds, each fed by the one before it."""
    system, names = System(), [f"{kind}_{k}" for k, kind in enumerate(kinds)]
    for k, (name, kind) in enumerate(zip(names, kinds, strict=True)):
        system.add(name, native(kind), {"x_0": 1.0 + 0.1 * k})
    for one, other in zip(names, (*names[1:], names[0]), strict=True):
        system.connect(f"{one}.y", f"{other}.u")
    return system, names


KINDS = ["lag", "integrator"] * 10


def course(threads, groups=1):
    system, names = ring(KINDS)
    parts = [tuple(names[k::groups]) for k in range(groups)]
    schedule = jacobi(names) if groups == 1 else gauss_seidel(tuple(parts))
    changed = next(name for name in names if name.startswith("integrator"))
    event = ParameterChange(0.205, changed, "gain", -2.0)
    with Master(system, schedule, H, threads=threads) as master:
        master.run(0.5, [event])
        states = [c.serialize_state(c.save_state()) for c in master.components.values()]
        assert len(set(master.y.tolist())) == len(names)
        return master.y.tobytes(), master.tracks.saved().tobytes(), *states


@pytest.mark.parametrize("groups", [1, 3])
def test_a_run_with_an_event_has_the_same_bits(groups, request):
    found = {course(threads, groups) for threads in (1, 2, 3)}
    request.getfixturevalue("apart")
    assert found == {course(1, groups)}


def test_a_case_with_its_event_has_the_same_bits(request):
    """Four machines around a network, which its event shakes."""

    def ends():
        ready = prepare_one("kundur", "pss", overrides={"*.native": True})
        (component, changes), *_ = ready.events[0].changes().items()
        events = [ParameterChange(0.1, component, n, v) for n, v in changes.items()]
        with Master(ready.system, ready.schedule, ready.step_size) as master:
            master.run(0.3, events)
            return master.y.tobytes()

    together = ends()
    request.getfixturevalue("apart")
    assert together == ends()


def test_who_steps_together():
    """Instances of one library within one group, in parts that registers hold; too few step by themselves."""
    system, names = ring(["lag"] * (SIDE_BY_SIDE + FEWEST) + ["integrator"] * (FEWEST - 1))
    with Master(system, jacobi(names), H) as master:
        stacks = [members.tolist() for _, _, members, _ in master._loop._stacks]
    assert [len(members) for members in stacks] == [SIDE_BY_SIDE, FEWEST]
    assert sorted(np.concatenate(stacks)) == [*range(SIDE_BY_SIDE + FEWEST)]


def test_the_first_that_is_refused_is_named():
    """In the schedule's order, wherever in its stack it stands."""
    system, names = ring(["lag"] * 5)
    with Master(system, jacobi(names), H) as master:
        master.advance(3)
        for name in (names[3], names[1]):
            component = master.components[name]
            component._call("fmi2Terminate", component._fmu.terminate)
            component._initialised = False
        with pytest.raises(ComponentError, match=rf"'{names[1]}' at .* fmi2SetReal"):
            master.advance(2)


def test_time_is_shared_by_those_that_step_together():
    system, names = ring(["lag"] * SIDE_BY_SIDE)
    with Master(system, jacobi(names), H) as master:
        master.advance(200)
        seconds = np.array(master.seconds())
    assert (seconds > 0).all()
    assert seconds.max() < 3 * seconds.min()
