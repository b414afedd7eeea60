"""The paper's first table and its time responses, from coupled FMUs."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.run import run_scenario
from tests.support.exact import exact_continuous

pytestmark = [pytest.mark.reproduction, pytest.mark.quick]

FIGURES = json.loads((Path(__file__).parents[1] / "reference" / "two_area.json").read_text())
SCENARIOS = ("base", "gfor", "pod_p", "pod_q", "pod_pq")
SATURATED = {"sg1.machine.saturation": True, "sg2.machine.saturation": True}


def prepare(scenario, overrides=None, **arguments):
    case = load_case("two_area")
    (ready,) = case.prepare([scenario], overrides, **arguments)
    return ready


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_electromechanical_mode_is_the_papers(scenario):
    mode = compute_modes(prepare(scenario)).electromechanical
    _, _, frequency, damping = FIGURES["paper"][scenario]
    assert mode.frequency_hz == pytest.approx(frequency, abs=0.02)
    assert mode.damping_percent == pytest.approx(damping, abs=1.0)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_with_saturation_the_damping_is_the_papers_within_a_tenth_of_a_point(scenario):
    mode = compute_modes(prepare(scenario, SATURATED)).electromechanical
    _, _, frequency, damping = FIGURES["paper"][scenario]
    assert mode.frequency_hz == pytest.approx(frequency, abs=0.01)
    assert mode.damping_percent == pytest.approx(damping, abs=0.15)


@pytest.mark.parametrize(
    "row",
    FIGURES["independent"],
    ids=lambda r: (
        f"{r['X_L']}-{r['scenario']}-{r['governor_on_sg1']}{'-saturated' * r['saturation']}"
    ),
)
def test_every_mode_of_the_independent_linearisation_is_found(row):
    overrides = {"grid.X_L": row["X_L"], "sg1.governor.enabled": row["governor_on_sg1"]}
    overrides |= SATURATED if row["saturation"] else {}
    modes = compute_modes(prepare(row["scenario"], overrides)).modes
    for value in (complex(*parts) for parts in row["eigenvalues"]):
        error = min(abs(m.eigenvalue - value) for m in modes)
        # the step moves fast control modes more
        assert error < (0.002 if value.real > -5 else 0.02)


@pytest.mark.parametrize(
    "overrides",
    [
        {"grid.X_L": 0.013, "gfor.pod_p.K": 350.0},
        {"grid.X_L": 0.234, "gfor.droop.R_f": 0.031, "gfor.pod_q.K": 120.0},
        {
            "grid.X_L": 0.6,
            "gfor.S_n": 2200.0,
            "gfor.P_0": 0.5,
            "gfor.pod_p.T_S1": 0.33,
            "gfor.pod_q.N_S": 1,
        },
    ],
)
def test_elsewhere_the_modes_are_those_of_the_exact_jacobians(overrides):
    ready = prepare("pod_pq", overrides)
    result = compute_modes(ready)
    exact = np.linalg.eigvals(exact_continuous(ready)[0])
    # the step moves fast control modes more
    slow = [mode for mode in result.modes if mode.eigenvalue.real > -5]
    assert len(slow) >= 3
    for mode in slow:
        error = np.abs(exact - mode.eigenvalue).min()
        assert error < 0.002 + 3e-4 * abs(mode.eigenvalue)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_steady_state_residual(scenario):
    assert compute_modes(prepare(scenario)).operating_point.residual < 1e-9


@pytest.mark.parametrize("step_size", [50e-6, 100e-6, 200e-6, 500e-6])
def test_communication_step_moves_the_mode_by_less_than_three_thousandths(step_size):
    for scenario in ("base", "pod_pq"):
        ready = prepare(scenario, step_size=step_size)
        mode = compute_modes(ready).electromechanical
        exact = np.linalg.eigvals(exact_continuous(ready)[0])
        assert np.abs(exact - mode.eigenvalue).min() < 0.004


def test_an_undisturbed_run_stays_where_it_is():
    ready = prepare("pod_pq", stop_time=1.0)
    result = run_scenario(ready)
    drift = max(float(np.ptp(result.dataset[name].values)) for name in result.dataset.data_vars)
    assert len(ready.events) == 0
    assert drift < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_simulated_ring_down_agrees_with_the_eigenvalue(scenario):
    result = run_scenario(prepare(scenario))
    mode, seen = result.modes.electromechanical, result.ring_down
    assert seen.frequency_hz == pytest.approx(mode.frequency_hz, abs=0.01)
    assert seen.damping_percent == pytest.approx(mode.damping_percent, abs=0.5)
    assert result.statistics.steps == 200_000
    assert result.dataset["time"].values[-1] == pytest.approx(20.0, abs=1e-12)


def test_the_base_case_is_unstable_and_the_converter_stabilises_it():
    dampings = {
        s: find_modes(compute_modes(prepare(s)).model)[0].damping_percent for s in ("base", "gfor")
    }
    assert dampings["base"] < 0 < dampings["gfor"]
