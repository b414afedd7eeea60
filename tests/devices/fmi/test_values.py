"""A value of a model description is typed once, by its variable's type, and a malformed one is refused."""

import pytest

from orchestrator.devices.fmi.values import as_text, typed


@pytest.mark.parametrize(
    ("fmi_type", "text", "value"),
    [
        ("Real", "1e-3", 0.001),
        ("Real", "INF", float("inf")),
        ("Integer", "-2", -2),
        ("Enumeration", "3", 3),
        ("Boolean", "true", True),
        ("Boolean", "1", True),
        ("Boolean", "false", False),
        ("Boolean", " 0 ", False),
        ("String", "0", "0"),
        ("Array", "1 2", "1 2"),
    ],
)
def test_a_value_has_the_type_of_its_variable(fmi_type, text, value):
    found = typed(text, fmi_type)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("fmi_type", "text", "rule"),
    [
        ("Real", "", "a number, such as 0.5"),
        ("Real", "1,5", "a number, such as 0.5"),
        ("Integer", "2.5", "a whole number of 64 bits at most, such as 2"),
        ("Integer", "9" * 400, "a whole number of 64 bits at most, such as 2"),
        ("Enumeration", "red", "the whole number of one of its items"),
        ("Boolean", "True", "true, false, 1 or 0"),
        ("Boolean", "2", "true, false, 1 or 0"),
    ],
)
def test_a_malformed_value_is_refused_with_the_rule(fmi_type, text, rule):
    with pytest.raises(ValueError, match=f"^a variable of type {fmi_type} takes {rule}$"):
        typed(text, fmi_type)


@pytest.mark.parametrize(
    ("value", "text"), [(True, "true"), (False, "false"), (2, "2"), (0.1, "0.1"), ("a", "a")]
)
def test_a_value_is_written_as_it_is_read(value, text):
    assert as_text(value) == text
