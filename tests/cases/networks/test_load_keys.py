"""Keys of loads in a case file: words, shares, what holds for all, and what is wrong with them."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.systems.coupling.master import Master
from tests.cases.events.test_switching import RING

LAWS = """
[network.load_model]
active = "power"
tau = "2 ms"
"""


def prepared(folder, old="", new="", laws=LAWS):
    text = RING.replace("[components.sg]", laws + "[components.sg]", 1)
    assert old in text
    (folder / "case.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    return load_case(folder / "case.toml").prepare()[0]


def test_the_power_flow_is_the_steady_state_with_loads_of_every_kind(tmp_path):
    works = 'loads.works = { bus = "b2", p = "200 MW", q = "40 Mvar" }'
    others = """loads.works = { bus = "b2", p = "200 MW", q = "40 Mvar", k_pf = 1.5, active.i = 0.6, active.p = 0.4 }
loads.solar = { bus = "b3", p = "-150 MW", q = "20 Mvar" }
loads.wind = { bus = "b2", p = "-50 MW", active = "power", reactive = "impedance" }"""
    ready = prepared(tmp_path, works, others)
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        assert find_operating_point(master).residual < 1e-9
        master.run(0.1)
        grid = master.components["grid"]
        drawn = grid.get(["town.p", "works.p", "solar.p", "solar.q", "wind.p"])
        assert np.array(list(drawn.values())) == pytest.approx([5, 2, -1.5, 0.2, -0.5], abs=1e-6)
        assert grid.get(["town.tau"]) == {"town.tau": 0.002}


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ('active = "constant"', "active"),
        (
            "active = { z = 0.5 }",
            "load 'town': the shares of its active power are z = 0.5.*must sum to 1",
        ),
        (
            'active = "power"\nv_min = 0.1',
            "load 'town' has a share of constant power down to v_min = 0.1 pu",
        ),
        (
            'active = "power"\ntau = "1 us"',
            r"load 'town' has the lag tau = 1e-06 s; in this network it must be from",
        ),
    ],
)
def test_what_is_wrong_is_named(law, words, tmp_path):
    with pytest.raises(CaseError, match=words):
        prepared(tmp_path, laws=f"[network.load_model]\n{law}\n")
