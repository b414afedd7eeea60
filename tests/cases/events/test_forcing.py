"""References that swing: in a case file, by ``--force`` and in a run."""

import re
from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import different_scenarios, event_of, with_events
from orchestrator.core.errors import CaseError, InputError
from orchestrator.core.options import Option
from orchestrator.systems.coupling.events import Forcing


def values(**changed):
    given = {"frequency": 0.8, "amplitude": 0.02, "shape": "sine", "end": None} | changed
    event = Forcing(1.0, "sg1", "governor.delta_P_ref", **given)
    changes = list(event.values(1e-3, 6.0))
    return np.array([c.time for c in changes]), np.array([c.value for c in changes])


def test_a_fault_of_the_command_takes_the_title_of_the_one_that_it_replaces():
    case = load_case("wscc9")
    own = {"base": case.table.scenarios["base"], "fault": case.table.scenarios["gfor"]}
    own["fault"] = own["fault"].model_copy(
        update={"title": "Fault of 100 ms at bus 7", "events": case.table.events}
    )
    told = replace(case, table=case.table.model_copy(update={"scenarios": own}))
    found = with_events(told, (), ["bus_9, 150 ms"]).table.scenarios
    assert found["base"].title == own["base"].title
    assert found["fault"].title == 'fault "bus_9, 150 ms"'


def test_of_scenarios_that_their_events_told_apart_the_first_is_computed():
    case = load_case("wscc9")
    base, other = (case.table.scenarios[name] for name in ("base", "gfor"))
    with_fault = base.model_copy(update={"title": "Fault", "events": case.table.events})
    scenarios = {"base": base, "fault": with_fault, "gfor": other}
    own = replace(case, table=case.table.model_copy(update={"scenarios": scenarios}))
    assert different_scenarios(own) == ["base", "fault", "gfor"]
    assert different_scenarios(with_events(own, (), ["bus_9, 150 ms"])) == ["base", "gfor"]


def test_a_sine_is_followed_to_its_two_hundredth():
    times, found = values()
    grid = np.arange(1.0, 6.0, 1e-3)
    held = found[np.searchsorted(times, grid + 1e-9) - 1]
    wanted = 0.02 * np.sin(2 * np.pi * 0.8 * (grid + 5e-4 - 1.0))
    assert np.abs(held - wanted).max() < 0.02 * 2 * np.pi / 200
    assert abs(held.mean()) < 1e-5


def test_a_square_changes_twice_a_period():
    times, found = values(shape="square")
    assert times == pytest.approx(1.0 + 0.625 * np.arange(8), abs=1e-3)
    assert list(found) == [0.02, -0.02] * 4


def test_an_end_gives_the_reference_its_own_value_again():
    times, found = values(end=3.0)
    assert times[-1] == 3.0
    assert found[-1] == 0.0
    assert np.all(np.diff(times) > 0)


def test_a_frequency_near_the_step_asks_for_each_point_once():
    times, _ = values(frequency=20.0)
    assert np.all(np.diff(np.round(times * 1000)) >= 1)


def test_the_words_of_the_command():
    table = event_of(Option.FORCE, "sg35.exciter.V_ref  800 mHz 2% square from 500 ms")
    assert (table.component, table.reference, table.shape) == ("sg35", "exciter.V_ref", "square")
    assert (table.frequency, table.amplitude, table.time) == pytest.approx((0.8, 0.02, 0.5))
    assert event_of(Option.FORCE, "gfor 0.8 Hz 0.05 pu").amplitude == 0.05


@pytest.mark.parametrize(
    "text", ["sg35 0.8 2 %", "sg35 0.8 Hz", "0.8 Hz 2 %", "sg35 0.8 Hz 2 % triangle", ""]
)
def test_other_words_are_refused_with_the_form(text):
    with pytest.raises(InputError, match="UNIT FREQUENCY AMPLITUDE"):
        event_of(Option.FORCE, text)


@pytest.mark.parametrize(
    ("force", "said"),
    [
        ("sg9 0.8 Hz 2 %", "no component 'sg9'"),
        ("sg1.exciter.P_ref 0.8 Hz 2 %", "it has: exciter.V_ref, governor.P_ref"),
        ("grid 0.8 Hz 2 %", "no reference of its power"),
        ("sg1 99 Hz 2 %", "does not show it"),
        ("sg1 0.8 Hz 2 % from 99 s", "never happens"),
    ],
)
def test_what_cannot_be_forced_is_told_with_the_words_of_the_command(force, said):
    with pytest.raises(CaseError, match=said) as error:
        gfor.load("two_area_rms").scenario("gfor", force=force)
    assert "--force" in str(error.value)


def test_a_unit_that_only_another_scenario_has_is_asked_about():
    case = gfor.load("two_area_rms")
    asked = {
        name: case.scenario(name, force="gfor 0.6 Hz 2 %").prepared.questions
        for name in ("base", "gfor")
    }
    assert [str(q) for q in asked["base"]] == [
        "--force 'gfor 0.6 Hz 2 %' cannot act: the scenario has no gfor"
    ]
    assert not asked["gfor"]


@pytest.mark.parametrize(
    ("force", "asked"),
    [
        (
            "sg1 0.8 Hz 200 %",
            r"200 % to both sides, more than its rated power: if 2 % is meant, write '2 %'",
        ),
        ("sg1.exciter.V_ref 0.8 Hz 3 pu", "300 % to both sides, more than its base"),
        (
            "sg1 0.8 Hz 95 %",
            r"its power would go from -\d+ to \d+ MW, beyond what it feeds \(0 MW to ",
        ),
        ("gfor 0.8 Hz 40 %", r"its power would go from \d+ to \d+ MW, beyond what it feeds"),
        ("sg1 0.8 Hz 2 %", ""),
        ("gfor 0.8 Hz 2 %", ""),
        ("sg1.exciter.V_ref 0.8 Hz 50 %", ""),
    ],
)
def test_a_swing_beyond_what_a_unit_can_do_is_asked_about(force, asked):
    questions = gfor.load("two_area_rms").scenario("gfor", force=force).prepared.questions
    assert len(questions) == bool(asked)
    if asked:
        (question,) = questions
        assert question.place == f"--force '{force}'"
        assert re.search(asked, question.text)


def test_the_power_that_is_questioned_is_that_of_the_power_flow():
    """850 MVA at 0.8 pu, say: 25 % more goes beyond the rating, as the unit's own figures have it."""
    prepared = gfor.load("two_area_rms").scenario("gfor", force="gfor 0.8 Hz 40 %").prepared
    plan = prepared.system.components["gfor"]
    P, S_n = prepared.power_flow.powers["gfor"].real, plan.number("S_n")
    (question,) = prepared.questions
    assert f"from {(P - 0.4) * S_n:.4g} to {(P + 0.4) * S_n:.4g} MW" in question.text


def test_two_forcings_of_one_reference_are_refused():
    with pytest.raises(CaseError, match="is set at 1 s by"):
        gfor.load("two_area_rms").scenario("gfor", force=["sg1 0.8 Hz 2 %", "sg1 0.9 Hz 2 %"])


@pytest.fixture(scope="module")
def run():
    return (
        gfor.load("two_area_rms")
        .scenario("gfor", force="sg1.governor.P_ref 0.8 Hz 2 %")
        .run(stop=20.0)
    )


def test_the_unit_swings_at_that_frequency_alone(run):
    late = run.dataset.sel(time=slice(15.0, 20.0 - 1e-6))
    spectrum = np.abs(np.fft.rfft(late["sg1.p"].values - late["sg1.p"].values.mean()))
    assert int(spectrum.argmax()) == 4  # of five seconds


def test_currents_voltages_and_their_places_are_recorded(run):
    assert {"sg1.i_re", "grid.bus_2.v_im", "grid.L.q"} <= set(run.dataset.data_vars)
    assert '"sg1": "grid.bus_2"' in run.dataset.attrs["places"]


def test_the_response_is_not_called_unstable(run):
    (finding,) = run.findings
    assert finding.kind == "not_judged"
    assert "forcing on sg1.governor.delta_P_ref" in finding.message


def test_a_linear_response_refuses_a_forcing():
    forced = gfor.load("two_area_rms").scenario("gfor", force="sg1 0.8 Hz 2 %")
    with pytest.raises(
        InputError, match=r"cannot follow a fault or a forcing.*; leave (--)?linear out"
    ):
        forced.run(stop=2.0, linear=True)
    with pytest.raises(InputError, match=r"cannot follow .*; the co-simulation follows it"):
        forced.response(stop=2.0)


def test_the_run_tells_who_was_forced(run):
    found = run.source(start=0.5)
    (one,) = found
    assert one.source == "sg1"
    assert found.table()["kind"][0] == "forced"
    assert "grid.L" in found.places


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("bus_9, 150 ms", ("bus_9", 1.0, 0.15, None)),
        ("9,0.15 s", ("bus_9", 1.0, 0.15, None)),
        ("bus 9, 150 ms, opens line_7_9, from 2 s", ("bus_9", 2.0, 0.15, "line_7_9")),
    ],
)
def test_a_fault_in_words(text, given):
    fault = event_of(Option.FAULT, text)
    assert (fault.bus, fault.time, fault.duration, fault.cleared_by) == given


@pytest.mark.parametrize("opened", ["it", "one pole"])
def test_at_a_bus_a_fault_opens_a_line_by_its_name(opened):
    with pytest.raises(InputError, match="at a bus it names the line, as in 'opens line_7_9'"):
        event_of(Option.FAULT, f"bus_9, 150 ms, opens {opened}")


@pytest.mark.parametrize(
    "text", ["bus_9 150 ms", "bus_9, 150", "bus_9", "bus_9, -1 ms", "bus_9, 150 ms, line_7_9"]
)
def test_a_fault_without_its_parts_is_refused(text):
    with pytest.raises(InputError, match=f"^--fault '{text}': "):
        event_of(Option.FAULT, text)


def test_a_fault_takes_the_place_of_all_events():
    case = gfor.load("two_area_rms")
    prepared = case.scenario("gfor", {"grid.X_L": 0.2}, fault="bus_2, 150 ms, from 2 s").prepared
    assert [event.time for event in prepared.events] == [2.0, 2.15]
    assert prepared.subject == 'SG + GFOR, with fault "bus_2, 150 ms, from 2 s", grid.X_L = 0.2'
    with pytest.raises(
        CaseError,
        match=r"fault 'bus_4, 150 ms': component 'grid' has no bus 'bus_4'; did you mean bus_3 or bus_2",
    ):
        case.scenario("gfor", fault="bus_4, 150 ms")
