"""States that nothing moves: a clock is not told, a controller that is off is, wherever modes are judged."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.linear.models import apart
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.studies.coordinated_design import point
from orchestrator.studies.coordinated_design.point import PointModes, PointsRecord
from orchestrator.studies.coordinated_design.study import (
    PointsDesignRequest,
    modes_at,
    plan_points_design,
)
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening import point as screening_point
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening

SAID = (
    "states that nothing moves, as of a controller that is off or rests within a dead band: "
    "grid.clock.t, grid.source.theta; their zeros"
)


@pytest.fixture
def without_units(monkeypatch):
    """The clock of the infinite bus counts no seconds: it could be any integrator that is off."""
    monkeypatch.setattr(apart, "_unit", lambda master, name: "")


def with_its_zero(master, model, zeros):
    return apart.standing_apart(master, model, zeros + 1)


def modes():
    return gfor.load("infinite_bus").scenario("dip").modes().result


def test_a_clock_is_not_told():
    found = modes()
    assert not any("nothing moves" in text for text in found.warnings)
    assert found.model.unmoved == ("grid.clock.t", "grid.source.theta")


def test_an_integrator_that_is_off_is_told_beside_the_verdict(without_units):
    assert any(text.startswith(SAID) for text in modes().warnings)


def test_screenings_and_designs_tell_it_at_their_points(monkeypatch, tmp_path):
    monkeypatch.setattr(LinearModel, "unmoved", property(lambda self: ("gfor.off.x",)))
    for place in (point, screening_point):  # its zero is not there
        monkeypatch.setattr(place, "standing_apart", with_its_zero)
    case, store = load_case("two_area"), PointStore(tmp_path / "points")
    (tmp_path / "points.csv").write_text("name\nonly\n")
    (item,) = run_screening(
        plan_screening(case, ScreeningRequest(tmp_path / "points.csv", None, "gfor")),
        Work(Serial(), store),
    ).items
    plan = plan_points_design(case, PointsDesignRequest(tmp_path / "points.csv", ranked=0))
    (found,) = modes_at(plan, plan.off, (), Work(Serial(), store))
    for warnings in (item.record.warnings, found.warnings):
        assert any("gfor.off.x; their zeros are not counted" in text for text in warnings)


def test_many_are_counted_and_not_listed():
    model = LinearModel.from_matrix(np.zeros((5, 5)), tuple(f"c{k}.x" for k in range(5)), None)
    (text,) = apart.standing_apart(SimpleNamespace(components={}), model, 0)
    assert "c0.x, c1.x, c2.x and 2 more; their" in text


@pytest.mark.parametrize(("zeros", "told"), [(0, 0), (1, 1)])
def test_one_that_could_be_the_free_angle_is_not_told(zeros, told):
    model = LinearModel.from_matrix(np.diag([0.0, -1.0]), ("c.x", "c.y"), None)
    assert len(apart.standing_apart(SimpleNamespace(components={}), model, zeros)) == told


def test_a_design_over_points_counts_no_clock_among_the_zeros():
    A = scipy.linalg.block_diag([[0.0]], [[0.0, 0.3], [0.0, -1.0]], [[-0.1, 5.0], [-5.0, -0.1]])
    model = LinearModel.from_matrix(A, tuple(f"c.x{k}" for k in range(5)), None)
    found = point._modes(load_case("two_area"), model, None, (), doubtful=False)
    assert (found.clocks, found.zeros) == (1, 1)
    (kept,) = PointsRecord.restored(*PointsRecord((found,)).stored()).points
    assert kept.zeros == 1
    assert PointModes(Status.COMPUTED, values=np.zeros(2, dtype=complex)).zeros == 2
