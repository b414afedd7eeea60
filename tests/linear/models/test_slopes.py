"""When slopes upwards and downwards are alike enough to be a linear model."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.linear.models import slope_linearization as slopes


@pytest.mark.parametrize(
    ("up", "down", "near", "alike"),
    [
        (-1000.0, -1001.0, -1000.5, True),
        (-1000.0, -1300.0, -1150.0, False),
        (1e-4, -1e-4, 0.0, True),
        (0.02, -0.02, 0.0, False),
        (0.0, 0.0, 0.0, True),
        (-1000.0, -1000.0, -10000.0, False),  # a limit on both sides, within a tenth
        (-950.0, -950.0, -1000.0, False),  # and just within the whole
        (0.0, 0.0, 5.0, False),  # a bump
        (-1000.0, -1050.0, -1022.5, True),  # curved
    ],
)
def test_slopes_of_sides_or_sizes_that_differ_are_no_linear_model(
    up, down, near, alike, monkeypatch
):
    description = SimpleNamespace(states=("x",), rates=("der(x)",))
    exchange = SimpleNamespace(
        component=SimpleNamespace(name="a", description=description),
        inputs=SimpleNamespace(names=()),
        outputs=SimpleNamespace(names=()),
    )
    answers = slopes.Slopes(*(np.array([[answer]]) for answer in (up, down, near)))
    found = SimpleNamespace(names=("x",), one_by_one=lambda: answers)
    monkeypatch.setattr(slopes, "_Point", lambda *_: found)
    monkeypatch.setattr(slopes, "linearize_component", lambda *_, **__: None)
    model = slopes.linearize_slopes(exchange, 0.0, 1e-4)
    assert (model is not None) is alike
    assert not alike or model.A_c == pytest.approx(np.array([[(up + down) / 2]]))


@pytest.mark.parametrize(
    ("settable", "rates", "gives"),
    [
        (True, ("der(x)", "der(y)"), True),
        (True, ("der(x)",), False),
        (False, ("der(x)", "der(y)"), False),
        (False, (), False),
    ],
)
def test_slopes_need_states_that_can_be_set_and_a_derivative_of_each(settable, rates, gives):
    description = SimpleNamespace(
        states=("x", "y"), rates=rates, states_are_settable=settable, name="a"
    )
    exchange = SimpleNamespace(component=SimpleNamespace(description=description))
    assert slopes.gives_slopes(exchange) is gives


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2])
def test_variables_without_a_common_answer_are_moved_together(share):
    """Each is in the first group that has none of its answers, those with most answers first."""
    pattern = np.random.default_rng(5).random((60, 50)) < share
    pattern[:40, 3] = True
    groups = slopes._groups(pattern)
    assert sorted(np.concatenate(groups).tolist()) == list(range(50))
    order = np.argsort(-pattern.sum(axis=0), kind="stable").tolist()
    for place, group in enumerate(groups):
        assert pattern[:, group].sum(axis=1).max() <= 1
        for k in group.tolist():
            earlier = order[: order.index(k)]
            for other in groups[:place]:
                there = [one for one in other.tolist() if one in earlier]
                assert (pattern[:, there].any(axis=1) & pattern[:, k]).any()
