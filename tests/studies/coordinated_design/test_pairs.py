"""Pairs of controllers and converters, controllers that bring nothing, and gains at their bound."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.coordinated_design.objective import Aim, RatedPoint
from orchestrator.studies.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.studies.coordinated_design.search import SettingSearch
from orchestrator.studies.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.studies.coordinated_design.study import PointsDesign, PointsDesignRequest, _pairs
from orchestrator.studies.coordinated_design.words import about_settings
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from tests.studies.coordinated_design.test_modes_apart import network

A, B = PodPlace("A", "pod_p"), PodPlace("B", "pod_q")
GROUPS = [PodGroup("pod_p", ("A",), ("A",), 2), PodGroup("pod_q", ("B",), ("B",), 2)]


@pytest.mark.parametrize(
    ("controllers", "components", "pairs"),
    [
        (("pod_p", "pod_q"), ("A", "B"), ["pod_p A", "pod_q B"]),
        (
            ("pod_p", "pod_q", "pod_p", "pod_q"),
            ("A", "A", "B", "B"),
            ["pod_p A", "pod_q A", "pod_p B", "pod_q B"],
        ),
        (("pod_p",), ("A", "B"), ["pod_p A", "pod_p B"]),
        (("pod_p", "pod_q"), ("gfor*",), ["pod_p gfor*", "pod_q gfor*"]),
        (("pod_p", "pod_q"), (), ["pod_p None", "pod_q None"]),
        (("pod_p", "pod_q"), ("A", "B", "C"), [f"pod_{x} {name}" for x in "pq" for name in "ABC"]),
    ],
)
def test_as_many_controllers_as_components_are_pairs(controllers, components, pairs):
    request = PointsDesignRequest("p.csv", controllers, components=components)
    assert [f"{controller} {pattern}" for controller, pattern in _pairs(request)] == pairs


def two_loops(second):
    """The loop of A, and one of B that acts so much less."""
    one = network(reach=2e-2)
    return OpenLoops.of(
        one.A, np.hstack([one.U, second * one.U]), np.vstack([one.V, one.V]), [A, B], one.names
    )


@pytest.mark.parametrize(("second", "kept"), [(1e-9, [True, False]), (1.0, [True, True])])
def test_a_gain_that_brings_nothing_is_dropped(second, kept):
    rated = RatedPoint(0, two_loops(second), Aim((), 0.05), {A: 400.0, B: 400.0})
    space = SettingSpace(GROUPS, (0.0, 400.0), 6.0)
    search = SettingSearch(space, [rated])
    found = search.tried(space.vector([33.0, 33.0], [1.0, 1.0], [20.0, 20.0]))
    fewer = search.without_idle(found, None)
    assert [bool(one.gain) for one in space.group_settings(fewer.x)] == kept
    assert fewer.merit >= found.merit - 1e-3


def test_what_is_wanted_is_not_given_away_with_a_small_gain():
    """Without B's hundredth of a point the design would fall short."""
    loops = two_loops(1e-3)
    rated = RatedPoint(0, loops, Aim((), 0.05), {A: 400.0, B: 400.0})
    space = SettingSpace(GROUPS, (0.0, 400.0), 6.0)
    search = SettingSearch(space, [rated])
    found = search.tried(space.vector([33.0, 33.0], [1.0, 1.0], [20.0, 20.0]))
    assert not search.without_idle(found, None).x[5]
    assert search.without_idle(found, found.worth.worst).x[5]


def test_the_lowest_bound_of_a_gain_is_kept():
    rated = RatedPoint(0, two_loops(1e-9), Aim((), 0.05), {A: 400.0, B: 400.0})
    space = SettingSpace(GROUPS, (5.0, 400.0), 6.0)
    search = SettingSearch(space, [rated])
    found = search.tried(space.vector([33.0, 33.0], [1.0, 1.0], [20.0, 20.0]))
    assert search.without_idle(found, None).x[5] == found.x[5]


@pytest.mark.parametrize(("gain", "said"), [(400.0, True), (397.0, True), (390.0, False)])
def test_a_gain_at_its_bound_and_one_that_is_left_out_are_told(gain, said):
    request = SimpleNamespace(gain_bounds=(0.0, 400.0))
    plan = SimpleNamespace(groups=GROUPS, request=request)
    settings = tuple(PodSetting(each, NO_COMPENSATION) for each in (gain, 0.0))
    design = PointsDesign(plan, 6.0, settings, None, (), (), 0)
    texts = about_settings(design)
    assert texts[0] == "left out, as they bring less than 0.01 points of damping: B: pod_q"
    assert any("A: pod_p stands at its bound, 400 pu" in text for text in texts) is said
