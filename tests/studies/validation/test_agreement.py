"""Whether an event that was kept back from a fit agrees with it, as a word beside the figures."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.validation.study import (
    FitCheck,
    with_agreement,
)
from orchestrator.studies.validation.words import fit_sentence

FIT = SimpleNamespace(fitted_to=["may"], runs=10, finished=True, reached=True, holds=True)


def said(fitted, kept, scatter=1e-4):
    """The word on an event that was kept back; rms errors before and after the fit [pu]."""
    checks = with_agreement(
        [FitCheck("may", True, *fitted), FitCheck("june", False, *kept, scatter=scatter)]
    )
    return fit_sentence(FIT, {"june": checks[1].agrees}), checks[1].as_json()["agrees"]


@pytest.mark.parametrize(
    ("fitted", "kept", "word", "agrees"),
    [
        ((0.01, 0.001), (0.008, 0.001), "june was kept back, and agrees", True),
        ((0.01, 0.001), (0.008, 0.0078), "june was kept back, and does NOT agree", False),
        ((0.01, 0.001), (0.008, 0.005), "june was kept back, and does NOT agree", False),
        ((0.01, 0.001), (0.008, 0.004), "june was kept back, and agrees", True),
        ((0.01, 0.001), (0.008, 0.012), "june was kept back, and does NOT agree", False),
        ((0.01, 0.001), (1.6e-4, 1.5e-4), "june was kept back, and agrees", True),
        ((1.5e-4, 1.49e-4), (1.5e-4, 1.5e-4), "june was kept back, and tells nothing", None),
    ],
)
def test_an_event_kept_back_agrees_or_not(fitted, kept, word, agrees):
    sentence, in_json = said(fitted, kept)
    assert word in sentence
    assert in_json is agrees
