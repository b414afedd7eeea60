"""The open load model is weighed in one line, whatever the number of scenarios."""

import math
from types import SimpleNamespace

import pytest

from orchestrator.studies.modes import load_model_weight
from tests.support.scenarios import bare_scenario


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        (
            [(3.1, "more"), (0.1, "least"), (0.0, "")],
            ["scenario 'b', the least damped of 2: least"],
        ),
        ([(1.6, "the same"), (1.6, "the same"), (0.0, "")], ["the same"]),
        (
            [(9.0, "much"), (0.1, "little"), (-math.inf, "no modes")],
            ["scenario 'c', the least damped of 3: no modes"],
        ),
        ([(0.0, "")] * 3, []),
    ],
)
def test_the_scenario_with_the_least_damping_is_told(monkeypatch, weights, said):
    found = dict(zip("abc", weights, strict=True))
    monkeypatch.setattr(
        load_model_weight, "_weight", lambda scenario, result, frequencies: found[scenario]
    )
    results = [SimpleNamespace(prepared=bare_scenario(name)) for name in "abc"]
    assert load_model_weight.load_model_weights("abc", results, (0.1, 2.0)) == said
