"""A refusal names each file once: its errors carry their record as a value, and no text is searched for it."""

from pathlib import Path

import pytest

from orchestrator.cases.new.refusal import of_what_was_given
from orchestrator.core.errors import CaseError, InputError, Problem

SOURCES = {"raw": Path("own.raw"), "dyr": Path("own.dyr")}


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (InputError.at("own.raw, line 5", "IDE is 7"), "own.raw, line 5: IDE is 7"),
        (InputError("own.raw and more: too many"), "own.raw: own.raw and more: too many"),
        (InputError("no bus"), "own.raw: no bus"),
    ],
)
def test_a_file_is_named_once_if_the_error_has_its_record(error, said):
    problem = Problem("line 3, network.raw", error.message, record=error.place)
    (found,) = of_what_was_given(CaseError("case.toml", [problem]), SOURCES, {}).problems
    assert str(found) == said


def test_an_option_stands_before_the_record_that_it_is_about():
    error = InputError.at("own.raw, line 5", "the slack is out of service")
    problem = Problem("power_flow.slack", error.message, record=error.place)
    given = {"--slack": ("bus_1",)}
    (found,) = of_what_was_given(CaseError("case.toml", [problem]), SOURCES, given).problems
    assert str(found) == "--slack bus_1: own.raw, line 5: the slack is out of service"
