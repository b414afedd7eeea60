"""When slopes upwards and downwards are alike enough to be a linear model."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.linear.models import slope_linearization as slopes


@pytest.mark.parametrize(
    ("up", "down", "alike"),
    [
        (-1000.0, -1001.0, True),
        (-1000.0, -1300.0, False),
        (1e-4, -1e-4, True),
        (0.02, -0.02, False),
        (0.0, 0.0, True),
    ],
)
def test_slopes_that_differ_by_more_than_a_tenth_are_no_linear_model(up, down, alike, monkeypatch):
    description = SimpleNamespace(states=("x",), rates=("der(x)",))
    exchange = SimpleNamespace(
        component=SimpleNamespace(name="a", description=description),
        inputs=SimpleNamespace(names=()),
        outputs=SimpleNamespace(names=()),
    )
    found = SimpleNamespace(names=("x",), one_by_one=lambda: (np.array([[up]]), np.array([[down]])))
    monkeypatch.setattr(slopes, "_Point", lambda *_: found)
    monkeypatch.setattr(slopes, "linearize_component", lambda *_, **__: None)
    model = slopes.linearize_slopes(exchange, 0.0, 1e-4)
    assert (model is not None) is alike
    assert not alike or model.A_c == pytest.approx(np.array([[(up + down) / 2]]))
