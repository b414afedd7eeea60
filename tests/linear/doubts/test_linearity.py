"""FMUs that are not linear where they are linearised: the modes that they move are questioned, with the component."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.symbols import fabs, fmax, fmin, sin
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.description import read_description
from orchestrator.linear.doubts import linearity
from orchestrator.linear.doubts.linearity import doubts, tell
from orchestrator.linear.models.component_linearization import StepMap
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.studies.modes.modes import compute_modes, running
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

H = 1e-3

SHAPES = {
    "straight": lambda u: u,
    "smooth": lambda u: u + 3 * u**2 - 5 * u**3,
    "curved": lambda u: u + 300 * u**2,
    "limit": lambda u: fmin(u, 0.0),
    "dead_band": lambda u: u - fmax(-1.5e-5, fmin(1.5e-5, u)),
    "saturated": lambda u: fmax(-3e-7, fmin(3e-7, u)),
    "rough": lambda u: u + 1e-7 * sin(1e6 * u),
    "distant_limit": lambda u: fmax(-2.0, fmin(8.0, 1e6 * u)),
    "one_way_lead": lambda u: u + 0.02 * fabs(u),
}


def shaped(name):
    """ẋ = gain·f(u), y = x, with one of `SHAPES` for f."""
    m = ModelBuilder(f"small_{name}", "Integrator behind a characteristic")
    gain = m.parameter("gain", 1.0, "1/s", "Gain")
    u = m.input("u", "1", "Input")
    x = m.state("x", 0.0, "1", "Integral")
    m.derivative(x, gain * SHAPES[name](u))
    m.output("y", x, "1", "Integral")
    return read_description(cached(PythonFmu(m.build())))


def judged(shape, other=None, back=-3.0):
    """What is said of a ring of two integrators, f ≈ 0.5 Hz, one of them or both behind a characteristic."""
    system = System()
    system.add("shaped", shaped(shape), {"gain": 3.0})
    system.add("plain", shaped(other) if other else small_fmu("integrator"), {"gain": back})
    system.connect("shaped.y", "plain.u")
    system.connect("plain.y", "shaped.u")
    schedule = gauss_seidel((("shaped",), ("plain",)))
    with Master(system, schedule, H) as master:
        blocks = Blocks(master)
        model = compose(blocks, schedule)
        modes = find_modes(model, 0.0, 2.0)
        return doubts(blocks, schedule, model, modes), modes


@pytest.mark.parametrize("shape", ["straight", "smooth", "curved"])
def test_what_is_smooth_is_trusted(shape):
    """``curved`` answers upwards by 0.3 % more than downwards: a parabola is no edge."""
    found, modes = judged(shape)
    assert found == []
    assert modes[0].frequency_hz == pytest.approx(3 / (2 * np.pi), abs=1e-3)


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        ("limit", "answers differently up and down"),
        ("one_way_lead", "answers differently up and down"),
        ("dead_band", "linear for small changes only (shaped.u by 1e-06)"),
        ("saturated", "linear for small changes only (shaped.u by 1e-07)"),
        ("rough", "linear for small changes only (shaped.u by 1e-07)"),
    ],
)
def test_what_depends_on_the_perturbation_is_questioned_by_name(shape, why):
    found, _ = judged(shape)
    assert {doubt.component for doubt in found} == {"shaped"}
    assert why in " ".join(map(str, found))
    assert all(doubt.shift > 1e-3 for doubt in found)


def test_a_shift_is_what_the_other_answer_makes_of_the_mode():
    """Upwards the limit has no slope at all: ±j·3/√2 becomes 0; to first order, half the way."""
    (doubt,), modes = judged("limit")
    assert modes[0].eigenvalue == pytest.approx(3j / np.sqrt(2), abs=0.01)
    assert doubt.shift == pytest.approx(0.5, abs=0.01)


def test_a_limit_close_by_does_not_change_the_modes():
    """The usual perturbation of 1e-5 would find a thirtieth of the slope."""
    (doubt,), modes = judged("saturated")
    assert modes[0].eigenvalue == pytest.approx(3j, abs=0.01)
    assert not doubt.turns
    assert "The modes are those of small changes; a perturbation of 2e-05 would move" in str(doubt)


def test_a_limit_far_away_behind_a_large_gain_is_no_edge():
    """The usual perturbation, times the gain, meets both limits, which stand apart; at rest neither is near."""
    found, modes = judged("distant_limit", back=-3e-6)
    assert modes[0].eigenvalue == pytest.approx(3j, abs=0.01)
    assert not any(doubt.turns for doubt in found)
    assert "up and down" not in " ".join(map(str, found))


def test_one_sentence_counts_the_components_of_a_kind():
    found, _ = judged("limit", "one_way_lead")
    (sentence,) = tell(found)
    assert sentence.startswith(
        "2 components are not linear at the operating point ('shaped', 'plain'); the worst, 'shaped': it answers "
    )
    (alone,) = judged("limit")[0]
    assert tell([alone]) == (str(alone),)


def test_a_mode_that_an_edge_may_turn_is_named_so():
    found, _ = judged("limit")
    assert all(doubt.turns for doubt in found)


@pytest.mark.parametrize("limit", [0.01, 0.1])
def test_the_limit_of_a_damping_controller_does_not_decide_its_stability(limit):
    """Growth at 45.7 Hz, with its own directional derivatives as with a perturbation, whatever the output's limit."""
    prepared = prepare_one("two_area", "pod_q", {"gfor.pod_q.K": 5000.0, "gfor.pod_q.limit": limit})
    stability = compute_modes(prepared).stability
    assert stability.stable is False
    assert stability.largest_growth_rate == pytest.approx(2.773, abs=2e-3)


def test_a_drift_counts_by_the_second_however_short_the_step():
    """1e-4 per second is 1e-10 in a step of 1 µs."""
    system = System()
    system.add("a", small_fmu("integrator"), {"gain": 1.0}, {"u": 1e-4})
    with (
        Master(system, gauss_seidel((("a",),)), 1e-6) as master,
        pytest.raises(AnalysisError, match="no steady state"),
    ):
        find_operating_point(master)


EDGE = ("--set", "gfor.voltage_control.i_q_max=0.89677")
"""The power flow asks for 0.896769 of this current."""


def test_modes_at_a_limit_s_edge_are_shown_with_a_warning(gfor):
    """12.6 % of damping, where 10.6 % are right."""
    code, shown, said = gfor("modes", "two_area", "--scenario", "gfor", *EDGE)
    assert code == 0
    assert "electromechanical" in shown
    assert "component 'gfor' is not linear at the operating point" in " ".join(said.split())
    _, _, said = gfor(
        "modes", "two_area", "--scenario", "gfor", "--set", "gfor.voltage_control.i_q_max=0.9"
    )
    assert said == ""


@pytest.mark.parametrize(
    "command",
    [
        ("modes",),
        ("modes", "--range", "2:5"),
        ("modes", "--critical", "5"),
        ("export", "linear"),
        ("export", "linear", "--continuous"),
        ("design", "--controller", "pod_p", "--no-margins"),
    ],
    ids=" ".join,
)
def test_no_command_calls_stable_what_stands_at_a_limit_s_edge(gfor, tmp_path, command):
    """A disturbance of 1e-5 of the load ends there in lost synchronism."""
    words, options = (
        (command[:2], command[2:]) if command[0] == "export" else (command[:1], command[1:])
    )
    name = words[0]
    out = (
        ()
        if name == "modes"
        else ("--out", str(tmp_path / ("x.toml" if name == "design" else "x")))
    )
    code, shown, _ = gfor(
        *words, "two_area", "--scenario", "gfor", *EDGE, *options, *out, "--fail-unstable"
    )
    assert code == 1
    # of the table with a line a scenario, or of the sentence
    first = " ".join(shown.splitlines()[:4])
    assert "not known" in first
    assert "│ stable" not in first
    assert "answers differently up and down" in " ".join(shown.split())


def test_a_large_model_has_the_same_shifts_without_each_variant_whole(monkeypatch):
    """Planted: every component, the grid among them, answers by up to 30 % differently, and the grid's outputs follow
    its inputs at once: what a machine changes comes back to it within the same step."""
    with running(prepare_one("wscc9", "base")) as master:
        find_operating_point(master)
        blocks = Blocks(master)
        random = np.random.default_rng(1)
        grid = blocks.components["grid"]
        at_once = 0.1 * random.standard_normal(grid.D.shape)
        blocks.components["grid"] = replace(grid, D=grid.D + at_once)
        for name, c in blocks.components.items():
            matrices = (c.A, c.B, c.C, c.D)
            varied = StepMap(*(m * (1 + random.uniform(-0.3, 0.3, m.shape)) for m in matrices))
            blocks.components[name] = replace(c, variants=(varied,))
        model = compose(blocks, master.schedule)
        modes = find_modes(model)
        whole = doubts(blocks, master.schedule, model, modes)
        monkeypatch.setattr(linearity, "_DENSE", 0)
        by_rows = doubts(blocks, master.schedule, model, modes)
    assert [doubt.component for doubt in whole] == list(blocks.components)
    assert [doubt.component for doubt in by_rows] == list(blocks.components)
    for one, other in zip(by_rows, whole, strict=True):
        assert one.shift == pytest.approx(other.shift, rel=1e-9)
        assert one.mode is other.mode
