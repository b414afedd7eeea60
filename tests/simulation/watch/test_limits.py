"""Which limit of a converter's current is watched: the box of kind 0, or that of the other kinds."""

from functools import cache

import numpy as np
import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.simulation.watch.limits import active_limits
from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.system import System
from tests.simulation.watch.seen import seen_of


@cache
def limited():
    """What the watch looks at in a grid-forming converter, and nothing else."""
    m = ModelBuilder("small_limited", "A current behind a box")
    for name, value in (
        ("voltage_control.i_q_max", 1.1),
        ("current_control.tau", 1e-3),
        ("filter.R_c", 0.005),
        ("current_limit.kind", 0.0),
    ):
        m.parameter(name, value, "1", name)
    u = m.input("u", "1", "Input")
    integrator = m.state("current_control.x_q", 0.0, "1", "Integrator")
    m.derivative(integrator, u - u)
    m.output("filter.i_s_q", u, "1", "Current", base="S_n")
    return read_description(cached(PythonFmu(m.build())))


@pytest.mark.parametrize(
    ("kind", "current", "acts"),
    [
        (0, 1.1, True),
        (0, 1.1 * (1 - 1e-12), True),
        (0, 1.0, False),
        (1, 1.1, False),
        (3, 1.1, False),
    ],
)
def test_the_box_is_watched_for_kind_0_alone(kind, current, acts):
    system = System()
    system.add("gfor", limited(), {"current_limit.kind": float(kind)})
    seen = seen_of(
        {
            "gfor.filter.i_s_q": lambda t: np.full_like(t, current),
            "gfor.der(current_control.x_q)": np.zeros_like,
        },
        1.0,
    )
    found = list(active_limits(seen, system, Settings(system, [], seen.times)))
    assert [f.variable for f in found] == (["filter.i_s_q"] if acts else [])
