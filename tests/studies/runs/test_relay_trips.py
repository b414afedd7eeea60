"""Relays in runs: the times at which they trip against hand calculation, what they leave on, and who tells of it."""

import re

import numpy as np
import pytest

from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.core.errors import InputError
from orchestrator.face.api.export import write_ssp
from orchestrator.simulation.interop.rules import master_rules
from orchestrator.studies.modes.modes import running
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.files import summary_of
from orchestrator.studies.runs.like import run_like
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.bus_relays import FREQUENCY_LAG, Relays
from tests.support.mill import RAW, mill_case
from tests.support.scenarios import prepare_one

LINE = 0.01 + 0.1j
STIFF, PLANT = 0.02j, 0.2j  # reactances of the machines on 100 MVA
FAULT = 0.1j

Event = dict[str, object]


def fault(time, duration, X=FAULT.imag) -> Event:
    return {"type": "bus_fault", "bus": "bus_2", "time": time, "duration": duration, "X": X}


OPENING: Event = {"type": "line_trip", "line": "line_1_2", "time": 1.0}


@pytest.fixture
def prepared(tmp_path):
    """Records of relays, events, and a stop [s] → the scenario of the case that gfor writes."""

    def made(records, events=(), stop=2.0, units=""):
        out = mill_case(tmp_path, records, events, units)
        return prepare_one(out, "tried" if events else "base", {}, None, stop)

    return made


def voltage_in_the_fault(ready):
    """Return |v| at bus 2 just after a fault of FAULT: both emfs as before, the load an impedance."""
    v1, v2 = (ready.power_flow.voltages[f"bus_{k}"] for k in (1, 2))
    drawn = (0.8 + 0.2j).conjugate() / abs(v2) ** 2
    through = (v1 - v2) / LINE
    e1, e2 = v1 + STIFF * through, v2 + PLANT * (drawn * v2 - through)
    y1, y2 = 1 / (STIFF + LINE), 1 / PLANT
    return abs((e1 * y1 + e2 * y2) / (y1 + y2 + drawn + 1 / FAULT))


def test_a_relay_trips_after_its_delay_and_the_breakers_time(prepared):
    """Of two relays, one whose limit lies above the voltage of the fault trips, the other does not."""
    low = voltage_in_the_fault(prepared([]))
    assert 0.4 < low < 0.7
    ready = prepared(
        [
            f"1 'VTGTPAT' 2 2 '1' {low - 0.03:.5f} 9 0.05 0",
            f"2 'VTGTPAT' 2 2 '1' {low + 0.03:.5f} 9 0.08 0.06",
        ],
        [fault(1.0, 0.1)],
    )
    result = run_scenario(ready)
    (trip,) = result.trips
    assert trip.relay is ready.relays[1]
    assert (trip.picked_up, trip.decided, trip.time) == pytest.approx((1.0, 1.08, 1.14), abs=1e-9)
    assert trip.seen == pytest.approx(low, abs=0.03)
    after = result.dataset["grid.sg2.p"].sel(time=slice(1.15, None))
    assert np.abs(after).max() == 0
    before = result.dataset["grid.sg2.p"].sel(time=slice(None, 1.13))
    assert np.abs(before).min() > 0


def test_a_voltage_that_comes_back_before_the_delay_is_forgotten(prepared):
    """Two faults of 80 ms are together longer than the delay."""
    relay = "1 'VTGTPAT' 2 2 '1' 0.8 9 0.1 0"
    result = run_scenario(prepared([relay], [fault(1.0, 0.08), fault(1.2, 0.08)]))
    assert result.trips == []
    (trip,) = run_scenario(prepared([relay], [fault(1.0, 0.08), fault(1.2, 0.12)])).trips
    assert trip.time == pytest.approx(1.3, abs=1e-9)


def test_a_breaker_that_is_on_its_way_opens_though_the_voltage_is_back(prepared):
    result = run_scenario(prepared(["1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0.2"], [fault(1.0, 0.06)]))
    (trip,) = result.trips
    assert trip.time == pytest.approx(1.25, abs=1e-9)


def test_at_rest_nothing_trips_and_a_relay_beyond_its_limit_is_asked_about(prepared):
    good = prepared(["1 'VTGTPAT' 2 2 '1' 0.9 1.1 0 0", "2 'FRQTPAT' 2 2 '1' 59.9 60.1 0 0"])
    assert run_scenario(good).trips == []
    assert not any("VTGTPAT" in question.text for question in good.questions)
    bad = prepared(["1 'VTGTPAT' 2 2 '1' 1.02 9 0.5 0.1"])
    (asked,) = (question.text for question in bad.questions if "VTGTPAT" in question.text)
    assert "rests at 1 pu, below 1.02 pu, so that it trips 0.6 s after the start" in asked
    assert run_scenario(bad).trips[0].time == pytest.approx(0.6, abs=1e-9)
    left = prepared(["1 'VTGTPAT' 2 2 '1' 1.02 9 0.5 0.1"], units="dyr_leave_out = ['VTGTPAT']")
    assert left.relays == ()
    assert not any("VTGTPAT" in question.text for question in left.questions)


def test_a_load_relay_of_nothing_is_asked_about_in_the_case(prepared):
    stages = "0.9 0.5 0.2 0.8 0.5 0.2 0.7 0.5 0.2 0.1"
    ready = prepared([f"2 'LVSHBL' 9 {stages}", f"2 'LVSHBL' 1 {stages}"])
    (asked,) = (question.text for question in ready.questions if "LVSHBL" in question.text)
    assert "not used: a relay of the load '9' at bus 2, which the RAW file does not have" in asked
    assert "so that it never trips; correct the bus or identifier of its load" in asked
    (use,) = (use for use in ready.records if use.kind == "LVSHBL" and use.why)
    assert use.why.startswith("a relay of the load '9' at bus 2")
    assert [relay.of for relay in ready.relays] == ["load_2"] * 3


def test_stages_shed_parts_of_the_load_that_they_name(prepared):
    """Load '1' is 60 of the 80 MW at its bus: two stages of 40 and 30 % leave 80 − 42 MW."""
    record = "2 'LVSHBL' 1 0.8 0.05 0.4 0.8 0.1 0.3 0.3 0.05 0.2 0.02"
    result = run_scenario(prepared([record], [fault(1.0, 0.15)]))
    first, second = result.trips
    assert (first.time, second.time) == pytest.approx((1.07, 1.12), abs=1e-9)
    scales = [event.scale for trip in result.trips for event in trip.events]
    assert scales == pytest.approx([1 - 0.4 * 0.75, 1 - 0.7 * 0.75], rel=1e-12)
    (of_first, *_) = (f.message for f in result.findings if f.kind == "trip")
    assert of_first.startswith("30 % of load_2 is shed, which leaves 70 %, at t = 1.07 s by LVSHBL")


def test_a_relay_of_a_load_takes_a_plant_off_as_soon_as_a_stage_has_waited(prepared):
    """Two stages order the same plant off: it goes once, its breaker's time after the first."""
    record = (
        "2 'LVS3BL' 1 1 2 '1' 0 0 '0' 0 0.8 0.05 0.07 0.4 0.8 0.06 0.02 0.3" + " 0" * 12 + " 0.03 0"
    )
    result = run_scenario(prepared([record], [fault(1.0, 0.15)]))
    told = [(trip.relay.of, trip.time) for trip in result.trips]
    assert told == [
        ("line_1_2", pytest.approx(1.08, abs=1e-9)),
        ("load_2", pytest.approx(1.08, abs=1e-9)),
        ("load_2", pytest.approx(1.12, abs=1e-9)),
    ]
    after = result.dataset["grid.line_1_2.p"].sel(time=slice(1.09, None))
    assert np.abs(after).max() == 0
    slow = "2 'LDS3BL' 1 2 '-1' 0 59.3 0.1 0.05 1.0" + " 0" * 16 + " 0.2"
    trips = run_scenario(prepared([slow], [OPENING])).trips
    assert [trip.relay.of for trip in trips] == ["load_2", "sg2"]
    assert trips[1].time - trips[0].time == pytest.approx(0.15, abs=1e-9)


def test_what_a_relay_would_take_off_and_is_not_there_is_asked_about_once(prepared):
    record = (
        "2 'LVS3BL' 1 1 2 '7' 2 9 '1' 0 0.8 0.05 0.07 0.4 0.8 0.06 0.02 0.3" + " 0" * 12 + " 0 0"
    )
    asked = [
        question.text for question in prepared([record]).questions if "LVS3BL" in question.text
    ]
    (only,) = asked
    assert "takes nothing off besides: the branch 2-9, circuit '1' is not here; correct it" in only


def test_a_share_comes_off_what_an_event_left_of_the_load(prepared):
    change = {"type": "load_change", "load": "load_2", "scale": 0.5, "time": 0.5}
    record = "2 'LVSHBL' 1 0.8 0.05 0.4 0 0 0 0 0 0 0"
    (trip,) = run_scenario(prepared([record], [change, fault(1.0, 0.15)])).trips
    assert [event.scale for event in trip.events] == pytest.approx([0.5 * (1 - 0.3)], rel=1e-12)


def test_frequency_relays_follow_the_island_that_falls(prepared):
    """The plant alone with a load of twice its power slows down; a meter is late by its lag."""
    records = [
        "1 'FRQTPAT' 2 2 '1' 58 62 0.1 0.05",
        "2 'LDSHBL' 2 59.3 0.1 1.0 0 0 0 0 0 0 0",
    ]
    result = run_scenario(prepared(records, [OPENING]))
    shed, *_ = result.trips
    omega = result.dataset["sg2.omega"]
    falls = float(omega.time[np.flatnonzero(60 * omega.values < 59.3)[0]])
    assert shed.relay.record == "LDSHBL"
    assert shed.picked_up == pytest.approx(falls + FREQUENCY_LAG, abs=0.02)
    assert shed.time == pytest.approx(shed.picked_up + 0.1, abs=1.1e-3)
    alone = run_scenario(prepared(records[:1], [OPENING]))
    (trip,) = alone.trips
    omega = alone.dataset["sg2.omega"]
    falls = float(omega.time[np.flatnonzero(60 * omega.values < 58)[0]])
    assert trip.time == pytest.approx(falls + FREQUENCY_LAG + 0.15, abs=0.02)


def test_the_jump_of_the_angle_in_a_fault_is_no_frequency(prepared):
    result = run_scenario(prepared(["1 'FRQTPAT' 2 2 '1' 57 63 0 0"], [fault(1.0, 0.1, X=0.0)]))
    assert result.trips == []


def test_a_relay_of_a_bus_takes_all_of_it_off(prepared):
    ready = prepared(["1 'VTGDCAT' 2 2 '1' 0.8 9 0.05 0.05"], [fault(1.0, 0.06)])
    result = run_scenario(ready)
    (trip,) = result.trips
    assert trip.time == pytest.approx(1.1, abs=1e-9)
    after = result.dataset.sel(time=slice(1.15, None))
    assert np.abs(after["grid.line_1_2.p"]).max() == 0
    assert np.abs(after["grid.bus_2.v"]).max() < 1e-6
    assert result.went_unstable == []


def test_the_answer_the_file_and_the_findings_say_who_tripped(prepared):
    ready = prepared(
        ["1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0", "2 'VTGTPAT' 2 2 '1' 0.8 9 0.1 0"], [fault(1.0, 0.15)]
    )
    (used, second) = (use for use in ready.records if use.kind == "VTGTPAT")
    assert used.use is second.use is UseOfRecord.USED
    result = run_scenario(ready, linear=False)
    (trip,) = result.trips  # the second finds the plant off
    (found,) = (f for f in result.findings if f.kind == "trip")
    assert (found.component, found.time) == ("sg2", trip.time)
    assert of_run(result).remark.startswith("relays trip sg2 at 1.05 s; ")
    told = summary_of(result)
    assert "t = 1.05 s: sg2.connected = 0, grid.sg2.connected = 0" in told["events"]
    assert [f["kind"] for f in told["findings"]][:1] == ["trip"]
    assert result.after is not None
    assert result.after.modes == [] or not any("sg2" in n for n in result.after.model.names)


TAKEN_OFF: Event = {"type": "unit_trip", "unit": "sg2", "time": 0.5}


@pytest.mark.parametrize(
    ("events", "values"),
    [([TAKEN_OFF, fault(1.0, 0.15)], {}), ([fault(1.0, 0.15)], {"sg2.connected": False})],
)
def test_a_unit_that_is_off_already_is_not_tripped_again(prepared, events, values):
    ready = prepared(["1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0"], events)
    (ready,) = ready.case.prepare(["tried"], values, None, 2.0)
    assert len(ready.relays) == 1
    assert run_scenario(ready).trips == []


def test_what_relays_know_goes_on_with_a_run_that_is_taken_up(prepared):
    ready = prepared(["2 'LVSHBL' 1 0.8 0.05 0.4 0 0 0 0 0 0 0.02"], [fault(1.0, 0.15)])
    trips = run_scenario(ready).trips
    whole = Relays(ready.relays, ready.step_size)
    with running(ready) as master:
        master.run(ready.stop_time, ready.events, [whole])
    assert whole.trips == trips
    again = Relays(ready.relays, ready.step_size)
    again.resume({name: np.asarray(value) for name, value in whole.position().items()})
    assert again.trips == trips


def test_a_relay_of_what_is_not_there_is_not_used_and_asked_about(prepared):
    ready = prepared(["1 'VTGTPAT' 2 7 '1' 0.8 9 0.05 0", "2 'VTGTPAT' 9 2 '1' 0.8 9 0.05 0"])
    first, second = (use for use in ready.records if use.kind == "VTGTPAT")
    assert first.why == "a relay of the machine '1' at bus 7, which the RAW file does not have"
    assert second.why == "a relay of bus 9, which is no bus here"
    assert first.use is second.use is UseOfRecord.NOT_USED
    assert ready.relays == ()
    asked = [one.text for one in ready.questions if one.text.startswith("VTGTPAT")]
    assert len(asked) == 2
    for text, use in zip(asked, (first, second), strict=True):
        assert text.startswith(f"VTGTPAT is not used: {use.why}, so that it never trips; correct")


def test_a_relay_of_a_machine_out_of_service_is_listed_and_not_asked_about(tmp_path):
    idle = (
        RAW.splitlines()[11].replace("2, '1'", "2, 'B'").replace("1.0, 1, 100.0", "1.0, 0, 100.0")
    )
    raw = RAW.replace("0 / END OF GENERATOR", f"{idle}\n0 / END OF GENERATOR")
    out = mill_case(tmp_path, ["2 'VTGTPAT' 2 2 'B' 0.8 9 0.05 0"], raw=raw)
    ready = prepare_one(out, "base", {}, None, 1.0)
    (use,) = (use for use in ready.records if use.kind == "VTGTPAT")
    assert use.why == "a relay of the machine 'B' at bus 2, which is not in service"
    assert not any("VTGTPAT" in question.text for question in ready.questions)


def exported(ready, tmp_path):
    write_ssp(ready, tmp_path / "mill.ssp")


def emulated(ready, tmp_path):
    run_like(ready, master_rules("libcosim"))


@pytest.mark.parametrize("carry", [exported, emulated])
def test_what_cannot_carry_relays_refuses_them_by_name(carry, prepared, tmp_path):
    """An SSP and other masters would lose the trips and say nothing; the remedy that is told works."""
    relays = ["1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0", "2 'LVSHBL' 1 0.8 0.05 0.4 0 0 0 0 0 0 0.02"]
    with pytest.raises(InputError, match=r"VTGTPAT of sg2, LVSHBL of load_2") as refused:
        carry(prepared(relays, stop=0.1), tmp_path)
    remedy = re.search(r"dyr_leave_out = \[.*?\]", str(refused.value)).group()
    carry(prepared(relays, stop=0.1, units=remedy), tmp_path)
