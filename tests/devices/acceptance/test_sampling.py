"""How many steps are run until an FMU's own sample time is known."""

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import sampling


@pytest.mark.parametrize(
    ("every", "affordable", "tried"),
    [
        (3.0, 1e9, [200]),
        (2.5, 1e9, [200, 2000]),
        (90.0, 1e9, [200, 2000]),
        (2.5, 50, [200]),
        (1e6, 1e9, [200, 2000, 20000]),
    ],
)
def test_what_is_no_multiple_of_the_step_is_looked_at_for_longer(
    every, affordable, tried, monkeypatch
):
    lengths = []
    monkeypatch.setattr(
        sampling,
        "affordable",
        lambda subject, length, h: lengths.append(length) or min(length, affordable),
    )
    monkeypatch.setattr(
        sampling,
        "_changes",
        lambda subject, steps, h: (np.diff(np.arange(steps + 1) // every) > 0)[:, None],
    )
    found = sampling._sample_time(None, 1e-3)
    assert lengths == tried
    assert found == (pytest.approx(1e-3 * every, rel=0.02) if every < 1e6 else None)
