"""A loop that rests within its dead band, and grows beyond it, is told beside modes that do not show it."""

from dataclasses import replace

import pytest

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


def test_a_loop_that_grows_beyond_its_band_is_told_with_its_mode(prepared):
    found = of_plant(prepared, "18 5", "-0.01 0.01")
    assert found.stability.stable is not False
    (text,) = growth_beyond_dead_bands([found, found])
    closed = of_plant(prepared, "18 5", "0 0").stability  # as a planner types it
    assert closed.stable is False
    assert f"{closed.mode.frequency_hz:.3g} Hz with {closed.mode.damping_percent:.2f} %" in text
    assert text.endswith(" --set gfor3.plant.dbd1=0 --set gfor3.plant.dbd2=0")


@pytest.mark.parametrize(
    ("gains", "band"), [("0.1 0.1", "-0.01 0.01"), ("18 5", "0 0"), ("18 5", "-1 1")]
)
def test_a_loop_that_is_damped_beyond_its_band_or_has_none_is_not_told(gains, band, prepared):
    assert growth_beyond_dead_bands([of_plant(prepared, gains, band)]) == []


def test_a_band_that_is_meant_is_not_told(prepared):
    found = of_plant(prepared, "18 5", "-0.01 0.01")
    case = found.prepared.case
    table = case.table.model_copy(update={"meant": ["gfor3.plant.dbd1"]})
    meant = replace(found.prepared, case=replace(case, table=table))
    assert growth_beyond_dead_bands([replace(found, prepared=meant)]) == []
