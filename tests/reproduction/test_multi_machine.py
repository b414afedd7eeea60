"""The independent computation of the published systems: against the books' figures, ANDES, and its own limits."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.andes_peers import cases, modes_in_andes
from tests.reference.multi_machine import Branch, Machine, System, hertz_and_percent
from tests.reference.published import kundur, wscc9

pytestmark = pytest.mark.reproduction

ANDES = json.loads(
    (Path(__file__).parents[1] / "benchmarks" / "andes.json").read_text(encoding="utf-8")
)

SAUER_AND_PAI = [
    -0.7209 + 12.7486j,
    -0.1908 + 8.3672j,
    -5.4875 + 7.9487j,
    -5.3236 + 7.9220j,
    -5.2218 + 7.8161j,
    -5.1761,
    -3.3995,
    -0.4445 + 1.2104j,
    -0.4394 + 0.7392j,
    -0.4260 + 0.4960j,
    -3.2258,
    0.0,
]
"""The nominal case with loads of constant power [rad/s], from memory; of each pair one."""


def test_every_eigenvalue_of_sauer_and_pai():
    found = wscc9().eigenvalues()
    for value in SAUER_AND_PAI:
        assert np.abs(found - value).min() < 0.004
    assert len(found) == 2 * len(SAUER_AND_PAI) - 3  # three are real, 0 is double


def test_the_books_frequencies_of_kundurs_example():
    """Its dampings are met in the inter-area mode alone; README.md of the case says what is known about that."""
    for scenario, book in {
        "manual": ((0.545, 3.2), (1.087, 7.2), (1.117, 7.2)),
        "thyristor": ((0.61, -0.8),),
        "tgr": ((0.55, -3.6),),
        "pss": ((0.60, 13), (1.28, 22), (1.33, 22)),
    }.items():
        for (f, damping), z in zip(book, kundur(scenario).swings(), strict=False):
            hertz, percent = hertz_and_percent(z)
            assert hertz == pytest.approx(f, rel=0.025)
            assert percent == pytest.approx(damping, abs=0.7 if f < 1 else 2.0)


@pytest.mark.parametrize("name", ANDES["modes"])
def test_andes_has_the_same_modes(name):
    kept = [complex(*z) for z in ANDES["modes"][name]]
    assert cases()[name].swings() == pytest.approx(kept, abs=2e-5)


def test_all_that_is_compared_is_kept():
    assert list(ANDES["modes"]) == list(cases())


@pytest.fixture(scope="module")
def andes(tmp_path_factory):
    """ANDES writes the code of its models into the home directory."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        yield pytest.importorskip("andes", reason="ANDES is not installed")


@pytest.mark.slow
@pytest.mark.usefixtures("andes")
@pytest.mark.parametrize("name", ANDES["modes"])
def test_andes_still_has_them(name):
    assert modes_in_andes(cases()[name]) == pytest.approx(
        [complex(*z) for z in ANDES["modes"][name]], abs=1e-5
    )


def test_two_machines_on_a_line_swing_as_the_formula_says():
    """With T'_0 without end the emfs are constant: ω² = ω_b·K·(1/2H_1 + 1/2H_2), K = E_1·E_2/X·cos δ."""
    X1, X, H, P = 0.3, 0.2, (3.0, 5.0), 0.6
    units = tuple(
        Machine(bus, 100.0, power, 1.0, h, X_d=X1, X_q=X1, X_d1=X1, X_q1=X1, T_d10=1e9, T_q10=1e9)
        for bus, power, h in ((1, P, H[0]), (2, -P, H[1]))
    )
    system = System(2, (Branch(1, 2, 0.0, X),), {}, (), units, slack=2)
    (z,) = system.swings(low=0.1, high=5)
    v = system.power_flow()
    i = (v[0] - v[1]) / (1j * X)
    E = np.array([v[0] + 1j * X1 * i, v[1] - 1j * X1 * i])
    K = abs(E[0] * E[1]) / (X + 2 * X1) * np.cos(np.angle(E[0] / E[1]))
    assert z.imag == pytest.approx(
        np.sqrt(120 * np.pi * K * (1 / (2 * H[0]) + 1 / (2 * H[1]))), rel=1e-6
    )
    assert z.real == pytest.approx(0, abs=1e-6)
    powers = replace(
        system, constant_torque=False, machines=tuple(replace(m, H=4.0) for m in units)
    )
    # Powers of ±P damp one machine and drive the other by as much; a damping D of both is felt as D/(4H).
    damped = replace(
        powers, constant_torque=True, machines=tuple(replace(m, H=4.0, D=2.0) for m in units)
    )
    assert powers.swings(0.1, 5)[0].real == pytest.approx(0, abs=1e-6)
    assert damped.swings(0.1, 5)[0].real == pytest.approx(-2.0 / 16, rel=1e-6)
