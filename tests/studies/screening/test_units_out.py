"""Units out of service: the grid has fewer inputs then, and every outage is computed."""

from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening import modes
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening


@pytest.fixture(scope="module")
def case():
    return load_case("ieee39")


def screened(case, tmp_path, text, outages=None, scenario="base", sharing=None):
    tmp_path.mkdir(exist_ok=True)
    path = tmp_path / "points.csv"
    path.write_text(text)
    plan = plan_screening(case, ScreeningRequest(path, outages, scenario, sharing=sharing))
    return run_screening(plan, Work(Serial(), PointStore(tmp_path / "points")))


def critical(item):
    return item.record.eigenvalues[list(item.record.critical)]


def switched_off(case, scenario, unit):
    """Critical modes of the whole spectrum where the unit is left in the model, and the slack feeds its power."""
    case = replace(case, sharing=SharingRule.SLACK)
    (prepared,) = case.prepare([scenario], {f"{unit}.connected": False})
    return [
        m.eigenvalue
        for m in find_modes(compute_modes(prepared).system, 0.1, 2.0)
        if m.damping_ratio <= 0.2
    ]


def test_outages_of_units_have_the_modes_of_units_switched_off(case, tmp_path):
    """The slack feeds their power."""
    result = screened(case, tmp_path, "name\nonly\n", "sg33", sharing=SharingRule.SLACK)
    assert [item.record.status for item in result.items] == [Status.COMPUTED] * 2
    _, lost = result.items
    assert critical(lost) == pytest.approx(switched_off(case, "base", "sg33"), rel=1e-6)


def test_a_unit_that_returns_has_the_modes_of_the_intact_network(case, tmp_path):
    """The first point knows fewer inputs of the grid than the second one."""
    out, back = screened(case, tmp_path, "name,sg36.in_service\nout,0\nback,1\n").items
    (alone,) = screened(case, tmp_path, "name\nback\n").items
    assert len(out.record.shares) == len(back.record.shares) - 1
    assert critical(back) == pytest.approx(critical(alone), rel=1e-6)


@pytest.mark.slow
def test_all_eigenvalues_are_computed_where_a_search_does_not_converge(case, tmp_path):
    """Without this unit, Arnoldi's method finds 19 of 20 eigenvalues around one of its points."""
    text = "name,load,generation,sg36.{}\nlow,0.9,0.9,{}\n"
    (out,) = screened(case, tmp_path, text.format("in_service", 0), scenario="gfor").items
    (switch,) = screened(case, tmp_path, text.format("connected", "false"), scenario="gfor").items
    assert out.record.counted
    assert critical(out) == pytest.approx(critical(switch), rel=1e-6)


@pytest.mark.parametrize("search", ["find_critical_modes", "misses_modes"])
def test_a_search_without_an_end_gives_way_to_all_eigenvalues(tmp_path, monkeypatch, search):
    def without_an_end(*_):
        raise AnalysisError("the search does not converge")

    two_area = load_case("two_area")
    (expected,) = screened(two_area, tmp_path / "all", "name\nonly\n").items
    monkeypatch.setattr(modes, "DENSE", 10)
    monkeypatch.setattr(modes, search, without_an_end)
    (found,) = screened(two_area, tmp_path / "search", "name\nonly\n").items
    assert critical(found) == pytest.approx(critical(expected), rel=1e-6)
    monkeypatch.setattr(modes, "MOST_COUNTED", 10)
    (refused,) = screened(two_area, tmp_path / "large", "name\nonly\n").items
    assert (refused.record.status, refused.record.text) == (
        Status.MODES,
        "the search does not converge",
    )


@pytest.mark.parametrize(("scenario", "told"), [("manual", True), ("thyristor", False)])
def test_an_outage_says_that_its_power_flow_holds_the_voltage_of_a_constant_field(
    scenario, told, tmp_path
):
    result = screened(load_case("kundur"), tmp_path, "name\nonly\n", "tie_7_8_1", scenario)
    intact, lost = result.items
    words = "the new power flow holds the voltages of machines whose field no exciter moves"
    assert not any(words in text for text in intact.record.warnings)
    assert any(words in text for text in lost.record.warnings) == told
