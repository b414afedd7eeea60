"""A system too large for all its eigenvalues: which modes are shown, and what is said of it."""

import pytest

import orchestrator as gfor
from orchestrator.linear.spectra import stability
from orchestrator.studies.modes import modes as study

FEW = 50  # states from which on a system counts as too large here; those of nine buses are 72


@pytest.fixture
def large(monkeypatch):
    for place in (study, stability):
        monkeypatch.setattr(place, "WHOLE", FEW)


def test_modes_are_searched_where_there_are_too_many_states_for_all(large, monkeypatch):
    """The modes below 20 % are those of the full spectrum, and so is the verdict."""
    found = gfor.load("wscc9").scenario("base").modes().result
    monkeypatch.undo()
    whole = gfor.load("wscc9").scenario("base").modes().result
    below = [mode.eigenvalue for mode in whole.modes if mode.damping_ratio < study.SPARSE_BELOW]
    assert 0 < len(below) < len(whole.modes)
    assert [mode.eigenvalue for mode in found.modes] == pytest.approx(below, rel=1e-6)
    assert found.stability.stable is whole.stability.stable is False  # the common speed drifts
    assert found.stability.growing == whole.stability.growing
    rate = pytest.approx(whole.stability.largest_growth_rate, rel=1e-6)
    assert found.stability.largest_growth_rate == rate
    said = [text for text in found.warnings if "too many for all eigenvalues" in text]
    assert len(said) == 1
    assert f"at most {FEW}" in said[0]
    assert "--critical" in said[0]


def test_a_damping_that_is_asked_for_is_taken(large):
    found = gfor.load("wscc9").scenario("base").modes(critical=6).result
    assert all(mode.damping_ratio <= 0.06 for mode in found.modes)
    assert not any("too many for all eigenvalues" in text for text in found.warnings)
