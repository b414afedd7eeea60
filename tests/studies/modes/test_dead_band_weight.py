"""A loop that rests within its dead band, and grows beyond it, is told beside modes that do not show it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.studies.modes import dead_band_weight
from orchestrator.studies.modes.dead_band_weight import growth_beyond_dead_bands
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_dyr_following import dyr, prepared
from tests.cases.networks.psse.test_dyr_plants import PLANT

__all__ = ["prepared"]  # the fixture

GAINS, BAND = " 18 5 ", "-1 1 0.43 -0.43"
"""Kp and Ki of the record, and the dead band with the limits behind it, which the mill asks more of."""


def of_plant(prepared, gains, band):
    plant = PLANT.format("1").replace(GAINS, f" {gains} ").replace(BAND, f"{band} 2 -2")
    return compute_modes(prepared(dyr(plant=plant), ""))


@pytest.fixture(params=["whole", "growing mode alone"])
def way(request, monkeypatch):
    """How the growth is found: by all modes with the band at 0, or as in a system too large for that."""
    if request.param != "whole":
        monkeypatch.setattr(dead_band_weight, "_MOST_STATES", 0)


def test_a_loop_that_grows_beyond_its_band_is_told_with_its_mode(prepared, way):
    found = of_plant(prepared, "18 5", "-0.01 0.01")
    assert found.stability.stable is not False
    (text,) = growth_beyond_dead_bands([found, found])
    closed = of_plant(prepared, "18 5", "0 0")  # as a planner types it
    assert closed.stability.stable is False
    values = np.linalg.eigvals(closed.system.A)
    fastest = values[np.argmax(values.real)]
    hertz, damping = abs(fastest.imag) / (2 * np.pi), -100 * fastest.real / abs(fastest)
    told = re.search(r"([\d.]+) Hz with (-[\d.]+) % damping", text)
    assert float(told[1]) == pytest.approx(hertz, rel=5e-3)
    assert float(told[2]) == pytest.approx(damping, abs=0.1)
    assert text.endswith(" --set gfor3.plant.dbd1=0 --set gfor3.plant.dbd2=0")


def test_the_limit_cycle_is_where_the_band_lets_through_what_the_loop_can_bear(prepared, way):
    """At the told swing the loop with the gain of the band's describing function neither grows nor decays."""
    found = of_plant(prepared, "18 5", "-0.01 0.01")
    (text,) = growth_beyond_dead_bands([found])
    hertz = float(re.search(r"limit cycle of about ([\d.]+) Hz", text)[1])
    swing = float(re.search(r"more than ([\d.]+) times the band", text)[1])
    angle = np.linspace(0, 2 * np.pi, 4001)[:-1]
    passed = swing * np.sin(angle)
    passed -= np.clip(passed, -1, 1)
    gain = 2 * (passed * np.sin(angle)).mean() / swing
    whole = of_plant(prepared, "18 5", "0 0").system.A
    values = np.linalg.eigvals(found.system.A + gain * (whole - found.system.A))
    swings = values[values.imag > 2 * np.pi]
    (nearest,) = swings[np.argsort(-swings.real)][:1]
    assert nearest.imag / (2 * np.pi) == pytest.approx(hertz, rel=0.02)
    assert abs(nearest.real) < 0.02 * abs(nearest)


@pytest.mark.parametrize(
    ("gains", "band"), [("0.1 0.1", "-0.01 0.01"), ("18 5", "0 0"), ("18 5", "-1 1")]
)
def test_a_loop_that_is_damped_beyond_its_band_or_has_none_is_not_told(gains, band, prepared, way):
    assert growth_beyond_dead_bands([of_plant(prepared, gains, band)]) == []


def test_a_band_that_is_meant_is_not_told(prepared):
    found = of_plant(prepared, "18 5", "-0.01 0.01")
    case = found.prepared.case
    table = case.table.model_copy(update={"meant": ["gfor3.plant.dbd1"]})
    meant = replace(found.prepared, case=replace(case, table=table))
    assert growth_beyond_dead_bands([replace(found, prepared=meant)]) == []
