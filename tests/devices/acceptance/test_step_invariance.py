"""Whether an answer converges with shorter steps, from how far it is away at two, four and eight of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import timing
from orchestrator.devices.acceptance.checks.base import Verdict

H = 1e-3
"""Communication step [s]."""


@pytest.mark.parametrize(
    ("first", "second", "verdict", "words"),
    [
        (0.0005, 0.0005, Verdict.PASS, "differ by 0.0005 of the range"),
        (0.014, 0.02, Verdict.REMARK, "it converges, but needs a smaller communication step"),
        (0.016, 0.02, Verdict.FAIL, "step-dependent answer"),
        (0.11, 0.9, Verdict.FAIL, "step-dependent answer"),
    ],
)
def test_a_difference_counts_as_it_falls_with_the_step(first, second, verdict, words, monkeypatch):
    """Half the step leaves less than three quarters of the difference where it converges."""
    rows = [np.zeros((8, 1))] * 3
    apart = iter((first, second))
    monkeypatch.setattr(timing, "_at_step_sizes", lambda subject: rows)
    monkeypatch.setattr(timing, "_typical", lambda coarse, fine: next(apart))
    monkeypatch.setattr(timing, "switches_elsewhere", lambda watched, pairs: "")
    result = timing.step_invariance(
        SimpleNamespace(
            step_size=H,
            memory={"base step": H},
            watched=["y"],
            description=SimpleNamespace(default_step_size=None),
            use=SimpleNamespace(step_size=None),
        )
    )
    assert result.verdict == verdict
    assert words in f"{result.fault} {result.evidence} {result.remedy}"
    assert result.figures == {"difference_H_2H": first, "difference_2H_4H": second}
