"""Inputs of a component with many, which nothing moves: not perturbed, and the composed model stays as it is."""

import numpy as np
import pytest

from orchestrator.linear.models import blocks as blocks_module
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

H = 1e-3


def chain(K):
    """An integrator that a gain stands before, with an open input."""
    system = System()
    system.add("amplifier", small_fmu("gain"), {"K": K}, {"u": 1.0})
    system.add("tank", small_fmu("integrator"), {"gain": 2.0})
    system.connect("amplifier.y", "tank.u")
    return Master(system, gauss_seidel((("amplifier",), ("tank",))), H)


@pytest.mark.parametrize("K", [0.0, 3.0])
def test_only_an_input_that_nothing_moves_is_left_out(K, monkeypatch):
    monkeypatch.setattr(blocks_module, "MANY_INPUTS", 1)
    with chain(K) as master:
        found = Blocks(master, inputs=["amplifier.u"]).components["tank"].B
    assert found == pytest.approx(2.0 * H if K else 0.0, abs=1e-9)


@pytest.mark.parametrize("again", ["renew", "with_component"])
def test_an_input_that_comes_to_move_is_perturbed_then(again, monkeypatch):
    """A gain of 0 at first: had its receiver stayed without the input, the gain would reach nothing."""
    monkeypatch.setattr(blocks_module, "MANY_INPUTS", 1)
    with chain(0.0) as master:
        blocks = Blocks(master, inputs=["amplifier.u"])
        assert not blocks.components["tank"].B.any()
        master.components["amplifier"].set({"K": 3.0})
        if again == "renew":
            blocks.renew(master, ["amplifier"])
        else:
            other = blocks.with_component(master, "amplifier")
            assert not blocks.components["tank"].B.any()  # the first blocks stay as they were
            blocks = other
    assert blocks.components["tank"].B.item() == pytest.approx(2.0 * H, abs=1e-9)


def test_a_phasor_networks_admittances_are_left_out_without_a_change(monkeypatch):
    """Devices' admittances do not answer anything: half of the network's inputs."""
    ready = prepare_one("two_area_rms", "gfor")
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        whole = Blocks(master)
        monkeypatch.setattr(blocks_module, "MANY_INPUTS", 8)
        less = Blocks(master)
        models = [compose(b, master.schedule) for b in (whole, less)]
    grid = [b.components["grid"] for b in (whole, less)]
    idle = [name for k, name in enumerate(grid[0].inputs) if not grid[1].D[:, k].any()]
    assert {name.rpartition(".")[2] for name in idle} == {"y_re", "y_im"}
    assert len(idle) == len(grid[0].inputs) // 2
    assert grid[0].D[:, list(grid[0].inputs).index(idle[0])].any()
    assert np.array_equal(models[0].A, models[1].A)
