"""An FMU that starts at no operating point: the first reason is told, and whether it came from a step."""

from types import SimpleNamespace

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks import port


@pytest.mark.parametrize(
    ("reasons", "fault"),
    [
        (("fmi2DoStep", "fmi2SetReal", "fmi2EnterInitializationMode"), "error in a step"),
        (("fmi2SetReal", "fmi2DoStep", "fmi2EnterInitializationMode"), "does not start"),
    ],
)
def test_the_first_reason_is_told(monkeypatch, reasons, fault):
    left = list(reasons)

    def refusing(point):
        raise ComponentError("box", left.pop(0), "error", "no reason")

    monkeypatch.setattr(port, "affordable", lambda *_: 10)
    monkeypatch.setattr(port, "_points", lambda subject: [1, 2, 3, 4])
    result = port.steady_state(SimpleNamespace(starts=True, running=refusing, memory={}))
    assert result.fault == fault
    assert reasons[0] in result.evidence
    assert not left
