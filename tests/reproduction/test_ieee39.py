"""The New England system from pandapower: its power flow, its inter-area mode, and runs with switching."""

import cmath
import warnings

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.run import run_scenario
from tests.support.late import LateLibrary
from tests.support.pandapower_networks import pandapower_network

pp = LateLibrary("pandapower")

pytestmark = pytest.mark.reproduction


def prepare(scenario, overrides=None, **arguments):
    case = load_case("ieee39")
    (ready,) = case.prepare([scenario], overrides, **arguments)
    return ready


@pytest.mark.slow
def test_the_voltages_are_pandapowers_but_for_the_stray_capacitances():
    net = pandapower_network("case39")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pp.runpp(net, calculate_voltage_angles=True, numba=False)
    for stray, tolerance in ((1e-9, 1e-6), (0.05, 2e-3)):
        ready = prepare("gfor", {"grid.stray_B": stray})
        assert ready.power_flow.residual <= 1e-9
        v = ready.power_flow.voltages
        turn = np.deg2rad(net.res_bus.va_degree[30]) - cmath.phase(v["bus_31"])
        for k, found in net.res_bus.iterrows():
            wanted = cmath.rect(found.vm_pu, np.deg2rad(found.va_degree))
            assert abs(v[f"bus_{net.bus.name[k]}"] * cmath.exp(1j * turn) - wanted) < tolerance


def test_every_unit_has_its_published_inertia_and_the_frequency_is_the_networks():
    ready = prepare("base")
    stored = {
        n: ready.values[f"sg{n}.machine.H"] * ready.values[f"sg{n}.S_n"] / 100
        for n in range(30, 40)
    }
    published = (42.0, 30.3, 35.8, 28.6, 26.0, 34.8, 26.4, 24.3, 34.5, 500.0)  # [s] on 100 MVA
    assert tuple(stored.values()) == pytest.approx(published)
    assert {ready.values[f"{name}.f_n"] for name in ready.system.components} == {60.0}


@pytest.mark.parametrize(("scenario", "damping"), [("base", (5, 7)), ("gfor", (11, 14))])
def test_bus_39_swings_against_the_others_at_seven_tenths_of_a_hertz(scenario, damping):
    result = compute_modes(prepare(scenario))
    mode = result.named["inter-area"]
    assert 0.65 < mode.frequency_hz < 0.75
    assert damping[0] < mode.damping_percent < damping[1]
    assert mode.participation[0][0] in ("sg39.machine.omega", "sg39.machine.delta")
    assert not result.warnings
    assert result.operating_point.residual < 1e-9


@pytest.mark.slow
def test_the_stray_capacitance_hardly_moves_the_mode_and_too_little_of_it_is_warned_of():
    wanted = compute_modes(prepare("gfor")).named["inter-area"]
    for stray in (0.025, 0.1):
        mode = compute_modes(prepare("gfor", {"grid.stray_B": stray})).named["inter-area"]
        assert mode.frequency_hz == pytest.approx(wanted.frequency_hz, abs=1e-3)
        assert mode.damping_percent == pytest.approx(wanted.damping_percent, abs=0.05)
    warnings = compute_modes(prepare("gfor", {"grid.stray_B": 0.01})).warnings
    assert any("numerically unstable" in text for text in warnings)


@pytest.mark.slow
def test_an_outage_has_modes_of_its_own():
    whole, outage = (
        compute_modes(prepare("base", overrides)).named["inter-area"]
        for overrides in ({}, {"grid.line_16_17.connected": False})
    )
    assert outage.frequency_hz < whole.frequency_hz - 0.01


@pytest.mark.nightly
@pytest.mark.slow
def test_a_line_trips_and_recloses_and_a_unit_trips():
    ready = prepare("line_trip", stop_time=6.0)
    run = run_scenario(ready).dataset
    line = run["grid.line_16_17.p"]
    assert abs(line.sel(time=slice(1.02, 1.14))).max() < 1e-3
    assert line.values[-1] == pytest.approx(line.values[0], abs=0.05)
    ready = prepare("unit_trip", stop_time=6.0)
    run = run_scenario(ready).dataset
    assert all(np.isfinite(run[name]).all() for name in run.data_vars)
    assert abs(run["sg36.p"].sel(time=slice(1.02, None))).max() < 1e-6
    assert run["sg36.omega"].values.max() > 1.1
    assert 0.97 < run["sg39.omega"].values[-1] < 1.0
