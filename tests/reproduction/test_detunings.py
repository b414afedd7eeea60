"""The verdict on detuned systems against brute force: 60 s of simulation, exact Jacobians, exact step map."""

import numpy as np
import pytest

from tests.benchmarks.detunings import CHOSEN_BY_HAND, FORTY, SEED, ask, drawn, growth_of_record

pytestmark = pytest.mark.reproduction

TIMES = np.arange(0, 60, 5e-3)


@pytest.mark.parametrize("rate", [0.01, 0.05, -0.01, -0.05, 0.3])
@pytest.mark.parametrize("hertz", [0.0, 0.2, 37.0])
def test_the_record_alone_tells_growth_from_decay(rate, hertz):
    """A fast mode that dies out beside it, and rounding, change nothing."""
    rng = np.random.default_rng(0)
    ringing = np.exp(rate * TIMES) * np.cos(2 * np.pi * hertz * TIMES) + 20 * np.exp(-0.5 * TIMES)
    slope, _ = growth_of_record(
        TIMES, np.abs(1e-6 * ringing + 1e-12 * rng.standard_normal(len(TIMES)))
    )
    assert slope == pytest.approx(rate, abs=0.004)


def test_what_came_to_rest_is_rounding_and_neither_grows_nor_decays():
    rng = np.random.default_rng(0)
    away = 1e-3 * np.exp(-TIMES) + 1e-13 * np.abs(rng.standard_normal(len(TIMES)))
    assert growth_of_record(TIMES, away) == (-np.inf, "at rest")


def test_the_draws_are_what_they_were():
    """The table in the page is of these."""
    assert (SEED, list(FORTY)) == (631, list(range(40)))
    assert drawn(SEED, 0).values == {"sg2.governor.inverse_R": 13.9}
    assert drawn(SEED, 1).values == {
        "gfor2.droop.R_f": 0.649,
        "gfor2.droop.R_V": 0.289,
        "gfor2.droop.tau_P": 0.0161,
    }
    assert drawn(SEED, 19).jacobi


CHOSEN = {
    0: "slow",
    1: "fast",
    3: "slow decay",
    8: "fast",
    19: "Jacobi",
    20: "near",
    26: "coupling",
    33: "fast",
}
"""Of the forty; `python -m tests.benchmarks.detunings` asks all."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "detuning",
    [*(drawn(SEED, k) for k in CHOSEN), *CHOSEN_BY_HAND],
    ids=[*(f"{k}-{what}" for k, what in CHOSEN.items()), *(d.name for d in CHOSEN_BY_HAND)],
)
def test_the_verdict_is_that_of_simulation_and_of_the_exact_equations(detuning):
    answers = ask(detuning)
    assert answers.agree, answers
    judged = answers.system if answers.coupled <= 0 < answers.system else answers.coupled
    assert answers.program.largest_growth_rate == pytest.approx(judged, rel=0.03, abs=1e-4)
    if np.isfinite(answers.simulated):
        assert answers.simulated == pytest.approx(answers.coupled, abs=0.2)
