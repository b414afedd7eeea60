"""The sentence that says which components were not perturbed, and how their models were found instead."""

from orchestrator.linear.models.linear_model import DIRECTIONAL, IDENTIFIED, PACKED, PERTURBED
from orchestrator.output.report.linearised import exceptions_in_words


def test_nothing_is_said_where_all_were_perturbed():
    assert exceptions_in_words({"a": PERTURBED, "b": PERTURBED}) is None


def test_each_way_is_named_with_its_components():
    said = exceptions_in_words(
        {"a": DIRECTIONAL, "b": PACKED, "c": IDENTIFIED, "d": PERTURBED}, {"c": 1.23e-4}
    )
    assert "a from its FMU's directional derivatives" in said
    assert "b from the model packed in its FMU" in said
    assert "c (fitting error 1.2e-04) identified from its response" in said
    assert said.endswith("all others by perturbing the running FMUs.")


def test_where_none_was_perturbed_no_others_are_spoken_of():
    assert "others" not in exceptions_in_words({"a": DIRECTIONAL, "b": IDENTIFIED})


def test_of_many_components_the_first_are_named_and_all_are_counted():
    said = exceptions_in_words({f"unit_{k}": DIRECTIONAL for k in range(9)})
    assert "unit_5 … 9 in all from its" in said
    assert "unit_6" not in said
