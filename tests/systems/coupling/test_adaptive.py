"""Steps within a tolerance, against exact solutions, and the FMUs that would make them wrong in silence."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import xarray as xr

from orchestrator.core.errors import CosimError, CouplingError, InputError
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.face.api.case import load
from orchestrator.face.cli.run_tables import on_adaptive_steps
from orchestrator.studies.runs.checkpoints import not_kept
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import gauss_seidel, midpoint, newton
from orchestrator.systems.coupling.statistics import StepCounts
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu
from tests.systems.coupling.test_master import oscillator, ring

pytestmark = pytest.mark.usefixtures("undrawn")

IN_TURN = (("a",), ("b",))
BOTH = pytest.mark.parametrize("schedule", [midpoint, newton])
EVENT, END, STEP = 0.0613, 0.12, 1e-4


def within(tolerance, schedule=newton, step_size=STEP, every=100):
    """Rows, their times and the counts of a run in which the gain of ``a`` changes between two rows."""
    recorder = Recorder(["a.y", "b.y"], every)
    with Master(oscillator(), replace(schedule(IN_TURN), tolerance=tolerance), step_size) as master:
        statistics = master.run(END, [ParameterChange(EVENT, "a", "gain", 45.0)], [recorder])
    return recorder.times, recorder.values, statistics.adaptive


def exact(times):
    """x_a and x_b at some times [s]."""
    found = []
    for time in times:
        x = np.array([1.0, 0.5])
        for gain, span in ((30.0, min(time, EVENT)), (45.0, max(0.0, time - EVENT))):
            x = scipy.linalg.expm(span * np.array([[0.0, gain], [-20.0, 0.0]])) @ x
        found.append(x)
    return np.array(found)


@BOTH
def test_the_error_follows_the_tolerance_over_three_decades(schedule):
    """Of second order, the error of a run falls with the tolerance to the power 2/3."""
    tolerances = np.array([1e-3, 1e-4, 1e-5, 1e-6])
    errors, steps, rejected = [], [], 0
    for tolerance in tolerances:
        times, values, counts = within(tolerance, schedule)
        errors.append(np.abs(values - exact(times)).max())
        steps.append(counts.accepted)
        rejected += counts.rejected
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(2 / 3, abs=0.1)
    assert steps == sorted(steps)
    assert rejected < 5  # a longer pair is tried where it will hold
    # longer than the communication step where the tolerance allows
    assert steps[0] < 0.1 * END / STEP


def test_the_counts_are_of_single_steps_of_which_a_pair_has_two():
    """At the loosest tolerance a pair is as long as the 10 ms between two rows."""
    counts = within(0.1)[2]
    assert counts.longest == pytest.approx(5e-3)
    assert counts.accepted % 2 == 0
    assert END / counts.longest < counts.accepted < END / counts.shortest


def test_rows_stand_at_their_times_and_events_at_theirs():
    """13 steps lie between the event and the row before it."""
    times, values, _ = within(1e-6)
    assert times.tolist() == [k * 100 * STEP for k in range(13)]
    assert np.abs(values - exact(times)).max() < 1e-4
    shifted = np.abs(values - exact(times - 1e-3 * (times > EVENT))).max()
    assert shifted > 1e-2  # the event 1 ms off would be seen


@BOTH
def test_a_pair_that_is_taken_back_leaves_no_trace(schedule):
    """The same rows from communication steps of 5 ms, most of which are too long, as from fixed short ones."""
    recorder = Recorder(["a.y", "b.y"], 1)
    with Master(oscillator(), replace(schedule(IN_TURN), tolerance=1e-7), 5e-3) as master:
        counts = master.run(0.05, [], [recorder]).adaptive
    assert counts.rejected > 0
    assert counts.longest < 5e-3
    assert np.abs(recorder.values - exact(recorder.times)).max() < 1e-4


def stays_where_it_is(monkeypatch):
    """Planted: ``b`` does not go back to a saved state."""
    restore = LoadedComponent.restore_state
    monkeypatch.setattr(
        LoadedComponent,
        "restore_state",
        lambda self, state: None if self.name == "b" else restore(self, state),
    )


def test_a_component_that_does_not_go_back_is_found(monkeypatch):
    stays_where_it_is(monkeypatch)
    with pytest.raises(
        CouplingError, match=r"the same step was done twice .*; some FMU does not restore all"
    ):
        within(1e-4, midpoint)


def test_it_is_found_as_soon_as_it_has_something_to_restore(monkeypatch):
    """``b`` stands still until the event, so that its fault is not to be seen before."""
    stays_where_it_is(monkeypatch)
    system = System()
    system.add("a", small_fmu("integrator"), {"gain": 30.0, "x_0": 1.0})
    system.add("b", small_fmu("integrator"), {"gain": 0.0, "x_0": 0.5})
    for source, target in ring("a", "b"):
        system.connect(source, target)
    with (
        Master(system, replace(midpoint(IN_TURN), tolerance=1e-4), STEP) as master,
        pytest.raises(CouplingError, match=r"at 0\.02 s the same step was done twice"),
    ):
        master.run(0.1, [ParameterChange(0.02, "b", "gain", 20.0)])


def test_what_cannot_be_reached_with_the_shortest_step_is_an_error():
    """x' = x² + u becomes infinite at t = π/2 s: no step is short enough there."""
    system = System()
    system.add("a", small_fmu("blow_up"))
    system.add("b", small_fmu("gain"), {"K": 0.0, "offset": 1.0})
    for source, target in ring("a", "b"):
        system.connect(source, target)
    with (
        Master(system, replace(newton((("a",), ("b",))), tolerance=1e-4), 1e-2) as master,
        pytest.raises(CosimError, match=r"tolerance = 0.0001|no finite number|repetitions"),
    ):
        master.run(1.6)


def test_without_saved_states_there_is_no_tolerance():
    system = System()
    for name in ("a", "b"):
        system.add(name, replace(small_fmu("integrator"), can_save_state=name != "b"))
    for source, target in ring("a", "b"):
        system.connect(source, target)
    with pytest.raises(
        InputError,
        match=r"steps that are too long are taken back, and component 'b' declares no canGet",
    ):
        Master(system, replace(midpoint(IN_TURN), tolerance=1e-4), STEP)


@pytest.mark.parametrize(
    ("schedule", "tolerance", "words"),
    [
        (gauss_seidel, 1e-4, "a tolerance goes with midpoint or newton"),
        (newton, 0.0, "give a number from 1e-08 to 0.1"),
        (newton, float("nan"), "give a number from 1e-08 to 0.1"),
    ],
)
def test_a_tolerance_that_means_nothing_is_refused(schedule, tolerance, words):
    with pytest.raises(InputError, match=words):
        replace(schedule(IN_TURN), tolerance=tolerance).check({"a", "b"})


def test_a_scenario_takes_newton_and_tells_no_component_its_step():
    ready = load("two_area_rms").scenario("gfor", tolerance=1e-4).prepared
    assert (ready.schedule.coupling, ready.schedule.tolerance) == ("newton", 1e-4)
    assert ready.values["gfor.communication_step"] == 0
    assert "length of the next step" in " ".join(not_kept(ready).values())
    with pytest.raises(InputError, match="a tolerance goes with midpoint or newton"):
        load("two_area_rms").scenario("gfor", schedule="jacobi", tolerance=1e-4)


def test_the_command_says_how_many_steps_were_taken():
    ready = load("two_area_rms").scenario("gfor", tolerance=1e-4).prepared
    assert on_adaptive_steps(ready, StepCounts(12, 3, 5e-6, 5e-3)) == (
        f"{ready.title}: tolerance 0.0001: 12 steps of 0.005 to 5 ms; 3 pairs of steps were taken back. The modes "
        "above are those of the fixed communication step."
    )


@pytest.mark.slow
def test_the_command_runs_within_a_tolerance_and_shows_the_steps_it_took(gfor, tmp_path):
    """Nearer to short fixed steps than the case's own 5 ms are, in the half second behind the step of the load."""
    behind = slice(1.0, 1.5)
    found = {}
    for name, step in (("short", 2.5e-4), ("own", None)):
        ready = load("two_area_rms").scenario("gfor", step=step, schedule="newton").prepared
        data = run_scenario(replace(ready, stop_time=1.5), linear=False).dataset
        found[name] = data["gfor.omega"].sel(time=behind)
    words = ("--scenario", "gfor", "--stop", "1.5", "--details", "--tolerance", "1e-5")
    code, text, _ = gfor("run", "two_area_rms", *words, "--no-csv", "--out", tmp_path)
    assert code == 0
    with xr.open_dataset(tmp_path / "gfor" / "trajectory.nc") as data:
        found["within"] = data["gfor.omega"].sel(time=behind).load()
    off = {name: float(abs(values - found["short"]).max()) for name, values in found.items()}
    assert 0 < off["within"] < 0.5 * off["own"]
    said = re.search(
        r"tolerance 1e-05: (\d+) steps of [\d.]+ to 2\.5 ms; (no|\d+) pairs? of steps w", text
    )
    assert said
    assert re.search(rf"SG \+ GFOR │ +{said[1]} │", text)


@pytest.mark.slow
def test_a_run_gives_its_counts():
    run = load("two_area_rms").scenario("gfor", schedule="midpoint", tolerance=1e-4).run(stop=0.2)
    summary = run.summary()
    assert summary["tolerance"] == 1e-4
    assert 0 < summary["adaptive_steps"]["accepted"] < 200
