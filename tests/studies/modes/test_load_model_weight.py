"""The open load model is weighed in one line, whatever the number of scenarios."""

import math
from types import SimpleNamespace

import pytest

from orchestrator.linear.spectra.modes import Mode
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


def modes_of(damping):
    """What the modes of an open load model give, with a mode of this damping [%] at about 1 Hz."""
    prepared = bare_scenario(
        "base",
        case=SimpleNamespace(table=SimpleNamespace(network=None)),
        network=SimpleNamespace(loads=(SimpleNamespace(name="load_1"),)),
    )
    ratio = damping / 100
    mode = Mode(2 * math.pi * complex(-ratio, math.sqrt(1 - ratio**2)), (), {})
    return SimpleNamespace(
        prepared=prepared, model=SimpleNamespace(number_of_states=4), modes=(mode,)
    )


@pytest.mark.parametrize(
    ("as_impedance", "as_power", "said"),
    [
        (0.81, -8.12, "impedance 0.81 % at 1.000 Hz, power -8.12 % at 0.997 Hz, unstable; write"),
        (-0.5, 3.0, "impedance -0.50 % at 1.000 Hz, unstable, power 3.00 % at 1.000 Hz; write"),
        (3.0, 2.0, "impedance 3.00 % at 1.000 Hz, power 2.00 % at 1.000 Hz; write"),
        (-3.0, -2.0, "impedance -3.00 % at 1.000 Hz, power -2.00 % at 1.000 Hz; write"),
    ],
)
def test_a_load_model_that_turns_the_sign_is_told_as_unstable(
    monkeypatch, as_impedance, as_power, said
):
    monkeypatch.setattr(load_model_weight, "is_open", lambda network: True)
    monkeypatch.setattr(load_model_weight, "compute_modes", lambda other, _: modes_of(as_power))
    here = modes_of(as_impedance)
    other = SimpleNamespace(prepared=here.prepared)
    scenario = SimpleNamespace(with_loads_as_powers=lambda: other)
    (text,) = load_model_weight.load_model_weights([scenario], [here], (0.1, 2.0))
    assert said in text
