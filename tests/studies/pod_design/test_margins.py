"""Margins of a setting's gain, on a plant whose modes are lost at gains that a formula gives."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from orchestrator.studies.pod_design import margins as module
from orchestrator.studies.pod_design import one_form
from orchestrator.studies.pod_design.design import PodDesign
from orchestrator.studies.pod_design.margins import compute_margins
from tests.studies.pod_design.plant import Plant, gain_for

WORSE = Plant(modes=(-0.4 + 4j, -0.5 + 6j), slopes=(-0.01 + 0j, 0.01 + 0j))
"""The target gains damping, the other mode loses it."""
EDGE = 2**0.5 * (2**0.5 - 1) / 16
"""How finely an edge between 1.4 and 2 times the gain is sought."""


def margins(plant, gain, least):
    return compute_margins(
        plant, plant.off, plant.place(plant.off, gain), least, lambda stage: None
    )


def test_the_gain_may_rise_until_another_mode_is_lost():
    found = margins(WORSE, 20.0, 0.03)
    factor = gain_for(-0.5 + 6j, 0.01, 0.03) / 20
    assert found.limit == 0.03
    assert found.up <= factor <= found.up + EDGE
    assert found.lost_up.imag == pytest.approx(6.0)
    assert (found.down, found.lost_down) == (None, None), (
        "without the controller all modes are there"
    )


@pytest.mark.parametrize(("contradicted", "whole"), [(0.0, 1), (0.01, 14)])
def test_one_schur_form_gives_the_same_margins(monkeypatch, contradicted, whole):
    """All eigenvalues are computed with the controller off, and with each gain where the form is found to be wrong."""
    expected, computed, extremes = margins(WORSE, 20.0, 0.03), [], module.extremes
    plant = replace(WORSE)
    spectrum = plant.spectrum

    def other(setting):
        found = spectrum(setting)
        return replace(found, eigenvalues=found.eigenvalues - contradicted)

    monkeypatch.setattr(plant, "spectrum", other)
    monkeypatch.setattr(one_form, "LEAST_CHANGED", 0)
    monkeypatch.setattr(module, "extremes", lambda model: computed.append(model) or extremes(model))
    found = margins(plant, 20.0, 0.03)
    assert len(computed) == whole
    assert (found.up, found.down) == (expected.up, expected.down)
    assert found.lost_up == pytest.approx(expected.lost_up)


def test_a_mode_that_is_below_the_limit_already_lowers_it():
    found = margins(WORSE, 40.0, 0.05)
    assert found.limit == pytest.approx(0.1 / abs(-0.1 + 6j))
    assert found.up < 1.1


def test_the_gain_may_fall_until_the_target_is_lost():
    plant = Plant(modes=(0.1 + 4j,))
    found = margins(plant, 40.0, 0.03)
    factor = gain_for(0.1 + 4j, -0.01, 0.03) / 40
    assert found.down == pytest.approx(factor, abs=0.03)
    assert found.down >= factor
    assert (found.up, found.lost_up) == (None, None)


def test_errors_of_the_gain_move_the_target():
    found = margins(Plant(), 20.0, 0.03)
    assert found.variations == {
        "K +20 %": pytest.approx(0.64 / abs(-0.64 + 4j)),
        "K -20 %": pytest.approx(0.56 / abs(-0.56 + 4j)),
    }


@pytest.mark.parametrize(
    ("required", "met", "thin"), [(0.155, True, False), (0.17, True, True), (0.17, False, False)]
)
def test_a_requirement_that_a_larger_gain_loses_has_no_margin(required, met, thin):
    """With 20 % more gain the target has 16 % of damping."""
    found = margins(Plant(), 20.0, 0.03)
    design = SimpleNamespace(margins=found, met=met, required_damping=required)
    there = PodDesign.thin_margin.fget(design)
    assert there == (pytest.approx(found.variations["K +20 %"]) if thin else None)
    assert (
        PodDesign.thin_margin.fget(SimpleNamespace(margins=None, met=True, required_damping=0.5))
        is None
    )
