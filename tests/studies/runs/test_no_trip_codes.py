"""Converters that trip as soon as NERC's PRC-029 lets them: its times, where it looks, and who is left alone."""

import pytest

from orchestrator.cases.case import load_case, with_protection
from orchestrator.core.errors import CaseError
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.bus_relays import Relays
from tests.support.mill import MACHINES, RAW, mill_case

pytestmark = pytest.mark.usefixtures("undrawn")

OWN_RELAY = "1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 0"


def fault(time, duration, X=0.0):
    return {"type": "bus_fault", "bus": "bus_2", "time": time, "duration": duration, "X": X}


@pytest.fixture
def prepared(tmp_path):
    """Events, a stop [s] and records → the case whose plant is a converter, protected by the code."""

    def made(events=(), stop=2.0, records=(), raw=RAW, machines=MACHINES, replace=("2",)):
        file = mill_case(tmp_path, records, events, raw=raw, replace=replace, machines=machines)
        case = load_case(file)
        scenario = "tried" if events else "base"
        (ready,) = with_protection(case, "prc029").prepare([scenario], None, None, stop)
        return ready

    return made


@pytest.mark.parametrize(
    ("faults", "stop", "time"),
    [
        ([fault(1.0, 0.3)], 2.0, None),
        ([fault(1.0, 0.4)], 2.0, 1.32),
        ([fault(1.0, 0.2), fault(2.0, 0.2)], 3.0, 2.12),  # within 10 s they count together
    ],
)
def test_without_voltage_it_has_to_stay_for_so_long_in_all(faults, stop, time, prepared):
    """Below 0.25 pu for 0.32 s; the frequency of a bus without voltage stays what it was."""
    result = run_scenario(prepared(faults, stop))
    found = [(trip.relay.of, trip.relay.record, trip.time) for trip in result.trips]
    assert found == ([] if time is None else [("gfor2", "PRC-029", pytest.approx(time, abs=1e-9))])
    quiet = "no relay trips (nearest: PRC-029 of gfor2, 0.3 of 0.32 s)"
    assert of_run(result).quiet_relays == (quiet if time is None else "")


def test_a_run_without_a_fault_says_that_no_relay_is_beyond_its_limits(prepared):
    result = run_scenario(prepared(stop=0.2))
    assert of_run(result).quiet_relays == "no relay trips, none is beyond its limits"


def test_a_code_without_a_converter_says_that_it_trips_nobody(tmp_path):
    case = with_protection(load_case(mill_case(tmp_path)), "prc029")
    (ready,) = case.prepare(["base"], None, None, 0.2)
    told = of_run(run_scenario(ready)).quiet_relays
    assert told == "prc029 trips nobody: no converter is there that it protects"


def test_a_relay_whose_breaker_opens_after_the_end_is_named(prepared):
    """Planted: it decides 0.05 s after the fault, and the run ends before the 2 s of its breaker."""
    late = "1 'VTGTPAT' 2 2 '1' 0.8 9 0.05 2"
    result = run_scenario(prepared([fault(1.0, 0.2)], 1.5, records=[late]))
    assert result.trips == []
    told = of_run(result).quiet_relays
    assert told.startswith("no relay trips by the end, but VTGTPAT of gfor2 would after it")


def test_the_command_says_below_its_table_that_nothing_trips(tmp_path, gfor):
    file = mill_case(tmp_path, events=[fault(1.0, 0.3)], replace=("2",))
    asked = ("run", file, "--scenario", "tried", "--stop", "1.5", "--protection", "prc029")
    code, out, error = gfor(*asked, "--no-csv", "--out", tmp_path / "out")
    assert code == 0, error
    assert "no relay trips (nearest: PRC-029 of gfor2" in out


def test_a_unit_that_is_off_comes_near_no_trip(prepared):
    """Its relay sees the fault as well, and has nothing to trip."""
    off = {"type": "unit_trip", "unit": "gfor2", "time": 0.5}
    result = run_scenario(prepared([off, fault(1.0, 0.2)], 1.5))
    assert (result.trips, result.nearest) == ([], None)


def test_what_lies_further_back_than_the_window_counts_no_more(prepared):
    ready = prepared([fault(0.5, 0.2)])
    watch = Relays(ready.relays, ready.step_size)
    (k,) = (k for k, x in enumerate(ready.relays) if x.limits.low == 0.25)
    for time in (0.5, 0.7):
        watch._within_window(k, time, is_beyond=True)
        watch._looked = time
    watch._within_window(k, 0.7, is_beyond=False)
    assert watch._within_window(k, 10.6, is_beyond=True) == pytest.approx((0.6, 0.1))
    watch._looked = 10.6
    assert watch._within_window(k, 10.8, is_beyond=True) == pytest.approx((10.6, 0.2))


def test_a_run_that_is_taken_up_knows_how_long_it_was_beyond(prepared):
    """The first of two short circuits is before the interruption, and its 0.2 s count."""
    ready = prepared([fault(1.0, 0.2)])
    watch = Relays(ready.relays, ready.step_size)
    (k,) = (k for k, x in enumerate(ready.relays) if x.limits.low == 0.25)
    for time in (1.0, 1.2):
        watch._within_window(k, time, is_beyond=True)
        watch._looked = time
    watch._within_window(k, 1.2, is_beyond=False)
    again = Relays(ready.relays, ready.step_size)
    again.resume(watch.position())
    again._within_window(k, 2.0, is_beyond=True)
    again._looked = 2.0
    assert again._within_window(k, 2.1, is_beyond=True)[1] == pytest.approx(0.3)


def test_a_unit_with_a_relay_of_its_own_keeps_that_alone(prepared):
    assert {x.record for x in prepared(records=[OWN_RELAY]).relays} == {"VTGTPAT"}
    assert {(x.of, x.record) for x in prepared().relays} == {("gfor2", "PRC-029")}


def test_the_code_looks_at_the_high_side_of_a_plants_own_transformer(prepared):
    """The load is at bus 1, so that the branch leads to the plant alone."""
    assert {relay.bus for relay in prepared().relays} == {"bus_2"}
    apart = RAW.replace("2, '1', 1, 1, 1, 60.0", "1, '1', 1, 1, 1, 60.0")
    apart = apart.replace("2, '2', 1, 1, 1, 20.0", "1, '2', 1, 1, 1, 20.0")
    assert {relay.bus for relay in prepared(raw=apart).relays} == {"bus_1"}


def test_plants_that_share_a_transformer_are_looked_at_on_its_high_side(prepared):
    apart = RAW.replace("2, '1', 1, 1, 1, 60.0", "1, '1', 1, 1, 1, 60.0")
    apart = apart.replace("2, '2', 1, 1, 1, 20.0", "1, '2', 1, 1, 1, 20.0")
    second = "2, '1', 40.0, 10.0, 100.0, -100.0"
    plant = next(line for line in apart.splitlines() if line.startswith(second))
    shared = apart.replace(plant, plant + "\n" + plant.replace("2, '1'", "2, '9'"))
    machines = MACHINES + "2 'GENCLS' 9 4 2 /\n"
    found = prepared(raw=shared, machines=machines, replace=["2_1", "2_9"]).relays
    assert {relay.of for relay in found} == {"gfor2_1", "gfor2_9"}
    assert {relay.bus for relay in found} == {"bus_1"}


def test_at_another_rated_frequency_the_code_is_refused():
    case = load_case("four_vsc_rms")
    with pytest.raises(CaseError, match=r"PRC-029 is for 60 Hz, and the case has 50 Hz; leave it"):
        with_protection(case, "prc029").prepare()
