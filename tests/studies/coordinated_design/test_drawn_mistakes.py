"""Bands of frequencies, and settings as a parameter file has them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eig

from orchestrator.studies.coordinated_design import view
from orchestrator.studies.coordinated_design.objective import (
    ALLOWED,
    BANDS_HZ,
    RatedPoint,
    Watched,
    Worth,
    band_of,
    floors_of,
)
from orchestrator.studies.coordinated_design.point import PointModes
from orchestrator.studies.coordinated_design.search import SettingSearch, Tried, _Program
from orchestrator.studies.coordinated_design.settings import PodGroup
from orchestrator.studies.coordinated_design.study import values_of
from orchestrator.studies.coordinated_design.verdict import least_of
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import LeadLag


@pytest.mark.parametrize("place", range(len(BANDS_HZ)))
def test_a_band_begins_at_its_frequency(place):
    below, above = (
        complex(-0.1, 2 * np.pi * BANDS_HZ[place] * factor) for factor in (0.999, 1.001)
    )
    assert (band_of(below), band_of(above)) == (place, place + 1)


def test_a_band_keeps_the_damping_that_it_has_where_that_is_below_the_bound():
    weak = 2 * np.pi * complex(-0.01, np.sqrt(1 - 0.01**2))  # 1 Hz, 1 %
    floors = floors_of([weak], 0.05)
    assert floors.pop(band_of(weak)) == pytest.approx(0.01 - ALLOWED)
    assert set(floors.values()) == {0.05}


def test_a_residue_is_what_a_small_gain_moves():
    rng = np.random.default_rng(3)
    A, U, V = rng.normal(size=(4, 4)), rng.normal(size=(4, 1)), rng.normal(size=(1, 4))
    values, left, right = eig(A, left=True)
    point = SimpleNamespace(loops=SimpleNamespace(U=U, V=V))
    (residue,) = RatedPoint._residues(point, 0, left, 3 * right)
    moved = np.linalg.eigvals(A + 1e-6 * U @ V)
    assert residue == pytest.approx(
        (moved[np.argmin(abs(moved - values[0]))] - values[0]) / 1e-6, rel=1e-4
    )


@pytest.mark.parametrize(("gain", "enabled"), [(0.0, False), (123.456789012, True)])
def test_a_controller_without_gain_is_switched_off(gain, enabled):
    setting = PodSetting(gain, LeadLag(T_S1=0.2, T_S2=0.05, N_S=2))
    values = values_of([PodGroup("pod_p", ("gfor1", "gfor2"), ("gfor*",), 2)], [setting])
    assert values["gfor*.pod_p.enabled"] is enabled
    if not enabled:
        assert set(values) == {"gfor*.pod_p.enabled"}, "no setting is written for nothing"
        return
    assert values["gfor*.pod_p.K"] == pytest.approx(gain, rel=1e-7)
    assert (values["gfor*.pod_p.T_S1"], values["gfor*.pod_p.T_S2"], values["gfor*.pod_p.N_S"]) == (
        0.2,
        0.05,
        2,
    )


@pytest.mark.parametrize(("groups", "alone"), [(1, 0), (2, 2)])
def test_as_many_starts_as_were_asked_for_are_improved(groups, alone, monkeypatch):
    """Those of each group alone come on top."""
    search = SettingSearch(SimpleNamespace(groups=["a", "b"][:groups]), ())
    improved = []
    monkeypatch.setattr(search, "tried", lambda x: Tried(x, Worth(0.1, -1.0)))
    monkeypatch.setattr(search, "_coarse", lambda: (np.array([float(k), 0.0]) for k in range(9)))
    monkeypatch.setattr(
        search, "_alone", lambda: [search.tried(np.array([-5.0 - k, 0.0])) for k in range(alone)]
    )
    monkeypatch.setattr(search, "improved", lambda one: improved.append(one) or one)
    search.best(3, polish=False)
    assert len(improved) == alone + 3


def test_the_table_of_points_says_what_is_allowed_and_why_not():
    modes = SimpleNamespace(computed=True, status="computed", warnings=("w",))
    where = {"point": SimpleNamespace(name="p1", hours=2), "outage": SimpleNamespace(name="tie")}
    point = SimpleNamespace(
        **where,
        before=modes,
        after=modes,
        stable=True,
        target_before=None,
        target=None,
        least_before=None,
        least=None,
        worth=SimpleNamespace(allowed=False),
        why_not="n",
    )
    table = view.points_table(SimpleNamespace(points=[point], names=(), some_apart=False))
    assert {
        c.name: c.cell(point)
        for c in table.columns
        if c.name in ("outage", "allowed", "why", "stable")
    } == {"outage": "tie", "allowed": "false", "why": "n; w", "stable": "true"}


@pytest.mark.parametrize(
    ("others", "wanted"),
    [
        ((), 0.1),
        ((PointModes(Status.COMPUTED, values=np.array([-0.5 + 5j, -0.5 - 5j])),), 0.1),
        ((PointModes(Status.COMPUTED, values=np.array([0.5 + 5j, 0.5 - 5j])),), None),
        ((PointModes(Status.POWER_FLOW),), None),
    ],
)
def test_the_least_damping_needs_modes_at_every_point_and_no_growth(others, wanted):
    damped = 5 * complex(-0.1, np.sqrt(1 - 0.1**2))
    points = [PointModes(Status.COMPUTED, values=np.array([damped, damped.conjugate()])), *others]
    aim = SimpleNamespace(names=(), least=0.05)
    found = least_of(points, aim)
    assert found == (None if wanted is None else pytest.approx(wanted, rel=0.01))


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_a_step_goes_where_the_damping_rises_and_no_further_than_trusted(slope):
    mode = Watched(5 * complex(-0.1, 1.0), 0, None)
    program = _Program([(mode, np.array([slope]))], np.array([-1.0]), np.array([0.2]))
    assert program.change(0.1) == pytest.approx([np.copysign(0.1, slope)])
    assert program.change(0.5) == pytest.approx([0.2 if slope > 0 else -0.5])
