"""After how many communication steps sampled components repeat together."""

from fractions import Fraction
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models import sampled


@pytest.mark.parametrize(("steps", "refused"), [(3, False), (4, True)])
def test_a_common_period_may_be_as_long_as_the_longest(steps, refused, monkeypatch):
    """Three steps of a third of it are not one third of a rounding longer."""
    step = sampled.LONGEST / 3
    monkeypatch.setattr(
        sampled,
        "repeating",
        lambda master: {"a": (steps * Fraction(step).limit_denominator(10**12),)},
    )
    if refused:
        with pytest.raises(AnalysisError, match="more than 1 s"):
            sampled.steps_of_period(SimpleNamespace(), step)
    else:
        assert sampled.steps_of_period(SimpleNamespace(), step) == steps
