"""The law between the power that is asked and that is found: turned, mirrored and shifted."""

import numpy as np
import pytest

from orchestrator.acceptance.checks.port import _fit

ASKED = np.array([0.5, 0.3 + 0.2j, -0.4 + 0.1j, -0.2j, 0.7])


@pytest.mark.parametrize("law", [(1, 0, 0), (-1, 0, 0), (0.2 + 0.1j, 0.8, 0), (1, 0, 0.05 - 0.02j), (0.5j, 0.1, -0.3)])
def test_a_law_is_found_with_nothing_left(law):
    a, b, c = law
    *found, rest = _fit(ASKED, a * ASKED + b * ASKED.conj() + c)
    assert found == pytest.approx(law, abs=1e-12)
    assert rest < 1e-12


def test_what_no_law_gives_is_left():
    found = ASKED + np.array([0, 0, 0.1, 0, 0])
    assert 0.01 < _fit(ASKED, found)[3] < 0.1
