"""The built-in cases k2a and ieee39_tops: PowerFactory's recorded speeds, TOPS' errors and modes, our own equations.

Every figure of the two pages is held here.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from orchestrator.cases.case import BUILT_IN
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.run import run_scenario
from tests.reference.multi_machine import hertz_and_percent
from tests.reference.rotor_circuits import Axis, classical_data, of_short_circuit_data
from tests.reference.short_circuit import ShortCircuit, rms_micro
from tests.reference.tops_systems import recorded_speeds, tops_system
from tests.support.scenarios import prepare_one
from tests.support.tables import figures

pytestmark = pytest.mark.reproduction

CASES = {"k2a": "k2a", "ieee39_tops": "ieee39"}
DURATION = {"k2a": 0.1, "ieee39": 0.05}
SPEEDS, CHANGES = "Speeds after the short circuit", "What each difference does"
MODES, CONVERTER = "Modes", "With a converter"
PAGES = {case: (BUILT_IN / case / "README.md").read_text(encoding="utf-8") for case in CASES}
HERTZ, POINTS, MICRO = 6e-5, 6e-3, 0.06
"""Half of a last digit, and what rounding to it may add."""


def row(case, heading, label):
    return np.concatenate([np.array(cell) for cell in figures(PAGES[case], heading, label)])


@cache
def errors_of_fmus(case, machine="genrou_rated_speed"):
    ready = prepare_one(case, "pss", {"sg*.machine": machine})
    data = run_scenario(ready).dataset
    names = tops_system(CASES[case]).bus + 1
    speeds = np.column_stack(
        [np.interp(np.arange(2000) * 5e-3, data["time"], data[f"sg{k}.omega"]) for k in names]
    )
    return rms_micro(speeds, recorded_speeds(CASES[case])), speeds


def errors_of_equations(name, **choice):
    found = ShortCircuit(tops_system(name), **choice).speeds(DURATION[name])
    return rms_micro(found, recorded_speeds(name))


ROWS = {
    "TOPS' machine": {"rotor": "tops"},
    "circuit of GENROU": {"rotor": "classical"},
    "circuit of short-circuit data": {"rotor": "short-circuit"},
    "besides: X_l = 0.02": {"rotor": "short-circuit", "X_l": 0.02},
    "besides: X_l = 0.2": {"rotor": "short-circuit", "X_l": 0.2},
    "besides: the emf in proportion to speed": {"rotor": "short-circuit", "emf_with_speed": True},
}


@pytest.mark.parametrize("case", CASES)
def test_the_recordings_begin_at_rest_and_the_power_flow_is_the_cases(case):
    name = CASES[case]
    assert recorded_speeds(name).shape == (2000, len(tops_system(name).names))
    assert (recorded_speeds(name)[:201] == 1).all()
    ready = prepare_one(case, "pss")
    ours = np.array(
        [ready.power_flow.voltages[f"bus_{k + 1}"] for k in range(len(tops_system(name).v))]
    )
    assert np.abs(ours - tops_system(name).v).max() < 2e-5


@pytest.mark.parametrize("case", CASES)
def test_the_machines_data_are_converted_from_tops_tables(case):
    ready = prepare_one(case, "pss")
    system = tops_system(CASES[case])
    g, omega_b = system.data, 2 * np.pi * system.frequency
    for k, bus in enumerate(system.bus + 1):
        for axis in "dq":
            values = [
                g[key.format(axis)][k]
                for key in ("X_{}", "X_{}_t", "X_{}_st", "T_{}0_t", "T_{}0_st")
            ]
            own = [
                ready.values[f"sg{bus}.machine.{key}"]
                for key in (f"X_{axis}1", f"T_{axis}10", f"T_{axis}20")
            ]
            if values[0] == values[1]:  # no slow winding
                wanted = (values[1], values[3], values[4])
            else:
                a = Axis(*values[:3], 0.1, *values[3:])
                wanted = classical_data(of_short_circuit_data(a, omega_b), 0.1, omega_b)
            assert own == pytest.approx(wanted, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("label", ROWS)
@pytest.mark.parametrize("case", CASES)
def test_the_rows_of_the_independent_equations(case, label):
    assert errors_of_equations(CASES[case], **ROWS[label]) == pytest.approx(
        row(case, CHANGES, label), abs=MICRO
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_every_machines_speed_is_nearer_to_powerfactorys_than_tops_speed_is(case):
    found, _ = errors_of_fmus(case)
    assert found == pytest.approx(row(case, SPEEDS, "FMUs"), abs=MICRO)
    assert (found <= row(case, SPEEDS, "TOPS 0.3.0")).all()


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_fmus_follow_the_independent_equations(case):
    """To 5 s: the four seconds behind the fault are the first swings, which are the largest."""
    _, speeds = errors_of_fmus(case)
    equations = ShortCircuit(tops_system(CASES[case]), "short-circuit", step=1e-3).speeds(
        DURATION[CASES[case]], stop=4.995
    )
    swing = np.sqrt(np.mean((equations - 1) ** 2))
    apart = speeds[: len(equations)] - equations
    assert np.sqrt(np.mean(apart**2)) < 3e-3 * swing


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_row_with_the_emf_in_proportion_to_speed(case):
    assert errors_of_fmus(case, "genrou")[0] == pytest.approx(
        row(case, SPEEDS, "FMUs of genrou"), abs=MICRO
    )


# -- modes -----------------------------------------------------------------------------------------


def wanted_modes(case, label):
    return [tuple(cell) for cell in figures(PAGES[case], MODES, label)]


def assert_modes(found, cells):
    """Each printed (frequency, damping) belongs to one of the eigenvalues."""
    all_found = np.array([hertz_and_percent(z) for z in found])
    for hertz, percent in cells:
        near = np.abs(all_found - (hertz, percent))
        assert (near < (HERTZ, POINTS)).all(axis=1).any(), (hertz, percent)


@pytest.mark.parametrize("stabilisers", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_with_tops_machine_the_equations_have_the_modes_that_tops_finds(case, stabilisers):
    scenario = "pss" if stabilisers else "no_pss"
    found = ShortCircuit(tops_system(CASES[case]), "tops", stabilisers=stabilisers).eigenvalues()
    assert_modes(found, wanted_modes(case, f"{scenario} | TOPS 0.3.0"))


OF_K2A = {"exciter.T_E": 0.5, "governor.T_1": 0.1, "governor.T_2": 0.09, "governor.T_3": 0.2}
"""In what TOPS' system k2a differs from its k2a_val."""


@pytest.mark.parametrize("scenario", ["pss", "no_pss"])
def test_the_modes_of_tops_system_k2a(scenario):
    system = tops_system("k2a")
    changed = {
        f"{'SEXS' if key[0] == 'e' else 'TGOV1'}.T_{key[-1].lower()}": v
        for key, v in OF_K2A.items()
    }
    data = system.data | {key: np.full(4, value) for key, value in changed.items()}
    assert data.keys() == system.data.keys()
    found = ShortCircuit(
        replace(system, data=data), "tops", stabilisers=scenario == "pss"
    ).eigenvalues()
    assert_modes(found, wanted_modes("k2a", f"{scenario}, k2a | TOPS 0.3.0"))


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["pss", "no_pss"])
def test_the_fmus_modes_with_the_data_of_tops_system_k2a(scenario):
    ready = prepare_one("k2a", scenario, {f"sg*.{key}": value for key, value in OF_K2A.items()})
    found = compute_modes(ready, (0.1, 3.0))
    assert_modes(
        [m.eigenvalue for m in found.modes], wanted_modes("k2a", f"{scenario}, k2a | FMUs")
    )
    named = [found.named[name].eigenvalue for name in ("inter-area", "area 1", "area 2")]
    # though the areas are less than 90° apart
    assert_modes(named, wanted_modes("k2a", f"{scenario}, k2a | FMUs"))
    assert len({*named}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["pss", "no_pss"])
@pytest.mark.parametrize("case", CASES)
def test_the_fmus_modes_are_those_of_the_independent_equations(case, scenario):
    ready = prepare_one(case, scenario)
    found = [m.eigenvalue for m in compute_modes(ready, (0.1, 3.0)).modes]
    assert_modes(found, wanted_modes(case, f"{scenario} | FMUs"))
    equations = ShortCircuit(
        tops_system(CASES[case]), "short-circuit", stabilisers=scenario == "pss"
    ).eigenvalues()
    swings = [z for z in equations if z.imag > 2.2 and -z.real < 0.4 * abs(z)]
    for z in swings:
        assert np.abs(np.array(found) - z).min() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["no_pss", "gfor", "pod_p", "pod_q"])
@pytest.mark.parametrize("case", CASES)
def test_the_rows_with_a_converter(case, scenario):
    ready = prepare_one(case, scenario)
    named = compute_modes(ready).named
    cells = figures(PAGES[case], CONVERTER, scenario)
    assert len(cells) == len(named)
    for mode, (hertz, percent) in zip(named.values(), cells, strict=True):
        assert (mode.frequency_hz, mode.damping_percent) == pytest.approx(
            (hertz, percent), abs=POINTS
        )
        assert mode.frequency_hz == pytest.approx(hertz, abs=HERTZ)
