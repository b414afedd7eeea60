"""The built-in case wscc9: its FMUs against the independent computation and ANDES, and every table of its README."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import BUILT_IN, load_case
from orchestrator.studies.modes.modes import compute_modes
from tests.reference.multi_machine import hertz_and_percent
from tests.reference.published import quadratic, with_subtransients, wscc9
from tests.support.scenarios import prepare_one
from tests.support.tables import figures
from tests.support.variants import as_phasors, with_load_model

pytestmark = pytest.mark.reproduction

PAGE = (BUILT_IN / "wscc9" / "README.md").read_text(encoding="utf-8")
TABLES, CONVERTER = "Against the book and ANDES", "With a converter"
HERTZ, POINTS = 6e-5, 6e-3
"""Half of a last digit, and what rounding to it may add."""

ANDES = json.loads(
    (Path(__file__).parents[1] / "benchmarks" / "andes.json").read_text(encoding="utf-8")
)["modes"]
DAMPERS = {"sg*.machine": "genrou", "sg*.machine.T_d20": 0.03, "sg*.machine.T_q20": 0.05}
for _bus, _X_d1 in ((1, 0.0608), (2, 0.1198), (3, 0.1813)):
    DAMPERS |= {f"sg{_bus}.machine.X_d2": 0.8 * _X_d1, f"sg{_bus}.machine.X_l": 0.5 * _X_d1}

IMPEDANCES = {"exponent": 2.0, "saturation": quadratic}
MOVING = IMPEDANCES | {"emf_with_speed": True}
STRAY = MOVING | {"stray_B": 0.05}
QUARTER = {"grid.stray_B": 0.0125}
POWERS = {"saturation": quadratic, "emf_with_speed": True}


def swings(case, scenario="base", overrides=None):
    """Eigenvalues [rad/s] of both swings, the slow one first."""
    (ready,) = case.prepare([scenario], overrides or {})
    found = [m.eigenvalue for m in compute_modes(ready, (1.0, 2.5)).modes if m.damping_percent < 25]
    return sorted(found, key=lambda z: z.imag)


def assert_row(heading, label, found):
    cells = figures(PAGE, heading, label)
    assert len(cells) == len(found) == 2
    for cell, z in zip(cells, found, strict=True):
        f, damping = hertz_and_percent(z)
        assert f == pytest.approx(cell[-2], abs=HERTZ)
        assert damping == pytest.approx(cell[-1], abs=POINTS)
        if len(cell) == 4:
            assert z == pytest.approx(complex(*cell[:2]), abs=1e-4)


ROWS = {
    "independent, constant power": wscc9,
    "the book's assumptions": wscc9,
    "quadratic saturation of the exciter": lambda: wscc9(saturation=quadratic),
    "loads of constant impedance": lambda: wscc9(**IMPEDANCES),
    "besides: constant power, the emf in proportion to speed": lambda: wscc9(**POWERS),
    "besides: the same, stray capacitance of 0.05 pu": lambda: wscc9(**POWERS, stray_B=0.05),
    "independent, constant impedance": lambda: with_subtransients(wscc9(**IMPEDANCES)),
}


@pytest.mark.parametrize("label", ROWS)
def test_the_independent_rows(label):
    assert_row(TABLES, label, ROWS[label]().swings(1.0))


@pytest.mark.parametrize("load", ["impedance", "power"])
def test_the_rows_of_andes(load):
    assert_row(TABLES, f"ANDES, constant {load}", [complex(*z) for z in ANDES[f"wscc9, {load}"]])


def test_the_rows_that_stand_in_both_tables():
    """With machines of fourth order first, then with those that ANDES has."""
    before, after = PAGE.split("**ANDES** has no machine", 1)
    for text, made in ((before, wscc9), (after, lambda **more: with_subtransients(wscc9(**more)))):
        for label, choice in (
            ("the emf in proportion to speed", MOVING),
            ("stray capacitance of 0.05 pu", STRAY),
        ):
            cells = (
                figures(f"# x\n{text}", "x", label)
                if text is after
                else figures(text, TABLES, label)
            )
            for cell, z in zip(cells, made(**choice).swings(1.0), strict=True):
                assert hertz_and_percent(z)[0] == pytest.approx(cell[0], abs=HERTZ)
                assert hertz_and_percent(z)[1] == pytest.approx(cell[1], abs=POINTS)


def test_the_common_speed_grows_with_constant_torque():
    assert np.abs(wscc9(**STRAY).eigenvalues() - 0.0424).min() < 1e-4
    assert np.abs(wscc9(**IMPEDANCES).eigenvalues()).min() < 1e-3


@pytest.mark.slow
def test_the_fmus_rows():
    case = load_case("wscc9")
    found = swings(case)
    assert_row(TABLES, "FMUs, constant impedance", found)
    assert_row(TABLES, "stator and network transients: the FMUs", found)
    power = swings(case, overrides={"sg*.governor": "constant_power"})
    assert_row(TABLES, "besides: FMUs, constant power instead of torque", power)
    stray = swings(case, overrides={"grid.stray_B": 0.025})
    assert_row(TABLES, "besides: FMUs, stray capacitance of 0.025 pu", stray)
    for value, phasor in zip(found, wscc9(**STRAY).swings(1.0), strict=True):
        assert abs(value - phasor) < 0.045


def assert_near_andes(found, load, hertz, points):
    """Each mode beside that of ANDES: frequency within so many Hz, damping within so many points."""
    for value, kept in zip(found, ANDES[f"wscc9, {load}"], strict=False):
        (f, damping), (f_andes, damping_andes) = (
            hertz_and_percent(value),
            hertz_and_percent(complex(*kept)),
        )
        assert f == pytest.approx(f_andes, abs=hertz)
        assert damping == pytest.approx(damping_andes, abs=points)


@pytest.mark.slow
def test_the_fmus_rows_beside_andes():
    case = load_case("wscc9")
    found = swings(case, overrides=DAMPERS)
    assert_row(TABLES, "FMUs", found)
    assert_near_andes(found[:1], "impedance", 0.001, 0.1)
    assert_near_andes(found, "impedance", 0.0012, 0.32)
    found = swings(case, overrides=DAMPERS | QUARTER)
    assert_row(TABLES, "FMUs, stray capacitance of 0.0125 pu", found)
    assert_near_andes(found, "impedance", 0.0003, 0.13)


@pytest.mark.slow
def test_the_fmus_rows_with_constant_power(tmp_path):
    case = with_load_model("wscc9", tmp_path, 'active = "power"\nreactive = "power"')
    found = swings(case)
    assert_row(TABLES, "FMUs, constant power", found)
    assert_row(TABLES, "besides: the same, stator and network transients: the FMUs", found)
    found = swings(case, overrides=DAMPERS | QUARTER)
    assert_row(TABLES, "FMUs, constant power, 0.0125 pu", found)
    assert_near_andes(found, "power", 0.0004, 0.15)


@pytest.mark.slow
def test_a_quarter_of_the_stray_capacitance_is_enough_for_the_coupling():
    ready = prepare_one("wscc9", "base", DAMPERS | QUARTER)
    assert not [text for text in compute_modes(ready).warnings if "coupling" in text]


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["base", "gfor", "pod_p", "pod_q"])
def test_the_rows_with_a_converter(scenario):
    assert_row(CONVERTER, scenario, swings(load_case("wscc9"), scenario))


@pytest.mark.slow
def test_the_phasor_models_are_the_independent_computation(tmp_path):
    case = as_phasors("wscc9", tmp_path)
    wanted = with_subtransients(wscc9(**STRAY)).swings(1.0)
    assert np.abs(np.subtract(swings(case, overrides=DAMPERS), wanted)).max() < 6e-4
    wanted = wscc9(**STRAY).swings(1.0)
    gaps = [
        abs(swings(case, overrides={"sg*.machine.T_saliency": T})[0] - wanted[0])
        for T in (0.005, 0.001)
    ]
    assert gaps == pytest.approx([0.0206, 0.0031], abs=3e-4)


@pytest.mark.slow
def test_governors_hold_the_common_speed():
    ready = prepare_one("wscc9", "base", {"sg*.governor": "tgov1"})
    found = compute_modes(ready)
    assert found.stability.stable
    assert not found.warnings
    slow = found.named["slow"]
    assert (slow.frequency_hz, slow.damping_percent) == pytest.approx((1.3325, 2.68), abs=0.006)
