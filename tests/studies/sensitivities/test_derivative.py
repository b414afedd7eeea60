"""Derivatives from differences of two sizes, on curves whose derivative is known."""

import pytest

from orchestrator.studies.sensitivities.derivative import Shift, differentiate
from orchestrator.studies.sensitivities.parameters import Parameter
from orchestrator.studies.sensitivities.sensitivities import Sensitivity

SLOPE = 3.0 - 2.0j


def derivative(curve, value=1.0, **bounds):
    parameter = Parameter("a", "p", "1", value, True, **bounds)
    return differentiate(parameter, lambda p: Shift(curve(p - value), curve(p - value)), -0.5 + 6j)


@pytest.mark.parametrize(
    ("bounds", "power"),
    [({}, 3), ({"minimum": 1.0}, 2), ({"maximum": 1.0}, 2)],
    ids=["both sides", "above", "below"],
)
def test_what_the_first_power_of_the_change_leaves_out_falls_out(bounds, power):
    """A cubic term on both sides, a square one on one side: the derivative is exact for either."""
    found = derivative(lambda x: SLOPE * x + 2e3 * x**power, **bounds)
    assert found.step == pytest.approx(SLOPE, rel=1e-9)
    assert found.continuous == pytest.approx(SLOPE, rel=1e-9)


@pytest.mark.parametrize("value", [2.0, -2.0])
def test_a_percent_of_a_negative_parameter_is_a_percent_of_its_size_upwards(value):
    """As the page of results says: the sign is that of a parameter that rises."""
    row = Sensitivity(Parameter("a", "p", "1", value, True), -0.5 + 6j, SLOPE, SLOPE, "stays")
    assert row.frequency_per_percent == pytest.approx(0.02 * row.frequency_per_unit)
    assert row.damping_per_percent == pytest.approx(0.02 * row.damping_per_unit)
    assert row.effect == pytest.approx(0.02 * abs(SLOPE))
