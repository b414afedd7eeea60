"""What a design over points comes to, from modes that are given."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.coordinated_design import view
from orchestrator.studies.coordinated_design.objective import Aim
from orchestrator.studies.coordinated_design.point import PointModes
from orchestrator.studies.coordinated_design.verdict import PointsVerdict, judge_points, least_of
from orchestrator.studies.coordinated_design.words import verdict_sentence
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.operating_points.outages import Outage
from orchestrator.studies.operating_points.points_file import OperatingCase

WHERE = [(OperatingCase("now", 1.0, {}, (), "points.csv:2"), Outage("intact"))]


def modes(*pairs):
    """A spectrum of frequencies [Hz] and damping ratios, with the free angle."""
    values = [2 * np.pi * hertz * complex(-zeta, np.sqrt(1 - zeta**2)) for hertz, zeta in pairs]
    return PointModes(
        Status.COMPUTED,
        values=np.array([*values, *np.conj(values), 0.0]),
        swinging=(0,),
        who=("sg1",),
    )


def verdict(before, after, wanted, least=0.05):
    return PointsVerdict(
        list(judge_points(WHERE, [modes(*before)], [modes(*after)], Aim((), least), {})), wanted
    )


@pytest.mark.parametrize(
    ("beside", "left", "met"),
    [
        (0.20, 0.03, False),  # pushed below 5 %
        (0.20, 0.06, True),  # lower, and still above
        (0.04, 0.0395, True),  # was below already, and keeps what it has
        (0.04, 0.03, False),
        (0.20, -0.01, False),
    ],
)
@pytest.mark.parametrize("wanted", [0.1, None])
def test_a_design_that_harms_another_mode_is_not_met(beside, left, met, wanted):
    """The mode at 5 Hz is not one that the design damps; the one at 1 Hz has all that is wanted."""
    found = verdict([(1.0, 0.05), (5.0, beside)], [(1.0, 0.12), (5.0, left)], wanted)
    assert found.worst == pytest.approx(0.12)
    assert found.met is met
    assert len(found.harmed) == (not met)


def test_the_least_damped_of_all_modes_decides():
    assert verdict([(0.86, 0.053), (0.93, 0.053)], [(0.86, 0.062), (0.93, 0.198)], 0.1).met is False
    assert verdict([(0.86, 0.053), (0.93, 0.053)], [(0.86, 0.11), (0.93, 0.198)], 0.1).met is True


@pytest.mark.parametrize(("after", "unmoved"), [((0.934, 0.0901), False), ((0.942, 0.0720), True)])
def test_a_mode_that_gained_two_points_of_damping_was_moved(after, unmoved):
    found = verdict([(0.942, 0.0719)], [after], 0.09)
    assert found.limiting.unmoved is unmoved
    assert ("which these controllers hardly move" in verdict_sentence(found)) is unmoved


@pytest.mark.parametrize("thin", [None, 0.0957, 0.12])
def test_a_setting_that_more_gain_spoils_has_no_margin(thin):
    points = list(
        judge_points(WHERE, [modes((1.0, 0.05))], [modes((1.0, 0.1001))], Aim((), 0.05), {})
    )
    said = verdict_sentence(PointsVerdict(points, 0.1, thin=thin))
    assert said.startswith("REACHED: 10 %")
    assert ("; no margin: 9.57 % with gains of × 1.2" in said) is (thin == 0.0957)
    assert ("; no margin: another mode below its least damping" in said) is (thin == 0.12)


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
