"""One FMU as each of the four kinds of component: every method of `Component` answers or refuses in words."""

from contextlib import ExitStack, closing
from shutil import rmtree
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.process import FmuProcess, HostedComponent
from orchestrator.devices.binding.binding import bind
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.bound_component import BoundComponent
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.support.bindings import GFOR_RATED

KINDS = [LoadedComponent, IsolatedComponent, BoundComponent, HostedComponent]
START = {"P_0": 0.6, "Q_0": 0.15, "v_0": 1.02, "theta_0": 0.3}


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__)
def component(request, fmu_path, tmp_path):
    """A converter at the end of its initialisation."""
    description = read_description(fmu_path("gfor", native=True))
    with ExitStack() as stack:
        if request.param is HostedComponent:
            directory = extract(description.path)
            stack.callback(rmtree, directory)
            process = FmuProcess(description, directory, Limits())
            stack.callback(process.close)
            opened = stack.enter_context(HostedComponent("box", process))
        else:
            if request.param is BoundComponent:
                (tmp_path / "binding.toml").write_text(GFOR_RATED, encoding="utf-8")
                description = bind(description, tmp_path / "binding.toml")
            isolated = request.param is IsolatedComponent
            opened = stack.enter_context(open_component("box", description, isolated=isolated))
        assert type(opened) is request.param
        opened.set(START)
        opened.setup(0.0, None)
        opened.enter_initialization_mode()
        opened.set({"v_re": 1.0, "v_im": 0.2})
        opened.exit_initialization_mode()
        yield opened


def test_values_are_read_by_each_of_its_ways(component):
    batch = RealBatch(component, ["i_re", "i_im"])
    component.read(batch)
    found = dict(zip(batch.names, batch.values.tolist(), strict=True))
    assert found == component.get(["i_re", "i_im"]) == component.values(["i_re", "i_im"])
    assert abs(found["i_re"]) > 0.1


def test_a_saved_state_comes_back_also_from_bytes(component):
    names = ["i_re", "i_im"]
    saved, before = component.save_state(), component.get(names)
    content = component.serialize_state(saved)
    component.step(0.0, 1e-4)
    after = component.get(names)
    assert after != before
    component.restore_state(saved)
    component.step(0.0, 1e-4)
    assert component.get(names) == after
    again = component.deserialize_state(content)
    component.restore_state(again)
    component.step(0.0, 1e-4)
    assert component.get(names) == after
    for state in (saved, again):
        component.free_state(state)


def test_derivatives_are_given_or_refused_in_words(component):
    if isinstance(component, BoundComponent | HostedComponent):
        with pytest.raises(
            ComponentError, match="component 'box': fmi2GetDirectionalDerivative returned nothing: "
        ):
            component.jacobian(["i_re"], ["v_re"])
    else:
        assert np.isfinite(component.jacobian(["i_re", "i_im"], ["v_re"])).tolist() == [
            [True],
            [True],
        ]


def test_a_refused_call_names_the_component_and_the_call(component):
    with pytest.raises(
        ComponentError, match="component 'box' at t = 0 s: fmi2DoStep returned fmi2"
    ) as caught:
        component.step(0.0, -1.0)
    assert "step" in caught.value.log


def test_an_interrupt_while_it_is_asked_stays_an_interrupt(fmu_path):
    """The next question, as where a saved state is freed on the way out, takes no late answer for a forged one."""
    description = read_description(fmu_path("gfor", native=True))
    directory = extract(description.path)

    def interrupted(*_):
        process._library = library
        raise KeyboardInterrupt

    def asked():
        with HostedComponent("box", process) as opened:
            process._library = SimpleNamespace(
                mailbox_post=library.mailbox_post, mailbox_wait=interrupted
            )
            try:
                opened.set(START)
            finally:
                opened.get(["i_re"])

    with closing(FmuProcess(description, directory, Limits())) as process:
        library = process._library
        with pytest.raises(KeyboardInterrupt):
            asked()
    rmtree(directory)
