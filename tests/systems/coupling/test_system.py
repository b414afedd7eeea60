"""What a component's variables are before anything runs."""

from types import SimpleNamespace

import pytest

from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.system import ComponentPlan
from tests.systems.coupling.small_fmus import small_fmu


def test_what_is_set_comes_before_the_start_value():
    plan = ComponentPlan(small_fmu("gain"))
    assert plan.value("K") == 1.0
    plan.parameters["K"] = 0.0
    assert plan.value("K") == 0.0
    assert plan.number("offset") == 0.0


def test_a_constant_for_an_input_is_a_value_that_is_set():
    plan = ComponentPlan(small_fmu("started_gain"))
    assert plan.value("u") == 0.5
    plan.inputs["u"] = 0.25
    assert plan.number("u") == 0.25


def test_an_output_without_a_start_value_has_none_and_counts_as_zero():
    plan = ComponentPlan(small_fmu("gain"))
    assert plan.value("y") is None
    assert plan.number("y") == 0.0


def test_an_unknown_name_is_no_value():
    with pytest.raises(InputError, match="KK"):
        ComponentPlan(small_fmu("gain")).value("KK")


def test_only_what_takes_a_voltage_and_gives_a_current_stands_at_a_bus():
    """A meter takes a voltage as well, and a measured current is given without one: neither is a converter."""
    voltage, current = ("v_re", "v_im"), ("i_re", "i_im")

    def plan(inputs, outputs):
        return ComponentPlan(SimpleNamespace(kind="", inputs=inputs, outputs=outputs))

    device, meter, recorded = (
        plan(inputs, outputs)
        for inputs, outputs in ((voltage, current), (voltage, ("size",)), (("u",), current))
    )
    assert [(each.has_port, each.kind) for each in (device, meter, recorded)] == [
        (True, "converter"),
        (False, ""),
        (False, ""),
    ]
