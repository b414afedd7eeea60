"""Shunts that switch: their events, their power flow while they are off, and their admittance."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from orchestrator.systems.coupling.events import ShuntSwitching
from tests.cases.events.test_switching import RING, watch

TRIP = '[[events]]\ntype = "shunt_trip"\ntime = "0.1 s"\nshunt = "bank"\n'
BACK = '[[events]]\ntype = "shunt_reconnection"\ntime = "0.3 s"\nshunt = "bank"\n'


def prepared(folder, text, overrides=None, base=RING):
    (folder / "case.toml").write_text(base + text, encoding="utf-8")
    return load_case(folder / "case.toml").prepare((), overrides)[0]


@pytest.mark.parametrize("b", ["90 Mvar", "-90 Mvar"])
def test_a_shunt_trips_and_comes_back(b, tmp_path):
    base = RING.replace('b = "30 Mvar"', f'b = "{b}", g = "5 MW"')
    ready = prepared(tmp_path, TRIP + BACK, base=base)
    assert ready.events == (
        ShuntSwitching(0.1, "grid", "bank", False),
        ShuntSwitching(0.3, "grid", "bank", True),
    )
    before, off, back = (
        row["grid.b3.v"] for row in watch(ready, ("grid.b3.v",), (0.09, 0.29, 0.39))
    )
    assert (before - off) * (1 if b == "90 Mvar" else -1) > 0.002
    assert abs(back - before) < 0.5 * abs(off - before)


@pytest.mark.parametrize("b", ["90 Mvar", "-90 Mvar"])
def test_the_power_flow_knows_a_shunt_that_is_off(b, tmp_path):
    base = RING.replace('b = "30 Mvar"', f'b = "{b}"')
    off = prepared(tmp_path, BACK.replace("0.3", "0.1"), {"grid.bank.connected": False}, base)
    left = 0.09 if b == "90 Mvar" else 1e-9  # a thousandth of an open capacitor stays
    without = prepared(tmp_path, "", None, RING.replace('b = "30 Mvar"', f'b = "{left} Mvar"'))
    assert off.power_flow.voltages["b3"] == pytest.approx(
        without.power_flow.voltages["b3"], abs=1e-9
    )
    (standing,) = watch(off, ("grid.b3.v",), (0.0999,))
    assert standing["grid.b3.v"] == pytest.approx(abs(off.power_flow.voltages["b3"]), abs=1e-6)


def test_an_unknown_shunt_is_named(tmp_path):
    with pytest.raises(CaseError, match="component 'grid' has no shunt 'bnak'"):
        prepared(tmp_path, TRIP.replace("bank", "bnak"))


def test_a_grid_without_such_events_has_no_breaker(tmp_path):
    ready = prepared(tmp_path, "")
    assert "bank.connected" not in ready.system.components["grid"].description.variables
