"""The built-in case kundur: its FMUs against the independent computation, and every table of its README."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from fmus.synchronous_generator.conversion import AxisData, exact
from fmus.toolchain.symbols import Expr
from orchestrator.cases.case import BUILT_IN, load_case
from orchestrator.studies.modes.modes import compute_modes
from tests.reference.air_gap_saturation import AirGapUnit
from tests.reference.multi_machine import hertz_and_percent
from tests.reference.published import KUNDUR_EXCITERS, kundur
from tests.support.scenarios import prepare_one
from tests.support.tables import figures
from tests.support.variants import as_phasors, with_load_model

pytestmark = pytest.mark.reproduction

PAGE = (BUILT_IN / "kundur" / "README.md").read_text(encoding="utf-8")
BOOK, STEPS, CONVERTER = "Against the book", "What each assumption does", "With a converter"
ORDER = ("inter-area", "area 1", "area 2")
HERTZ, POINTS = 6e-5, 6e-3
"""Half of a last digit, and what rounding to it may add."""


def assert_row(heading, label, found):
    cells = figures(PAGE, heading, label)
    assert len(cells) == len(found) == 3
    for (hertz, percent), (f, damping) in zip(cells, found, strict=True):
        assert f == pytest.approx(hertz, abs=HERTZ)
        assert damping == pytest.approx(percent, abs=POINTS)


def of_fmus(scenario, overrides=None, case=None):
    (ready,) = (case or load_case("kundur")).prepare([scenario], overrides or {})
    named = compute_modes(ready).named
    return [(named[name].frequency_hz, named[name].damping_percent) for name in ORDER]


def independent(system):
    return [hertz_and_percent(z) for z in system.swings()]


@pytest.mark.parametrize("scenario", KUNDUR_EXCITERS)
def test_the_independent_rows(scenario):
    assert_row(BOOK, f"{scenario} | independent", independent(kundur(scenario)))


def converted_exactly(system):
    """Standard data of stability programs for the windings that the exact conversion of the book's data gives."""

    def of_axis(X, X1, X2, X_l, T1, T2):
        omega_b = 120 * np.pi
        b = exact(AxisData(*(Expr(x) for x in (X, X1, X2, X_l, T1, T2))), Expr(omega_b))
        X_1, R_1, X_2, R_2 = (float(x) for x in (b.X_1, b.R_1, b.X_2, b.R_2))
        X_m = X - X_l
        both = X_m * X_1 / (X_m + X_1)
        return X_l + both, (X_m + X_1) / (omega_b * R_1), (X_2 + both) / (omega_b * R_2)

    def of_machine(m):
        X_d1, T_d10, T_d20 = of_axis(m.X_d, m.X_d1, m.X_d2, m.X_l, m.T_d10, m.T_d20)
        X_q1, T_q10, T_q20 = of_axis(m.X_q, m.X_q1, m.X_d2, m.X_l, m.T_q10, m.T_q20)
        return replace(m, X_d1=X_d1, T_d10=T_d10, T_d20=T_d20, X_q1=X_q1, T_q10=T_q10, T_q20=T_q20)

    return replace(system, machines=tuple(of_machine(m) for m in system.machines))


ASSUMPTIONS = {
    "saturation of stability programs": lambda: kundur("manual"),
    "loads of constant impedance": lambda: kundur("manual", active=2.0),
    "the emf in proportion to speed": lambda: kundur("manual", active=2.0, emf_with_speed=True),
    "stray capacitance of 0.05 pu": lambda: kundur(
        "manual", active=2.0, emf_with_speed=True, stray_B=0.05
    ),
    "besides: the second row, no saturation": lambda: kundur("manual", saturation=False),
    "besides: the second row, data converted exactly": lambda: converted_exactly(kundur("manual")),
}


@pytest.mark.parametrize("label", ASSUMPTIONS)
def test_what_each_assumption_does(label):
    assert_row(STEPS, label, independent(ASSUMPTIONS[label]()))


PUBLISHED = [(-0.111, 3.43), (-0.492, 6.82), (-0.506, 7.02)]
"""Of table E12.3 [1/s, rad/s]."""


@pytest.mark.parametrize("scenario", KUNDUR_EXCITERS)
def test_the_rows_of_the_books_equations(scenario):
    """And what the page says of their distance from the book."""
    found = independent(kundur(scenario, unit=AirGapUnit))
    assert_row(BOOK, f"{scenario} | book's equations", found)
    if scenario == "tgr_pss":
        return
    book = [cell for cell in figures(PAGE, BOOK, f"{scenario} | book") if cell]
    for (f, damping), (hertz, percent) in zip(found, book, strict=False):
        assert f == pytest.approx(hertz, rel=0.02)
        assert damping == pytest.approx(percent, abs=0.3 if percent < 20 else 1.1)


def test_the_books_equations_have_the_published_modes_to_the_last_digit():
    found = kundur("manual", unit=AirGapUnit).swings()
    assert_row(STEPS, "the book's equations", [hertz_and_percent(z) for z in found])
    for z, (real, imag) in zip(found, PUBLISHED, strict=True):
        assert z.real == pytest.approx(real, abs=5e-4)
        assert z.imag == pytest.approx(imag, abs=0.015)


class TotalAlone(AirGapUnit):
    """Around the operating point as much saturated as at it."""

    def factors(self, flux):
        total, _ = super().factors(flux)
        return total, total


class Recording(AirGapUnit):
    """Keeps the factors of all machines."""

    seen: ClassVar[list[tuple[float, float]]] = []

    def factors(self, flux):
        self.seen.append(super().factors(flux))
        return self.seen[-1]


class Unsaturated(AirGapUnit):
    """Without iron."""

    def factors(self, flux):
        return 1.0, 1.0


def test_what_the_page_says_of_saturation():
    system = kundur("manual", unit=Recording)
    system.swings()
    total, incremental = np.array(Recording.seen).T
    assert set(total.round(2)) == {0.93}
    assert (incremental.min().round(2), incremental.max().round(2)) == (0.55, 0.58)
    local = independent(kundur("manual", unit=TotalAlone))[1:]
    assert [round(damping, 1) for _, damping in local] == [8.7, 8.6]


def test_without_iron_both_machines_are_one():
    """Windings' fluxes and the transient emfs of stability programs are two forms of the same linear machine."""
    windings = kundur("manual", unit=Unsaturated).swings()
    emfs = kundur("manual", saturation=False).swings()
    assert windings == pytest.approx(emfs, rel=1e-6)


def test_what_the_page_says_of_speed():
    """With the thyristor exciter; and of the common speed."""
    found = [
        hertz_and_percent(kundur("thyristor", active=2.0, emf_with_speed=w).swings()[0])[1]
        for w in (False, True)
    ]
    assert found == pytest.approx([-0.82, -1.86], abs=0.006)
    for scenario, rate in (("manual", -0.0151), ("thyristor", 0.0599)):
        values = kundur(scenario, active=2.0, emf_with_speed=True).eigenvalues()
        assert np.abs(values - rate).min() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("scenario", KUNDUR_EXCITERS)
def test_the_fmus_rows(scenario):
    found = of_fmus(scenario)
    assert_row(BOOK, f"{scenario} | FMUs", found)
    phasors = independent(kundur(scenario, active=2.0, emf_with_speed=True, stray_B=0.05))
    for (f, damping), (hertz, percent) in zip(found, phasors, strict=True):
        assert f == pytest.approx(hertz, abs=6e-4)
        assert damping == pytest.approx(percent, abs=0.2 if damping < 10 else 0.6)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", KUNDUR_EXCITERS)
def test_the_rows_of_fmus_with_the_books_loads(scenario, tmp_path):
    """And what the page says of their distance from the independent computation."""
    found = of_fmus(scenario, case=with_load_model("kundur", tmp_path, 'active = "current"'))
    assert_row(BOOK, f"{scenario} | FMUs, current", found)
    phasors = independent(kundur(scenario, active=1.0, emf_with_speed=True, stray_B=0.05))
    for (f, damping), (hertz, percent) in zip(found, phasors, strict=True):
        assert f == pytest.approx(hertz, abs=7e-4)
        assert damping == pytest.approx(percent, abs=0.2 if damping < 10 else 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["thyristor", "gfor", "pod_p", "pod_q"])
def test_the_rows_with_a_converter(scenario):
    assert_row(CONVERTER, scenario, of_fmus(scenario))


@pytest.mark.slow
def test_the_rows_of_fmus_with_one_change():
    assert_row(STEPS, "stator and network transients: the FMUs", of_fmus("manual"))
    assert_row(
        STEPS,
        "besides: FMUs, constant power instead of torque",
        of_fmus("manual", {"sg*.governor": "constant_power"}),
    )
    assert_row(STEPS, "besides: FMUs, no saturation", of_fmus("manual", UNSATURATED))


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["manual", "thyristor", "tgr", "pss"])
def test_the_phasor_models_are_the_independent_computation(scenario, tmp_path):
    (ready,) = as_phasors("kundur", tmp_path).prepare([scenario])
    named = compute_modes(ready).named
    wanted = kundur(scenario, active=2.0, emf_with_speed=True, stray_B=0.05).swings()
    for name, value in zip(ORDER, wanted, strict=True):
        assert abs(named[name].eigenvalue - value) < 4e-4


UNSATURATED = {"sg*.machine.s_10": 0.0, "sg*.machine.s_12": 0.0}
CONSTANT_POWER = UNSATURATED | {"sg*.governor": "constant_power"}
SOMEONE_ELSES = {
    ("manual", "power"): [(0.5427, 4.03), (1.0835, 8.85), (1.1190, 8.64)],
    ("manual", "torque"): [(0.5425, 3.11), (1.0834, 8.39), (1.1189, 8.17)],
    ("thyristor", "power"): [(0.6079, -0.73), (1.1366, 8.85), (1.1713, 8.57)],
    ("tgr", "power"): [(0.5452, -2.86), (1.0886, 8.23), (1.1241, 8.08)],
}
"""Scenario and what is constant of the turbines → modes of an EMT model without saturation in NumPy, written by someone
else from Kundur's equations."""


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "constant"), SOMEONE_ELSES)
def test_the_modes_are_those_of_an_independent_emt_model(scenario, constant):
    found = of_fmus(scenario, CONSTANT_POWER if constant == "power" else UNSATURATED)
    for (hertz, percent), (wanted_hertz, wanted_percent) in zip(
        found, SOMEONE_ELSES[scenario, constant], strict=True
    ):
        assert hertz == pytest.approx(wanted_hertz, abs=3e-4)
        assert percent == pytest.approx(wanted_percent, abs=0.02)


@pytest.mark.slow
def test_governors_hold_the_common_speed():
    ready = prepare_one("kundur", "pss", {"sg*.governor": "tgov1"})
    found = compute_modes(ready)
    assert found.stability.stable
    assert not found.warnings
