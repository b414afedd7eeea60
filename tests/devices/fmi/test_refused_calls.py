"""A component that refuses to start is told from one that fails later, or whose process ended."""

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.refused_calls import refuses_to_start


@pytest.mark.parametrize(
    ("call", "status", "refuses"),
    [
        ("fmi2EnterInitializationMode", "fmi2Error", True),
        ("fmi3ExitInitializationMode", "fmi3Discard", True),
        ("fmi2ExitInitializationMode", "an error in the log", True),
        ("fmi2ExitInitializationMode", "fmi2Fatal", False),
        ("fmi2ExitInitializationMode", "killed by signal 9", False),
        ("fmi2DoStep", "fmi2Error", False),
    ],
)
def test_a_refusal_to_start_is_known_by_the_call_and_its_status(call, status, refuses):
    assert refuses_to_start(ComponentError("sg", call, status, "InitializationMode")) is refuses
