"""The built-in case nordic44: an independent computation and the FMUs against TOPS, and the tables of its README."""

import cmath
import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import BUILT_IN
from orchestrator.studies.modes.modes import compute_modes
from tests.reference.multi_machine import hertz_and_percent
from tests.reference.nordic44 import Nordic44
from tests.support.scenarios import prepare_one
from tests.support.tables import figures

pytestmark = pytest.mark.reproduction

PAGE = (BUILT_IN / "nordic44" / "README.md").read_text(encoding="utf-8")
AGAINST, CONTROLS = "Modes, against TOPS", "With controls"
TOPS = json.loads(
    (Path(__file__).parents[1] / "reference" / "nordic44_tops.json").read_text(encoding="utf-8")
)
HERTZ, POINTS = 6e-5, 6e-3
"""Half of a last digit, and what rounding to it may add."""

WINDINGS = {"cascade": False, "slack_shared": True}
MOVING = WINDINGS | {"emf_with_speed": True}
ROWS = {
    "independent, as TOPS": {},
    "GENROU's windings": WINDINGS,
    "the emf in proportion to speed": MOVING,
    "besides: windings with X_l = 0.05 pu": MOVING | {"X_l": 0.05},
    "besides: windings with X_l = 0.15 pu": MOVING | {"X_l": 0.15},
    "besides: as TOPS, constant torque": {"constant_torque": True},
}


def slow_swings(eigenvalues):
    """The four modes below 1.06 Hz that README.md names, by frequency."""
    found = [
        z for z in eigenvalues if 0.3 < z.imag / (2 * np.pi) < 1.057 and -z.real < 0.25 * abs(z)
    ]
    return sorted(found, key=lambda z: z.imag)


def growth(eigenvalues):
    return max(z.real for z in eigenvalues if abs(z.imag) < 1e-6)


def assert_row(heading, label, modes, hertz=HERTZ, points=POINTS):
    cells = figures(PAGE, heading, label)
    for cell, z in zip(cells[:4], modes, strict=True):
        f, damping = hertz_and_percent(z)
        assert f == pytest.approx(cell[0], abs=hertz)
        assert damping == pytest.approx(cell[1], abs=points)
    return cells


def test_the_independent_power_flow_is_that_of_tops():
    found = Nordic44()
    for name, v in zip(found.buses, found.voltages, strict=True):
        size, angle = TOPS["voltages"][name]
        assert abs(v) == pytest.approx(size, abs=1e-6)
        assert np.rad2deg(cmath.phase(v)) == pytest.approx(angle, abs=1e-4)


def test_the_independent_modes_are_those_of_tops():
    found = Nordic44().eigenvalues()
    wanted = [complex(*z) for z in TOPS["manual"]]
    assert np.abs(np.subtract(slow_swings(found), wanted[:4])).max() < 2e-5
    assert growth(found) == pytest.approx(TOPS["growth"], abs=2e-6)


@pytest.mark.parametrize("label", ROWS)
def test_the_independent_rows(label):
    found = Nordic44(**ROWS[label]).eigenvalues()
    cells = assert_row(AGAINST, label, slow_swings(found))
    assert growth(found) == pytest.approx(cells[4][0], abs=HERTZ)


def test_the_rows_of_tops():
    wanted = [complex(*z) for z in TOPS["manual"][:4]]
    assert_row(
        AGAINST,
        "TOPS 0.3.0, its own linearisation",
        [complex(*z) for z in TOPS["its own linearisation"]],
    )
    assert assert_row(AGAINST, "TOPS' equations, differences of 1e-5", wanted)[4] == [
        round(TOPS["growth"], 4)
    ]
    for label, modes in TOPS["controls"].items():
        assert_row(CONTROLS, label, [complex(*z) for z in modes])


def test_the_growth_is_the_lost_synchronising_torque_of_northern_norway():
    """Less power there, or a field flux that does not follow, takes it away."""
    less, held = Nordic44(), Nordic44()
    less.__dict__["units"] = [
        row | ({"p_mw": str(0.85 * float(row["p_mw"]))} if row["bus"] == "6100" else {})
        for row in less.units
    ]
    times = np.where(held.at == held.buses.index("6100"), 1e4, 1.0)
    held.__dict__["data"] = held.data | {"T_d10": held.data["T_d10"] * times}
    assert growth(less.eigenvalues()) == pytest.approx(0.0132, abs=2e-4)
    assert growth(held.eigenvalues()) == pytest.approx(0.0013, abs=2e-4)
    assert np.rad2deg(cmath.phase(less.voltages[less.buses.index("6100")])) == pytest.approx(
        36.6, abs=0.1
    )


@pytest.mark.slow
def test_the_fmus_without_controls():
    ready = prepare_one("nordic44", "manual")
    voltages = ready.power_flow.voltages
    for name, v in zip(Nordic44().buses, Nordic44().voltages, strict=True):
        assert voltages[f"bus_{name}"] == pytest.approx(v, abs=2e-5)
    result = compute_modes(ready, (0.3, 1.3))
    assert_row(
        AGAINST,
        "lag of the coupling: the FMUs at 2 ms",
        slow_swings(m.eigenvalue for m in result.modes),
    )
    assert not result.stability.stable
    assert not result.warnings  # the angles part: it is no drift of the common speed


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["base", "pss", "gfor", "pod_p", "pod_q", "pod_pq"])
def test_the_rows_with_controls(scenario):
    ready = prepare_one("nordic44", scenario)
    result = compute_modes(ready, (0.3, 1.3))
    found = [m.eigenvalue for m in result.modes]
    for hertz, percent in figures(PAGE, CONTROLS, scenario):
        near = min((hertz_and_percent(z) for z in found), key=lambda mode: abs(mode[0] - hertz))
        assert near == (pytest.approx(hertz, abs=HERTZ), pytest.approx(percent, abs=POINTS))
    assert result.stability.stable == (scenario not in ("base", "gfor"))
    # SEXS' long lead and lag are questioned, and a mode that was followed is told
    assert all(
        "exciter.T_" in str(text) or " is followed to " in str(text) for text in result.warnings
    )
