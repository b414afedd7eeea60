"""A place that is not observed is named where its current explains the voltages, and alone where nothing is beside."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.oscillations.models import _opinion_on_a_rival


def opinion(parts, left, beyond):
    """Of ``gen``'s bus and a load, which leave these parts; beyond the best of them so much is unexplained."""
    currents = SimpleNamespace(
        parts=parts, ranking=(), fit=lambda there: there, beyond=lambda effect: beyond
    )
    rivals = SimpleNamespace(
        units={"gen": SimpleNamespace(bus="north")},
        left=dict(zip(("north", "city"), left, strict=True)),
        swung={"north": "there", "city": "elsewhere"},
    )
    return _opinion_on_a_rival(currents, rivals)


@pytest.mark.parametrize(
    ("parts", "beyond", "alone"),
    [
        ([0.01, 0.04], 0.10, True),
        ([0.01, 0.06], 0.10, False),
        ([0.01, 0.04], 0.20, False),
        ([0.01, 0.06], 0.20, False),
    ],
)
def test_it_is_alone_where_no_unit_deviates_and_nothing_is_left(parts, beyond, alone):
    found = opinion(parts, (0.1, 0.5), beyond)
    assert (found.place, found.applies, found.alone) == ("gen", True, alone)
    assert "a current of gen explains 90 % of what the voltages do" in found.reason


def test_a_load_is_named_by_itself():
    assert opinion([0.0], (0.5, 0.1), 0.0).place == "city"


@pytest.mark.parametrize(
    ("parts", "left"),
    [([0.25], (0.1, 0.5)), ([0.0], (0.45, 0.9)), ([0.0], (0.1, 0.15))],
    ids=["a unit deviates", "much is left", "two explain alike"],
)
def test_none_is_named_where_it_is_not_clear(parts, left):
    assert opinion(parts, left, 0.0) is None
