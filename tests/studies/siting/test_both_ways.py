"""A POD's place by following the swings, as in a large network, by one Schur form for all settings, and by all
eigenvalues of every setting: the same."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.spectra import slowest_decay, stability
from orchestrator.studies.pod_design import one_form
from orchestrator.studies.siting import least_damping
from orchestrator.studies.siting.study import SiteRequest, find_sites

CLOSE = 1e-6
PLACES = (("wscc9", "pod_p"), ("wscc9", "pod_q"), ("ieee39", "pod_p"))


@pytest.fixture
def settings(monkeypatch):
    """Settings whose eigenvalues were all computed."""
    found = set()
    whole = least_damping.LeastDamping.all_values

    def all_values(self, setting):
        found.add(setting)
        return whole(self, setting)

    monkeypatch.setattr(least_damping.LeastDamping, "all_values", all_values)
    return found


def by_following(monkeypatch):
    monkeypatch.setattr(least_damping, "MOST_WHOLE", 0)
    monkeypatch.setattr(slowest_decay, "LEAST_STATES", 0)


def by_search(monkeypatch):
    by_following(monkeypatch)
    for module in (least_damping, stability):
        monkeypatch.setattr(module, "WHOLE", 0)
    monkeypatch.setattr(least_damping, "FOLLOWED", 3)


def by_one_form(monkeypatch):
    monkeypatch.setattr(one_form, "LEAST_CHANGED", 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "device", "way"),
    [
        ("wscc9", "pod_p", by_search),
        *((*places, way) for places in PLACES for way in (by_following, by_one_form)),
    ],
)
def test_a_place_has_the_same_figures_both_ways(case, device, way, settings, monkeypatch):
    request = SiteRequest(device, confirm=1)
    whole = find_sites(load_case(case), request)
    every = len(settings)
    settings.clear()
    way(monkeypatch)
    followed = find_sites(load_case(case), request)
    assert len(settings) < every
    assert followed.ranking == whole.ranking
    (one,), (other,) = followed.confirmations, whole.confirmations
    assert (one.bus, one.stable, one.failure) == (other.bus, other.stable, "")
    assert one.setting == other.setting
    assert one.search.next_gain == other.search.next_gain
    for mine, theirs in (
        (one.predicted, other.predicted),
        (one.coupled, other.coupled),
        (one.with_device, other.with_device),
        (one.tuned, other.tuned),
        (one.least, other.least),
    ):
        assert abs(mine - theirs) <= CLOSE * abs(theirs)
