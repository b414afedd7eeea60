"""A slow eigenvalue beside the free angle is no edge of a limit; a governor at its limit still is."""

import numpy as np
import pytest
import scipy.linalg

from orchestrator.linear.doubts.slow_modes import tell_slow_modes
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_questions import CASE, DYR, RAW
from tests.support.scenarios import prepare_one

SEXS = "'SEXS' 1  0.1 10.0 50.0 0.05 -5.0 5.0 /"
PLAIN = "\n".join(
    f"{x[:2]}{SEXS}" if "EXST1" in x else x
    for x in DYR.splitlines()
    if "TGOV1" not in x and "STAB1" not in x
)
REACTIVE = 0.0547716
"""Of unit 2 [pu, S_n], from the power flow."""
AT_LIMIT = "2 'TGOV1'  1  0.05 0.5  {limit} 0.0  2.1 7.0  0.0 /"


@pytest.fixture
def stability(tmp_path):
    """The verdict on the two areas without governors and stabilisers, with more records."""

    def judge(*more):
        (tmp_path / "areas.raw").write_text(RAW)
        (tmp_path / "areas.dyr").write_text("\n".join([PLAIN, *more, ""]))
        (tmp_path / "case.toml").write_text(CASE.replace('"power"', '"impedance"'))
        prepared = prepare_one(tmp_path / "case.toml", None, {"grid.load_9.P": 1500.0})
        return compute_modes(prepared).stability

    return judge


def test_a_system_without_governors_is_judged(stability):
    assert stability().stable is True


def test_a_governor_at_its_limit_leaves_the_verdict_open(stability):
    # ZR's losses included
    of_turbine = 700 / 900 + 0.0025 * (abs(complex(700 / 900, REACTIVE)) / 1.01) ** 2
    found = stability(AT_LIMIT.format(limit=of_turbine + 2e-6))
    assert found.stable is None
    assert "sg2" in found.reason


def test_a_governor_away_from_its_limit_is_judged(stability):
    assert stability(AT_LIMIT.format(limit=0.9)).stable is True


def test_slow_modes_that_the_step_splits_are_told_beside_the_exact_ones():
    """A step map with ±j·0.005 where the system has a double zero: the figures say nothing, and both are shown."""
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    split = np.array([[0.0, 1.0], [-2.5e-5, 0.0]])
    step = 1e-3
    seen = LinearModel.from_matrix(scipy.linalg.expm(split * step), ("a.x", "a.y"), step)
    modes = find_modes(seen, 0.0, 1.0)
    (said,) = tell_slow_modes(seen, LinearModel.from_matrix(A, ("a.x", "a.y"), None), modes)
    assert "it has +0.0000 ± j0.0050, " in said
    assert "there are +0.0000, +0.0000" in said
    assert tell_slow_modes(seen, LinearModel.from_matrix(split, ("a.x", "a.y"), None), modes) == ()
    assert tell_slow_modes(seen, None, modes) == ()
