"""The two-area study with phasor models at milliseconds, against the EMT models at 100 µs."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.studies.modes.linear import linear_model
from orchestrator.studies.modes.linear_model_files import component_model
from orchestrator.studies.modes.modes import compute_modes, running
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.step_awareness import other_step
from tests.support.exact import exact_continuous
from tests.support.once import computed_once

pytestmark = pytest.mark.reproduction

SCENARIOS = ("base", "gfor", "pod_p", "pod_q", "pod_pq")
HERTZ, POINTS = 0.01, 0.3


def prepare(case, scenario, overrides=None, **arguments):
    loaded = load_case(case)
    (ready,) = loaded.prepare([scenario], overrides, **arguments)
    return ready


@computed_once
def emt_mode(scenario, X_L):
    """The electromechanical mode of the EMT FMUs at 100 µs."""
    return compute_modes(prepare("two_area", scenario, {"grid.X_L": X_L})).electromechanical


@computed_once
def rms_mode(scenario, X_L=0.1, step_size=5e-3, overrides=()):
    values = {"grid.X_L": X_L} | dict(overrides)
    return compute_modes(
        prepare("two_area_rms", scenario, values, step_size=step_size)
    ).electromechanical


@pytest.mark.parametrize("X_L", [0.05, 0.1])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_electromechanical_mode_is_that_of_the_emt_models(scenario, X_L):
    found, wanted = rms_mode(scenario, X_L), emt_mode(scenario, X_L)
    assert found.frequency_hz == pytest.approx(wanted.frequency_hz, abs=HERTZ)
    assert found.damping_percent == pytest.approx(wanted.damping_percent, abs=POINTS)


@pytest.mark.parametrize(
    ("step_size", "points"), [(1e-3, 0.15), (2e-3, 0.15), (5e-3, 0.16), (10e-3, 0.2)]
)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_communication_step_hardly_moves_it(scenario, step_size, points):
    """What remains at 1 ms is the models': network transients that are not there."""
    found, wanted = rms_mode(scenario, step_size=step_size), emt_mode(scenario, 0.1)
    assert found.frequency_hz == pytest.approx(wanted.frequency_hz, abs=0.002)
    assert found.damping_percent == pytest.approx(wanted.damping_percent, abs=points)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_at_short_steps_it_is_the_continuous_models(scenario):
    devices = ("sg1", "sg2") if scenario == "base" else ("sg1", "sg2", "gfor")
    ready = prepare("two_area_rms", scenario, {f"{d}.communication_step": 0.0 for d in devices})
    exact = np.linalg.eigvals(exact_continuous(ready)[0])
    for step_size, most in ((1e-3, 1e-4), (2e-3, 2e-4), (5e-3, 1e-3), (10e-3, 6e-3)):
        # [rad/s]
        assert np.abs(exact - rms_mode(scenario, step_size=step_size).eigenvalue).min() < most


def test_without_the_emfs_lead_the_held_voltage_moves_damping_by_points():
    """Why ``communication_step`` is there; set by hand it goes before the case's own step."""
    late = rms_mode(
        "gfor", overrides=tuple((f"{d}.communication_step", 0.0) for d in ("sg1", "sg2", "gfor"))
    )
    assert late.damping_percent - emt_mode("gfor", 0.1).damping_percent > 3.0


@pytest.mark.parametrize("scenario", ["base", "pod_pq"])
def test_a_jacobi_master_needs_the_emf_a_step_further_ahead(scenario):
    """What many other masters do; without ``steps_late`` they would find another system."""
    devices = ("sg1", "sg2") if scenario == "base" else ("sg1", "sg2", "gfor")
    wanted = emt_mode(scenario, 0.1)
    found = []
    for late in (1, 0):
        ready = prepare("two_area_rms", scenario, {f"{d}.steps_late": late for d in devices})
        side_by_side = replace(ready, schedule=jacobi(tuple(ready.system.components)))
        if scenario == "base" and not late:  # the held voltage damps what grows
            with pytest.raises(InputError, match=r"does not resolve a mode: .* damping"):
                compute_modes(side_by_side)
            return
        found.append(compute_modes(side_by_side).electromechanical)
        if late:
            assert found[0].frequency_hz == pytest.approx(wanted.frequency_hz, abs=HERTZ)
            assert found[0].damping_percent == pytest.approx(wanted.damping_percent, abs=POINTS)
    assert abs(found[1].damping_percent - wanted.damping_percent) > 5 * POINTS


def test_a_shift_is_that_of_devices_which_know_the_step():
    """The table of a run takes other steps than the run's own; the devices are told those, and the run's again."""
    ready = prepare("two_area_rms", "gfor", stop_time=0.01)
    shifts = {
        s.step_size: s.shift for s in run_scenario(ready).shifts if s.schedule == "gauss-seidel"
    }
    assert list(shifts) == [2.5e-3, 5e-3, 10e-3, 25e-3]
    assert shifts[2.5e-3] < shifts[5e-3] < 1e-3
    at_ten = rms_mode("gfor", step_size=10e-3).eigenvalue
    continuous = {f"{d}.communication_step": 0.0 for d in ("sg1", "sg2", "gfor")}
    exact = np.linalg.eigvals(exact_continuous(prepare("two_area_rms", "gfor", continuous))[0])
    assert shifts[10e-3] == pytest.approx(np.abs(exact - at_ten).min(), rel=1e-3)
    with running(ready) as master:
        with other_step(master, "sg1", 1e-3):
            assert master.components["sg1"].get(["communication_step"]) == {
                "communication_step": 1e-3
            }
        assert master.components["sg1"].get(["communication_step"]) == {"communication_step": 5e-3}


def test_blocks_that_believe_in_a_step_serve_no_continuous_model():
    """Nor the other way round: both would give numbers, and wrong ones."""
    with running(prepare("two_area_rms", "gfor")) as master:
        with pytest.raises(
            ValueError, match=r"gfor, sg1, sg2 know the communication step; .* without_step=True"
        ):
            continuous(Blocks(master, derivatives=True))
        with pytest.raises(ValueError, match="without_step=False for a step map"):
            compose(Blocks(master, without_step=True), master.schedule)


def test_a_continuous_model_is_that_of_emfs_without_a_lead():
    model, _, _ = linear_model(
        prepare("two_area_rms", "gfor"), ["grid.load_2.scale"], ["sg1.omega"], as_continuous=True
    )
    devices = {f"{d}.communication_step": 0.0 for d in ("sg1", "sg2", "gfor")}
    exact = np.linalg.eigvals(exact_continuous(prepare("two_area_rms", "gfor", devices))[0])
    mode = rms_mode("gfor").eigenvalue
    found, wanted = (
        values[np.argmin(np.abs(values - mode))] for values in (np.linalg.eigvals(model.A), exact)
    )
    assert abs(found - wanted) < 1e-6
    embedded = component_model(prepare("two_area_rms", "gfor"), "gfor")
    assert "communication_step" not in embedded.parameters
    assert embedded.D[list(embedded.outputs).index("e_re")] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_master_tells_the_devices_the_step_it_takes():
    ready = prepare("two_area_rms", "gfor")
    assert {ready.values[f"{d}.communication_step"] for d in ("sg1", "sg2", "gfor")} == {5e-3}
    ready = prepare("two_area_rms", "gfor", {"sg1.communication_step": 0.0}, step_size=2e-3)
    assert [ready.values[f"{d}.communication_step"] for d in ("sg1", "sg2", "gfor")] == [
        0.0,
        2e-3,
        2e-3,
    ]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_steady_state(scenario):
    ready = prepare("two_area_rms", scenario)
    assert compute_modes(ready).operating_point.residual < 1e-12


def response(case, scenario):
    data = run_scenario(prepare(case, scenario, stop_time=5.0)).dataset
    return (data["sg1.omega"] - data["sg2.omega"]).values


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_response_to_the_load_step_is_that_of_the_emt_models(scenario):
    """ω_SG1 − ω_SG2: in four seconds the largest difference is below a hundredth of the peak."""
    found, wanted = response("two_area_rms", scenario), response("two_area", scenario)
    assert np.abs(wanted).max() > 9e-5
    assert np.abs(found - wanted).max() < 0.01 * np.abs(wanted).max()
