"""The law between the power that is asked and that is found: turned, mirrored and shifted."""

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks.port import _fit
from orchestrator.devices.binding.misfits import diagnosis, of_power

ASKED = np.array([0.5, 0.3 + 0.2j, -0.4 + 0.1j, -0.2j, 0.7])


@pytest.mark.parametrize(
    "law", [(1, 0, 0), (-1, 0, 0), (0.2 + 0.1j, 0.8, 0), (1, 0, 0.05 - 0.02j), (0.5j, 0.1, -0.3)]
)
def test_a_law_is_found_with_nothing_left(law):
    a, b, c = law
    *found, rest = _fit(ASKED, a * ASKED + b * ASKED.conj() + c)
    assert found == pytest.approx(law, abs=1e-12)
    assert rest < 1e-12


@pytest.mark.parametrize(
    ("law", "fault", "words"),
    [
        ((np.exp(0.1j), 0, 0, 0), "wrong frame", "turned by -5.7°"),
        ((0.985, 0.015, 0, 0), "power not as asked", "0.015"),
        ((0.97, 0, 0, 0), "wrong base", "0.97 times"),
        ((-1, 0, 0, 0), "wrong sign", "opposite"),
        ((0.5, 0.5, 0, 0), "wrong axes", "signed differently"),
        ((0.1, 1, 0, 0), "wrong axes", "scaled"),
    ],
)
def test_a_law_has_its_name(law, fault, words):
    """A share of P that is lost turns nothing."""
    name, says = diagnosis("i", *map(complex, law[:3]), law[3])
    assert name == fault
    assert words in says


def test_a_power_at_the_start_has_its_fault_and_its_words():
    found = of_power(0.5 + 0.1j, -0.5 - 0.1j)
    assert found.fault == "wrong sign"
    assert "at the start" in found.evidence
    assert of_power(0.5 + 0.1j, 0.51 + 0.1j) is None


def test_what_no_law_gives_is_left():
    found = ASKED + np.array([0, 0, 0.1, 0, 0])
    assert 0.01 < _fit(ASKED, found)[3] < 0.1
