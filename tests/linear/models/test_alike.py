"""Components alike are perturbed all at once, and each has the same linear model as by itself, to the last bit."""

from dataclasses import fields

import numpy as np
import pytest

from orchestrator.linear.models import blocks as blocks_module
from orchestrator.linear.models.component_linearization import linearize_alike
from orchestrator.linear.models.linearization import Blocks
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

H = 2e-3
EDGE = 0.05  # where the root of `small_fmus` has no more number


def roots():
    """Lags of different time constants, each before a root and a gain: the last root is bent, next to its edge."""
    system, levels = System(), (0.0, 0.02, EDGE - 3e-5)
    for k, level in enumerate(levels):
        given = {"T": 0.01 * (k + 1), "x_0": level}
        system.add(f"lag{k}", small_fmu("lag"), given, {"u": level})
        system.add(f"root{k}", small_fmu("root"), {}, {"u": level})
        system.add(f"gain{k}", small_fmu("gain"), {}, {"u": 0.0})
        system.connect(f"lag{k}.y", f"root{k}.u")
        system.connect(f"root{k}.y", f"gain{k}.u")
    groups = (tuple(f"{kind}{k}" for k in range(3)) for kind in ("lag", "root", "gain"))
    return Master(system, gauss_seidel(tuple(groups)), H)


def two_area():
    ready = prepare_one("two_area", "gfor")
    return Master(ready.system, ready.schedule, ready.step_size)


def content(value):
    """What an attribute of a linear model holds, in a form that can be compared."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    return [content(part) for part in value] if isinstance(value, tuple) else value


@pytest.mark.parametrize("derivatives", [False, True])
@pytest.mark.parametrize("system", [roots, two_area])
def test_a_component_among_others_has_the_model_that_it_has_alone(system, derivatives, monkeypatch):
    with system() as master:
        together = Blocks(master, derivatives=derivatives).components
        monkeypatch.setattr(blocks_module, "linearize_alike", lambda *_, **__: ())
        alone = Blocks(master, derivatives=derivatives).components
    for name, own in alone.items():
        for field in fields(own):
            of_both = (getattr(one, field.name) for one in (together[name], own))
            assert len({str(content(value)) for value in of_both}) == 1, (name, field.name)


def test_those_that_need_a_smaller_perturbation_or_are_the_only_ones_are_left_out():
    with roots() as master:
        found = [one.name for one in linearize_alike(master.exchanges.values(), 0.0, H)]
        narrow = Blocks(master).components["root2"].narrow
        few = [master.exchanges[name] for name in ("lag0", "root0")]
        assert not list(linearize_alike(few, 0.0, H))
    kinds = [sorted(name for name in found if name.startswith(kind)) for kind in ("lag", "root")]
    assert kinds == [["lag0", "lag1", "lag2"], ["root0", "root1"]]
    assert narrow
