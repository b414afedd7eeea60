"""What is said of growth beside the critical modes, of warnings, and of the scenario."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as face
from orchestrator.cases.case import load_case
from orchestrator.output.report.html.chapters.studies import of_screening
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening.record import ItemRecord
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening
from orchestrator.studies.screening.summary import Summary
from orchestrator.studies.screening.view import as_json, overview, remarks
from orchestrator.studies.screening.words import (
    above_the_range,
    by_outage,
    growth_in_short,
    growth_outside,
    verdict_sentence,
    what_was_counted,
)


@pytest.mark.parametrize(
    ("eigenvalues", "number", "fastest", "said"),
    [
        ([-1 + 5j], 0, None, ""),
        (
            [-1 + 5j],
            1,
            (0.25, 0.0),
            "1 eigenvalue grows outside of the range, by 0.25 1/s without an oscillation",
        ),
        (
            [-1 + 5j],
            2,
            (0.5, 4 * np.pi),
            "2 eigenvalues grow outside of the range, by 0.5 1/s at 2 Hz",
        ),
        (
            [-1 + 5j],
            2,
            None,
            "2 eigenvalues grow outside of the range; `gfor modes` shows how fast",
        ),
        (
            [-1 + 5j, 0.1 + 15j],
            0,
            None,
            "2 eigenvalues grow outside of the range, by 0.1 1/s at 2.39 Hz",
        ),
        (
            [-1 + 5j, 0.1 + 15j],
            2,
            (0.5, 4 * np.pi),
            "4 eigenvalues grow outside of the range, the fastest by 0.5 1/s at 2 Hz",
        ),
    ],
)
def test_growth_outside_has_its_rate(eigenvalues, number, fastest, said):
    record = ItemRecord(
        Status.COMPUTED,
        eigenvalues=np.array(eigenvalues),
        critical=(0,),
        growing_elsewhere=number,
        fastest=fastest,
    )
    assert growth_outside(record) == said


@pytest.fixture(scope="module")
def screened(tmp_path_factory):
    """The growing mode at 0.57 Hz lies below the range."""
    folder = tmp_path_factory.mktemp("words")
    path = folder / "points.csv"
    path.write_text("name,gfor.in_service,grid.load_2.P\nin,1,\nout,0,1250 MW\n")
    request = ScreeningRequest(path, None, "gfor", frequencies=(1.0, 2.0))
    plan = plan_screening(load_case("two_area"), request)
    for _ in range(2):  # computed, and then kept
        result = run_screening(plan, Work(Serial(), PointStore(folder / "points")))
    return result


def test_the_verdict_says_how_fast_the_worst_point_grows(screened):
    sentence = verdict_sentence(Summary(screened))
    assert sentence.startswith(
        "UNSTABLE: at 1 of 2 points and outages; worst: out, intact: 2 eigenvalues grow outside of the range, by "
    )
    assert sentence.endswith(" 1/s at 0.572 Hz")


def test_the_scenario_is_named(screened):
    assert what_was_counted(Summary(screened)).startswith("Scenario gfor: modes from 1 to 2 Hz")


def test_a_screening_without_outages_says_that_it_has_none(screened):
    """Who forgets to ask for them would else take the verdict for the answer to a line that is out."""
    assert "No outage was asked for" in what_was_counted(Summary(screened))
    plan = screened.plan
    lost = replace(plan.outages[0], name="line")
    asked = replace(screened, plan=replace(plan, outages=(*plan.outages, lost)))
    assert "No outage" not in what_was_counted(Summary(asked))


def test_a_warning_names_its_first_point(screened):
    items = [
        replace(item, record=replace(item.record, warnings=("a limit is close",)))
        for item in screened.items
    ]
    (text,) = remarks(Summary(replace(screened, items=items)))
    assert text == "at 2 of 2, first at in, intact: a limit is close"


def test_what_modes_warn_of_a_start_a_screening_warns_of_as_well():
    """A feedback of the field voltage at its limit leaves no sign in the steady state."""
    values = {"models": "phasor", "sg1.exciter": "esst3a", "sg1.exciter.K_G": 1.0}
    values["sg1.exciter.V_GMAX"] = 1.5
    found = face.load("kundur").screen(scenario="pss", values=values, outages=["sg2"])
    for item in found.result.items:
        (told,) = [text for text in item.record.warnings if "exciter.V_GMAX" in text]
        assert told.startswith("sg1: the feedback of its field voltage does not act")
    assert any(
        "at 2 of 2, first at intact: sg1: the feedback" in text for text in remarks(found.summary)
    )


def test_units_beyond_their_rating_are_in_the_verdict_and_the_report():
    """Where nothing grows, a steady state that no plant bears is no answer."""
    found = face.load("two_area").screen(
        {"usual": {}, "heavy": {"gfor.P_mw": 1600}}, scenario="gfor"
    )
    usual, heavy = (item.record for item in found.result.items)
    assert usual.beyond == {}
    assert heavy.beyond == {
        "gfor": pytest.approx(1600 / found.result.plan.prepared.values["gfor.S_n"], rel=0.05)
    }
    said = f"at 1 of 2 a unit is beyond its rating, most gfor with {100 * heavy.beyond['gfor']:.3g} % (heavy, intact)"
    assert found.stable
    assert found.verdict.endswith(f"; {said}")
    assert found.as_json()["beyond_rating"] == said
    chapter = of_screening(Path("screening.json"), found.as_json())
    assert chapter.answer == found.verdict  # which tells of it, as something that was judged
    assert said not in (*chapter.not_judged, *chapter.doubts)
    calm = replace(found.result, items=found.result.items[:1])
    assert "beyond its rating" not in verdict_sentence(Summary(calm))


def test_a_swing_that_grows_is_told_before_what_grows_beside_it(screened):
    """Of Kundur's system after an outage the slower growth outside of the range once stood alone in the verdict."""
    item = screened.items[0]
    grows = replace(
        item.record,
        stable=False,
        eigenvalues=np.array([0.2344 + 4.7276j]),
        critical=(0,),
        shares={"sg2": np.array([0.7]), "sg3": np.array([0.19])},
        growing_elsewhere=1,
        fastest=(0.0819, 0.0),
    )
    sentence = verdict_sentence(
        Summary(replace(screened, items=[replace(item, record=grows, trajectories=(0,))]))
    )
    swing = "0.752 Hz, -4.95 % (sg2 0.70, sg3 0.19)"
    beside = "1 eigenvalue grows outside of the range, by 0.0819 1/s without an oscillation"
    assert f": {swing}, and {beside}" in sentence


def drifting(item, rate, swing):
    """An item where the common speed drifts at a rate [1/s] beside one swing [rad/s]."""
    record = replace(
        item.record,
        stable=False,
        eigenvalues=np.array([swing]),
        critical=(0,),
        shares={"sg2": np.array([0.7]), "sg3": np.array([0.19])},
        growing_elsewhere=1,
        fastest=(rate, 0.0),
        drifts=True,
        reactive="",
        beyond={},
    )
    return replace(item, record=record, trajectories=(0,))


def test_a_drift_of_the_common_speed_alone_is_told_apart_from_the_swings(screened):
    """Of a case without governors all points were "UNSTABLE" by an eigenvalue without a name."""
    first, second = screened.items
    both = [drifting(first, 0.038, -0.2 + 8j), drifting(second, 0.108, -0.4 + 9j)]
    summary = Summary(replace(screened, items=both))
    assert verdict_sentence(summary) == (
        "UNSTABLE: at 2 of 2 points and outages: swings damped; the common speed drifts (+0.11 1/s, no governor), the "
        "fastest out, intact; least damped: in, intact: 1.273 Hz, 2.50 % (sg2 0.70, sg3 0.19)"
    )
    assert growth_in_short(both[1].record) == "+0.108 1/s: the common speed"
    mixed = [both[0], drifting(second, 0.01, 0.3 + 9j)]
    sentence = verdict_sentence(Summary(replace(screened, items=mixed)))
    assert (
        "worst: out, intact: 1.432 Hz, -3.33 % (sg2 0.70, sg3 0.19), and 1 eigenvalue" in sentence
    )
    assert "; at 1 of them only the common speed drifts" in sentence


def test_the_drift_of_a_case_without_governors_is_known_as_that_of_its_modes():
    found = face.load("wscc9").screen()
    (item,) = found.result.items
    stability = face.load("wscc9").scenario("base").modes().stability
    assert stability.only_common_speed
    assert item.record.drifts
    assert (
        f"the common speed drifts ({stability.largest_growth_rate:+.2g} 1/s, no governor)"
        in str(found.verdict)
    )


def test_what_was_searched_in_the_range_alone_is_not_stable(screened):
    """With many items growth elsewhere is counted at the ends of stretches only, in a large system."""
    calm = next(item for item in screened.items if item.record.stable)
    uncounted = replace(calm, record=replace(calm.record, stable=None, counted=False))
    summary = Summary(replace(screened, items=[calm, uncounted]))
    assert summary.stable is None
    assert "1 were searched only from 1 to 2 Hz above -30 % damping (--whole" in verdict_sentence(
        summary
    )


@pytest.mark.parametrize(("counted", "stable"), [(True, True), (False, None)])
def test_an_item_is_stable_only_where_all_growth_was_counted(
    monkeypatch, tmp_path, counted, stable
):
    monkeypatch.setattr("orchestrator.studies.screening.modes.DENSE", 0)
    monkeypatch.setattr("orchestrator.studies.screening.modes.MOST_COUNTED", 0)
    if not counted:
        monkeypatch.setattr("orchestrator.studies.screening.modes._elsewhere", lambda *_: None)
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.in_service\nin,1\n")
    plan = plan_screening(load_case("two_area"), ScreeningRequest(path, None, "gfor"))
    for _ in range(2):  # computed, and then kept
        result = run_screening(plan, Work(Serial(), PointStore(tmp_path / "points")))
    (item,) = result.items
    assert (item.record.stable, item.record.counted) == (stable, counted)
    if stable:
        assert (
            "what grows slower than 0.002 1/s outside of 0.1 to 2 Hz is seen near 0 Hz only"
            in verdict_sentence(Summary(result))
        )


def test_where_all_eigenvalues_are_known_nothing_is_left_out(screened):
    calm = next(item for item in screened.items if item.record.stable)
    summary = Summary(replace(screened, items=[calm, calm]))
    assert summary.slowest == 0.0
    assert verdict_sentence(summary).startswith(
        "stable: nothing grows at any of 2 points and outages"
    )
    assert "slower" not in verdict_sentence(summary)
    assert as_json(summary)["slowest_growth_counted"] == 0.0


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ((0, 0), "damping, of the system without a communication step: "),
        ((1, 1), "damping, of the map over a communication step: "),
        (
            (200, 200),
            "damping, of the map over 200 communication steps (0.02 s), after which sampled controllers repeat: ",
        ),
        (
            (0, 200),
            "of the system without a communication step at 1 of 2 items, of the map over 200 communication steps",
        ),
    ],
)
def test_the_head_says_of_which_system_the_modes_are(screened, steps, said):
    items = tuple(
        replace(item, record=replace(item.record, map_steps=n))
        for item, n in zip(screened.items, steps, strict=True)
    )
    assert screened.plan.prepared.step_size == 1e-4
    assert said in what_was_counted(Summary(replace(screened, items=items)))


def test_of_outages_that_grow_the_one_that_grows_fastest_is_the_worst():
    """A voltage that runs away within seconds has no damping ratio; the swing that is shown beside it hardly grows."""

    def item(outage, eigenvalues, stable=False, fastest=None):
        record = ItemRecord(
            Status.COMPUTED,
            eigenvalues=np.array(eigenvalues),
            critical=(0,),
            stable=stable,
            growing_elsewhere=int(fastest is not None),
            fastest=fastest,
            shares={"sg1": np.ones(len(eigenvalues), dtype=np.float32)},
        )
        return SimpleNamespace(record=record, outage=SimpleNamespace(name=outage, elements=()))

    items = (
        item("intact", [-0.001 + 9j], stable=True),
        item("line_1", [0.04 + 7j]),
        item("line_2", [-0.5 + 7j], fastest=(0.11, 0.0)),
        item("line_3", [-2 + 8j], stable=True),
    )
    order = [row.name for row in by_outage(SimpleNamespace(result=SimpleNamespace(items=items)))]
    assert order == ["line_2", "line_1", "intact", "line_3"]


@pytest.mark.parametrize(
    ("looked", "above", "said"),
    [
        (
            True,
            (-0.01, 18.4),
            "Not judged: above the range a machine swings: out, intact: 2.928 Hz, 0.05 % (sg1 0.86); "
            "--range 1:3 holds it.",
        ),
        (True, (-9.0, 18.4), ""),  # damped well
        (True, None, ""),
        (
            False,
            None,
            "Not judged: swings of machines from 2 to 3 Hz were not looked for; --range 1:3 does.",
        ),
    ],
)
def test_the_least_damped_swing_above_the_range_is_told(screened, looked, above, said):
    first, second = screened.items
    better = (-0.5, 15.0) if above else None
    items = (
        replace(first, record=replace(first.record, looked_above=looked, above=better)),
        replace(
            second,
            record=replace(second.record, looked_above=looked, above=above, who_above="sg1 0.86"),
        ),
    )
    if above == (-9.0, 18.4):
        items = (replace(items[0], record=replace(items[0].record, above=above)), items[1])
    summary = Summary(replace(screened, items=items))
    assert above_the_range(summary) == said
    assert as_json(summary)["above_the_range"] == (said or None)


def calm(screened, above, critical=(0,)):
    """Return the summary of two points with one mode of 1.5 Hz and 9.5 %, the second with a swing above the range."""
    one = ItemRecord(
        Status.COMPUTED,
        stable=True,
        counted=True,
        looked_above=True,
        eigenvalues=np.array([-0.9 + 9.425j]),
        critical=critical,
        shares={"sg1": np.ones(1, dtype=np.float32)},
    )
    records = (one, replace(one, above=above, who_above="sg1 0.86"))
    items = tuple(
        replace(item, record=record, trajectories=(0,))
        for item, record in zip(screened.items, records, strict=True)
    )
    return Summary(replace(screened, items=items))


@pytest.mark.parametrize(
    ("above", "critical", "said", "cell"),
    [
        (
            (-0.01, 18.4),
            (0,),
            "; least damped up to 2 Hz: in, intact: 1.500 Hz, 9.51 % (sg1 1.00), "
            "and LESS above: out, intact: 2.928 Hz, 0.05 % (sg1 0.86)",
            "9.51; 2.93 Hz above the range: 0.05",
        ),
        (
            (-0.83, 13.5),
            (),
            "; least damped, above 2 Hz: out, intact: 2.149 Hz, 6.14 % (sg1 0.86)",
            "20; 2.15 Hz above the range: 6.14",
        ),
    ],
    ids=["less than within", "nothing within"],
)
def test_a_swing_above_the_range_with_less_damping_stands_in_the_verdict_and_its_row(
    screened, above, critical, said, cell
):
    summary = calm(screened, above, critical)
    assert said in verdict_sentence(summary)
    assert cell in overview(summary).html()


def test_a_swing_above_the_range_with_more_damping_stands_in_neither(screened):
    summary = calm(screened, (-2.0, 18.4))
    assert "; least damped: in, intact: 1.500 Hz, 9.51 %" in verdict_sentence(summary)
    assert "above the range" not in overview(summary).html()


def test_a_small_system_is_searched_above_the_range(tmp_path):
    """The mode at 0.57 Hz grows above a range that ends at 0.5 Hz."""
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.in_service,grid.load_2.P\nout,0,1250 MW\n")
    request = ScreeningRequest(path, None, "gfor", frequencies=(0.1, 0.5))
    plan = plan_screening(load_case("two_area"), request)
    found = run_screening(plan, Work(Serial(), PointStore(tmp_path / "points")))
    (item,) = found.items
    assert item.record.looked_above
    real, imaginary = item.record.above
    assert real > 0
    assert imaginary / (2 * np.pi) == pytest.approx(0.572, abs=1e-3)
    assert "(sg" in above_the_range(Summary(found))
