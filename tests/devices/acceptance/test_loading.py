"""What a binary lacks of the functions that its FMU declares, and what it has beside them."""

from types import SimpleNamespace

import pytest

from orchestrator.devices.acceptance.checks import loading
from orchestrator.devices.acceptance.checks.base import Verdict


@pytest.mark.parametrize(
    ("answer", "verdict", "words"),
    [
        ([[], []], Verdict.PASS, "its binary loads, has all functions, and gives an instance"),
        ([["fmi2DoStep", "fmi2Reset"], []], Verdict.FAIL, "has no fmi2DoStep, fmi2Reset"),
        ([[], ["fmi2GetString"]], Verdict.REMARK, "has no fmi2GetString, which nothing that it"),
    ],
)
def test_what_it_lacks_is_a_fault_and_what_nothing_needs_a_remark(
    answer, verdict, words, monkeypatch
):
    process = SimpleNamespace(
        talk=lambda doing, number, command: answer, typed=lambda form, found: form(found)
    )
    described = SimpleNamespace(clocks={}, fmi_version="2.0")
    monkeypatch.setattr(loading, "without_binding", lambda description: described)
    subject = SimpleNamespace(
        description=None,
        process=lambda: process,
        open=lambda: SimpleNamespace(close=lambda: None),
    )
    result = loading.loads(subject)
    assert (result.check, result.verdict) == ("loads", verdict)
    assert words in result.evidence
