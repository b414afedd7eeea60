"""Noise on a connection: its own motion is no verdict, and a system that grows beneath it is reported."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.simulation.watch.undisturbed import disturbances
from orchestrator.simulation.watch.watch import judge_run
from orchestrator.studies.runs.files import summary_of
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.connections import Connection, Endpoint
from orchestrator.systems.coupling.events import WireFault, WireRecovery
from orchestrator.systems.coupling.imperfections import Noise, Quantisation
from tests.simulation.watch.seen import seen_of, system
from tests.support.scenarios import prepare_one

PI = np.pi
STOP = 12.0
WIRE = Connection(Endpoint("a", "y"), Endpoint("b", "u"))


def pair(*permanent):
    made = system("a", "b")
    made.connect("a.y", "b.u")
    for imperfection in permanent:
        made.disturb(WIRE, imperfection)
    return made


def rough(size, seed=1):
    """White noise at every step."""
    return lambda t: size * np.random.default_rng(seed).standard_normal(len(t))


def found(y, made, happened=()):
    return judge_run(seen_of({"a.y": y}, STOP), made, list(happened))


@pytest.mark.parametrize("size", [1e-5, 1e-3, 0.1])
def test_noise_alone_is_not_judged(size):
    noise = rough(size)
    made = pair(Noise(size, 1))
    (finding,) = found(lambda t: 0.9 + noise(t), made)
    assert (finding.kind, finding.component, finding.time, finding.until) == (
        "not_judged",
        "b",
        0.0,
        None,
    )
    assert "noise on a.y -> b.u" in finding.message
    # the same motion where no noise explains it
    kinds = {f.kind for f in found(lambda t: 0.9 + noise(t), pair())}
    assert "sustained_oscillation" in kinds


def test_a_wandering_swing_that_noise_excites_is_not_judged():
    """A mode of 1 Hz with 1 % of damping, driven by noise."""
    pole = np.exp((-0.063 + 2j * PI) * 1e-4)

    def y(t):
        state, values = 0j, np.empty(len(t))
        for k, kick in enumerate(rough(1e-3)(t)):
            state = pole * state + kick
            values[k] = state.real
        return 0.9 + values

    assert [f.kind for f in found(y, pair(Noise(1e-3, 1)))] == ["not_judged"]


@pytest.mark.parametrize(
    ("rate", "hertz", "size"), [(0.15, 0.6, 0.02), (1.0, 5.0, 1e-4), (1.0, 60.0, 1e-3)]
)
def test_a_growth_beneath_noise_is_reported(rate, hertz, size):
    noise = rough(1e-4)
    (finding, *_) = found(
        lambda t: 0.9 + noise(t) + size * np.exp(rate * t) * np.sin(2 * PI * hertz * t),
        pair(Noise(1e-4, 1)),
    )
    assert finding.kind == "growing_oscillation"
    assert finding.figures["growth_rate"] == pytest.approx(rate, rel=0.15)


def test_when_it_is_in_force():
    noise, steps = Noise(1e-3, 1), Quantisation(0.01)
    begun = WireFault(2.0, "b", WIRE, noise)
    assert [(d.begin, d.end) for d in disturbances(pair(), [begun], 5.0)] == [(2.0, 5.0)]
    ended = WireRecovery(3.0, "b", WIRE, noise)
    assert [(d.begin, d.end) for d in disturbances(pair(), [begun, ended], 5.0)] == [(2.0, 3.0)]
    assert [(d.begin, d.end) for d in disturbances(pair(noise), [begun, ended], 5.0)] == [
        (0.0, 5.0)
    ]
    assert [d.kind for d in disturbances(pair(steps), [], 5.0)] == ["quantisation"]
    assert disturbances(pair(Noise(0.0, 1)), [], 5.0) == []
    silenced = WireFault(1.0, "b", WIRE, Noise(0.0, 1))
    assert [(d.begin, d.end) for d in disturbances(pair(noise), [silenced], 5.0)] == [(0.0, 1.0)]


def two_area(tmp_path, scenario, stop, deviation, to):
    case = load_case("two_area_rms")
    file = tmp_path / "case.toml"
    table = f'connection = "grid.*.v_* -> {to}.v_*"\ndeviation = {deviation}\nseed = 1\nbandwidth = "80 Hz"\n'
    file.write_text(
        f'{case.path.read_text(encoding="utf-8")}\n[imperfections.n]\ntype = "noise"\n{table}',
        "utf-8",
    )
    ready = prepare_one(file, scenario, stop_time=stop)
    return run_scenario(ready)


@pytest.mark.parametrize("deviation", [1e-3, 1e-5])
def test_a_stable_run_with_noise_is_not_unstable(tmp_path, deviation):
    result = two_area(tmp_path, "pod_p", 4.0, deviation, "gfor")
    assert not result.went_unstable
    if deviation == 1e-3:
        assert [f.kind for f in result.findings] == ["not_judged"]
        assert summary_of(result)["stable_in_simulation"] is None


@pytest.mark.slow
def test_the_papers_base_case_grows_with_noise_too(tmp_path):
    (finding, *_) = two_area(tmp_path, "base", 20.0, 3e-5, "*").went_unstable
    assert (finding.kind, finding.time) == ("growing_oscillation", 1.0)
    assert finding.figures["growth_rate"] == pytest.approx(0.033, abs=0.005)
