"""What `gfor steps` says of a step, against runs at that step, and what must take its answer away."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError, CosimError, InputError
from orchestrator.face.api.case import load
from orchestrator.face.cli import main
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.studies.modes import step_choice
from orchestrator.studies.modes.modes import running
from orchestrator.studies.modes.step_choice import Allowed, _doubts, choose_step, keeps_stability
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import midpoint
from orchestrator.systems.coupling.system import System
from tests.linear.doubts.test_linearity import shaped
from tests.systems.coupling.small_fmus import small_fmu

STEPS = (1e-4, 5e-4, 1e-3)
ALLOWED = Allowed(0.001, 0.1)


@pytest.fixture(scope="module")
def choice():
    return choose_step(load("two_area").scenario("pod_pq").prepared, ALLOWED, STEPS)


def errors(choice, schedule, step_size):
    (trial,) = (t for t in choice.of(schedule) if t.step_size == step_size)
    return abs(trial.hertz).max(), abs(trial.points).max()


@pytest.mark.parametrize("schedule", ["midpoint", "newton"])
def test_second_order_at_500_us_is_nearer_than_gauss_seidel_at_100_us(choice, schedule):
    held, line = errors(choice, "gauss-seidel", 1e-4), errors(choice, schedule, 5e-4)
    assert line[0] < 0.1 * held[0]
    assert line[1] < 0.1 * held[1]


def test_the_largest_steps_of_the_how_to(choice):
    found = {name: choice.largest(name).step_size for name in choice.schedules}
    assert found == {"gauss-seidel": 1e-4, "midpoint": 5e-4, "newton": 1e-3}


def swing_after_the_load_step(schedule, step_size):
    """Largest difference of a coupled output from its start over 0.2 s after the load step."""
    ready = load("two_area").scenario("pod_pq", step=step_size, schedule=schedule).prepared
    with running(ready) as master:
        start = master.y.copy()
        master.run(0.3, [replace(ready.events[0], time=0.1)])
        return abs(master.y - start).max()


def test_a_run_diverges_where_the_step_map_is_said_to_be_unstable(choice):
    verdicts = {trial.step_size: trial.stable for trial in choice.of("midpoint")}
    assert verdicts == {1e-4: True, 5e-4: True, 1e-3: False}
    with pytest.raises(CosimError):
        swing_after_the_load_step("midpoint", 1e-3)
    stable = swing_after_the_load_step("gauss-seidel", 1e-4)
    assert swing_after_the_load_step("midpoint", 5e-4) == pytest.approx(stable, rel=0.02)
    assert swing_after_the_load_step("newton", 1e-3) == pytest.approx(stable, rel=0.02)


def test_growth_of_the_system_itself_is_not_laid_on_the_step():
    grows = choose_step(
        load("two_area").scenario("base").prepared, ALLOWED, [1e-4], ["gauss-seidel"]
    )
    assert grows.growth > 0.03
    assert grows.trials[0].stable


@pytest.mark.parametrize(
    ("rate", "growth", "seen", "critical", "kept"),
    [
        (0.0, 0.0, -0.1, -0.2, True),
        (1e-3, 0.0, -0.1, -0.2, False),  # something else grows, and nothing does in the system
        (0.04, 0.03, 0.04, 0.03, True),
        (1.1, 0.03, 0.04, 0.03, False),
        (0.0, 0.03, -0.001, 0.03, False),  # the step hides the system's growth
        (0.0, 0.0, 0.001, -0.03, False),
    ],
)
def test_a_step_neither_makes_growth_nor_hides_it(rate, growth, seen, critical, kept):
    assert keeps_stability(rate, growth, np.array([seen + 5j]), np.array([critical + 5j])) == kept


def test_an_answer_at_the_edge_of_a_limit_is_in_doubt(choice):
    system = System()
    system.add("shaped", shaped("limit"), {"gain": 3.0})
    system.add("plain", small_fmu("integrator"), {"gain": -3.0})
    system.connect("shaped.y", "plain.u")
    system.connect("plain.y", "shaped.u")
    schedule = midpoint((("shaped",), ("plain",)), 1e-3)
    with Master(system, schedule, 1e-3) as master:
        blocks = Blocks(master)
        doubts = _doubts(blocks, schedule, compose(blocks, schedule))
    assert any("shaped" in doubt for doubt in doubts)
    trial = choice.of("newton")[0]
    assert trial.is_within(ALLOWED)
    assert not replace(trial, doubts=doubts).is_within(ALLOWED)


def test_a_longer_step_does_not_count_where_a_shorter_one_fails(choice):
    short, *others = choice.of("midpoint")
    odd = replace(choice, trials=(replace(short, stable=False), *others))
    assert odd.largest("midpoint") is None
    assert [trial.step_size for trial in odd.islands("midpoint")] == [5e-4]


def test_a_step_that_no_event_falls_on_is_not_tried():
    with pytest.raises(
        InputError, match=r"--try: none fits the case: .* is not a communication point"
    ):
        choose_step(load("two_area").scenario("base").prepared, ALLOWED, [3e-4])
    some = choose_step(
        load("two_area").scenario("base").prepared, ALLOWED, [1e-4, 3e-4], ["gauss-seidel"]
    )
    assert some.left_out == (3e-4,)
    assert [trial.step_size for trial in some.trials] == [1e-4]


def test_phasor_devices_are_told_the_step_under_gauss_seidel_alone():
    """They give their emf for the middle of the next step; told that under midpoint, they would go ahead twice."""
    ready = load("two_area_rms").scenario("gfor", schedule="midpoint").prepared
    assert ready.values["sg1.communication_step"] == 0
    assert ready.rescheduled("gauss-seidel").values["sg1.communication_step"] == ready.step_size
    found = choose_step(ready, Allowed(0.01, 0.5), [1e-3], ["gauss-seidel", "midpoint"])
    assert [trial.is_within(found.allowed) for trial in found.trials] == [True, True]


def test_command_prints_the_table_and_json(capsys):
    words = [
        "steps",
        "two_area",
        "--scenario",
        "pod_p",
        "--try",
        "100 us,500 us",
        "--schedule",
        "gauss-seidel",
    ]
    assert main([*words, "--error", "0.0001:0.1"]) == 0
    assert "gauss-seidel: 100 µs" in capsys.readouterr().out
    assert main([*words, "--error", "1e-9:0.1", "--json"]) == 1
    (said,) = json.loads(capsys.readouterr().out)
    assert said["largest_step_s"] == {"gauss-seidel": None}
    assert [trial["within"] for trial in said["trials"]] == [False, False]


@pytest.mark.slow
def test_the_ring_down_of_a_run_is_the_mode_that_is_predicted():
    scenario = load("two_area").scenario("gfor", step=5e-4, schedule="midpoint")
    found = choose_step(scenario.prepared, ALLOWED, [5e-4], ["midpoint"])
    seen = scenario.run(stop=10).result.ring_down
    wanted = found.trials[0].eigenvalues[0]
    assert seen.frequency_hz == pytest.approx(wanted.imag / 6.283185307, abs=0.002)
    assert seen.damping_percent == pytest.approx(-100 * wanted.real / abs(wanted), abs=0.2)


class TriedError(Exception):
    """It went on."""


@pytest.mark.parametrize(
    ("schedule", "saves", "goes_on"),
    [("newton", False, False), ("newton", True, True), ("gauss-seidel", False, True)],
)
def test_newton_alone_needs_components_that_save_their_state(schedule, saves, goes_on, monkeypatch):
    def go_on(*_, **__):
        raise TriedError

    monkeypatch.setattr(step_choice, "Blocks", go_on)
    component = SimpleNamespace(description=SimpleNamespace(can_save_state=saves))
    prepared = SimpleNamespace(rescheduled=lambda name: SimpleNamespace(schedule=name))
    with pytest.raises(TriedError if goes_on else AnalysisError):
        step_choice._trial(
            prepared, SimpleNamespace(components={"a": component}), schedule, 1e-3, np.zeros(0), 0.0
        )
