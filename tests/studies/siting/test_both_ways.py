"""A POD's place by following the swings, as in a large network, by one Schur form for all settings, and by all
eigenvalues of every setting: the same."""

from functools import cache

import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.spectra import slowest_decay, stability
from orchestrator.studies.pod_design import one_form
from orchestrator.studies.siting import least_damping
from orchestrator.studies.siting.study import SiteRequest, find_sites

CLOSE = 1e-6
PLACES = (("wscc9", "pod_p"), ("wscc9", "pod_q"), ("ieee39", "pod_p"))


def sites(case, device):
    """The ranking with a confirmation, and of how many settings all eigenvalues were computed."""
    settings, whole = set(), least_damping.LeastDamping.all_values

    def all_values(self, setting):
        settings.add(setting)
        return whole(self, setting)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(least_damping.LeastDamping, "all_values", all_values)
        found = find_sites(load_case(case), SiteRequest(device, confirm=1))
    return found.ranking, found.confirmations, len(settings)


all_eigenvalues = cache(sites)
"""By all eigenvalues of every setting; each way is held against it."""


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
def test_a_place_has_the_same_figures_both_ways(case, device, way, monkeypatch):
    ranking, (other,), every = all_eigenvalues(case, device)
    way(monkeypatch)
    same, (one,), few = sites(case, device)
    assert few < every
    assert same == ranking
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
