"""What is said of the damping on the way to a limit."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.sweep.limit import Ending, ParameterLimit


@pytest.mark.parametrize(
    ("damping", "said"),
    [
        ([5, 3, 6], " (on the way 3.00 % at 1)"),
        ([3, 5, 6], ""),
        ([6, 5, 3], ""),
        ([6, 5, 2, 3], " (on the way 2.00 % at 2)"),
        ([], ""),
    ],
)
def test_the_least_damping_on_the_way_is_told_where_it_is_less_than_at_both_ends(damping, said):
    tried = [
        {"kind": str(Ending.HOLDS), "damping_percent": x, "value": k} for k, x in enumerate(damping)
    ]
    failed = {"kind": str(Ending.FAILS), "damping_percent": -1.0, "value": 9}
    fake = SimpleNamespace(tried=[*tried, failed], _value=str)
    assert ParameterLimit._dip(fake) == said
