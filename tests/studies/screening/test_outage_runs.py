"""Screenings whose outages happen in runs: who trips there, what the verdict makes of it, and what is kept."""

import json

import pytest

import orchestrator as gfor
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.runs.run import run_scenario
from orchestrator.studies.screening import outage_runs
from orchestrator.studies.screening.command import STUDY
from tests.support.mill import mill_case
from tests.support.scenarios import prepare_one

UNDERVOLTAGE = "1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0.04"
SPEED = "1 'FRQTPAT' 2 2 '1' 59 61 0.1 0.05"


@pytest.fixture
def screened(tmp_path):
    """Records, outages and what the request has besides → the screening of the case with them."""

    def made(records, outages, **besides):
        case = gfor.load(mill_case(tmp_path, records))
        wanted = {"trips": "2 s", "folder": tmp_path / "points", **besides}
        return case.screen(outages=outages, scenario="base", **wanted)

    return made


def run_of(found, outage):
    (item,) = (item for item in found.result.items if item.outage.name == outage)
    return item.record.run


def test_a_run_of_an_outage_is_the_run_of_its_events(screened, tmp_path):
    """The line opens for a short circuit at its first bus: relays see what they see in the case's own scenario."""
    records = [UNDERVOLTAGE, "2 'LDSHBL' 2 59.3 0.1 0.5 0 0 0 0 0 0 0"]
    found = screened(records, ["line_1_2"], cleared_after="100 ms")
    shown = {"type": "bus_fault", "bus": "bus_1", "time": 1.0, "duration": 0.1}
    event = {**shown, "cleared_by": "line_1_2"}
    (tmp_path / "own").mkdir()
    own = mill_case(tmp_path / "own", records, [event])
    expected = run_scenario(prepare_one(own, "tried", {}, None, 3.1)).trips
    assert len(expected) >= 1
    got = run_of(found, "line_1_2").trips
    assert [(t.of, t.record, t.time, t.seen) for t in got] == [
        (t.relay.of, t.relay.record, t.time, pytest.approx(t.seen, rel=1e-9)) for t in expected
    ]


def test_trips_leave_the_verdict_open_and_all_outputs_name_them(screened):
    """The plant alone slows down until its relay opens; no mode grows."""
    found = screened([SPEED], ["line_1_2", "sg2"])
    assert found.result.items[0].record.run is None  # nothing is lost in the intact network
    assert run_of(found, "sg2").trips == ()
    (trip,) = run_of(found, "line_1_2").trips
    assert found.stable is None
    assert STUDY.code(found, True) == 1
    assert "what relays leave at 1 of them is not judged" in found.verdict
    assert "in 1 of 2 relays or models trip, or motors stall, first line_1_2" in found.verdict
    told = json.loads(json.dumps(found.as_json()))["runs"]
    assert [(run["outage"], len(run["trips"])) for run in told] == [("line_1_2", 1), ("sg2", 0)]
    (in_json,) = told[0]["trips"]
    assert (in_json["of"], in_json["time"]) == ("sg2", trip.time)
    assert list(found.items()["trips"].fillna(""))[1].startswith("sg2")


def test_without_runs_nothing_is_said_of_trips(screened):
    found = screened([SPEED], ["line_1_2"], trips=None)
    assert found.as_json()["runs"] is None
    assert "trips" not in found.items()
    assert "run" not in found.verdict


def test_a_run_that_loses_synchronism_makes_the_verdict_bad(screened):
    """After a short circuit of a second at bus 2 the plant has no torque to come back by; its modes are good."""
    calm = screened([], ["load_2"])
    assert calm.stable is True
    assert any("the case has no relay of a unit or a load" in text for text in STUDY.remarks(calm))
    lost = screened([], ["load_2"], cleared_after="1 s")
    assert lost.stable is False
    assert lost.verdict.startswith("UNSTABLE: in 1 of 1 runs of outages, though no mode grows")
    (wrong, *_) = lost.as_json()["runs"][0]["went_wrong"]
    assert wrong["component"] in ("sg1", "sg2")


def test_kept_points_bring_their_runs_along(screened):
    first = screened([SPEED], ["line_1_2"])
    again = screened([SPEED], ["line_1_2"])
    assert (again.result.computed, first.result.computed) == (0, 2)
    assert run_of(again, "line_1_2") == run_of(first, "line_1_2")
    assert screened([SPEED], ["line_1_2"], trips="1 s").result.computed == 2
    later = SPEED.replace("0.05", "0.25")  # a relay changes no FMU and no value
    (trip,) = run_of(screened([later], ["line_1_2"]), "line_1_2").trips
    assert trip.time == pytest.approx(run_of(first, "line_1_2").trips[0].time + 0.2)


def test_a_code_lets_converters_trip_in_runs_of_outages(tmp_path):
    case = gfor.load(mill_case(tmp_path, replace=["2"]))
    wanted = {"outages": ["load_2"], "scenario": "base", "trips": "1 s", "cleared_after": "500 ms"}
    wanted["sharing"] = "slack"
    assert run_of(case.screen(**wanted), "load_2").trips == ()
    (trip, *_) = run_of(case.screen(**wanted, protection="prc029"), "load_2").trips
    assert (trip.of, trip.record) == ("gfor2", "PRC-029")
    with pytest.raises(InputError, match="protection = 'prc30'; it must be one of prc029"):
        case.screen(**wanted, protection="prc30")


def test_a_motor_that_stalls_after_an_outage_is_found(screened):
    motor = "2 'CIM5BL' 1 1 0.013 0.067 3.8 0.02 0.17 0 0 0 0 0 0 0 1.25 0.7 0 6 3 0 0"
    found = screened([motor], ["sg2"], cleared_after="1.5 s")
    (told,) = run_of(found, "sg2").trips
    assert (told.of, told.record) == ("motor2_1", "")
    assert told.message.startswith("motor2_1 stalls: its speed falls below 0.5 pu at t = ")
    assert "or motors stall, first sg2: motor2_1 at" in found.verdict


def test_a_run_that_cannot_be_is_an_item_that_is_not_judged(screened, monkeypatch):
    def fail(*_):
        raise AnalysisError("planted")

    monkeypatch.setattr(outage_runs.OutageRuns, "run", fail)
    found = screened([SPEED], ["line_1_2"])
    item = found.result.items[1]
    assert item.record.status is not Status.COMPUTED
    assert item.record.text == "the run of the outage: planted"
    assert found.stable is None


def test_a_clearing_time_without_runs_is_refused(screened):
    with pytest.raises(InputError, match="trips"):
        screened([], ["line_1_2"], trips=None, cleared_after="100 ms")
