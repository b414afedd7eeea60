"""Which parameters the acceptance tests move, and to what: flags and counts have no values between."""

from types import SimpleNamespace

import pytest

from orchestrator.devices.acceptance.checks.settings import elsewhere
from orchestrator.devices.fmi.description import VariableInfo


def moved(start, unit=None, minimum=None, maximum=None):
    info = SimpleNamespace(
        causality="parameter",
        variability="tunable",
        type="Real",
        start=str(start),
        start_number=float(start),
        unit=unit,
        minimum=minimum,
        maximum=maximum,
    )
    assert all(hasattr(VariableInfo, n) or n in VariableInfo.__annotations__ for n in vars(info))
    subject = SimpleNamespace(
        description=SimpleNamespace(variables={"k": info}), use=SimpleNamespace(values={})
    )
    return elsewhere(subject).get("k")


@pytest.mark.parametrize(
    ("start", "unit", "bounds", "expected"),
    [
        (0, None, (None, None), None),
        (1, "-", (None, None), None),
        (0, None, (0, 1), 1),
        (1, "", (0, 1), 0),
        (2, "N/A", (2, 2), None),
        (0.5, None, (None, None), 0.55),
        (20, "rad/s", (None, None), 22),
        (0, "pu", (None, None), 0.1),
        (0.98, "pu", (0, 1), None),
    ],
)
def test_a_flag_moves_by_one_within_its_bounds_and_a_gain_by_a_tenth(start, unit, bounds, expected):
    assert moved(start, unit, *bounds) == (None if expected is None else pytest.approx(expected))
