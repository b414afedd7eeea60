"""Places in a network with many buses: what is left out of the work changes no figure of what is looked into."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.modes import modes
from orchestrator.studies.siting import confirmation, residues
from orchestrator.studies.siting.study import DEVICE, SiteRequest, find_sites
from orchestrator.studies.siting.view import Siting, as_json, remarks

EXACT = 1e-8
FIRST_ORDER = 1e-2
"""What a support of 1 MW/Hz does to the voltage of its own bus changes its effect by less than this part."""


def places(confirm=0, **asked):
    return find_sites(load_case("wscc9"), SiteRequest("droop", confirm=confirm, **asked))


def shifts(found, bus):
    return [by_bus[bus] for by_bus in found.shifts[DEVICE]["intact"].values()]


@pytest.fixture(scope="module")
def whole():
    return places()


@pytest.fixture
def large(monkeypatch):
    monkeypatch.setattr(residues, "MANY_BUSES", 4)
    monkeypatch.setattr(residues, "_PLACES", 2)
    monkeypatch.setattr(residues, "_STRONGEST", 1)


@pytest.mark.usefixtures("large")
def test_the_best_buses_are_looked_into_and_the_others_told(whole):
    found = places()
    inside = found.intact.looked_into
    assert found.ranking[0] in inside
    assert set(found.ranking) > inside & set(found.ranking)
    assert found.ranking[:2] == whole.ranking[:2]
    for bus in found.intact.voltages:
        allowed = EXACT if bus in inside else FIRST_ORDER
        for one, other in zip(shifts(found, bus), shifts(whole, bus), strict=True):
            assert abs(one.change - other.change) <= allowed * abs(other.change)
            assert one.part == pytest.approx(other.part, rel=FIRST_ORDER)
    left = len(set(found.ranking) - inside)
    assert any(
        text.startswith(f"{left} of the {len(found.ranking)} buses") for text in remarks(found)
    )
    told = {bus["bus"]: bus["looked_into"] for bus in as_json(found)["buses"]}
    assert told == {bus: bus in inside for bus in found.ranking}


@pytest.mark.usefixtures("large")
def test_of_buses_that_are_named_nothing_is_said_of_the_others(whole):
    asked = whole.ranking[-2:]
    found = places(buses=asked)
    assert set(found.intact.voltages) == set(found.ranking) == set(asked)
    for bus in asked:
        for one, other in zip(shifts(found, bus), shifts(whole, bus), strict=True):
            assert abs(one.change - other.change) <= EXACT * abs(other.change)
            assert (one.part, one.hardly) == (None, False)
    assert (
        f"looked at: the 2 of {len(whole.intact.voltages)} buses that --buses names; "
        "what the others would do is not known"
    ) in remarks(found)
    shift = as_json(found)["buses"][0]["shift"]
    assert all(one["part_of_best"] is one["controllable"] is None for one in shift.values())
    assert "not looked at" in Siting(found).page_text()


def test_in_a_system_too_large_only_modes_damped_less_than_the_followed_one_are_searched(
    monkeypatch,
):
    expected = places(confirm=1).confirmations[0]
    below, whole = [], modes.find_critical_modes

    def searched(model, low, high, damping):
        below.append(damping)
        return whole(model, low, high, damping)

    monkeypatch.setattr(confirmation, "WHOLE", 0)
    monkeypatch.setattr(modes, "find_critical_modes", searched)
    found = places(confirm=1).confirmations[0]
    assert below == [pytest.approx(damping_ratio(found.with_device))]
    assert found.least == pytest.approx(expected.least)
    assert (found.stable, found.agrees) == (expected.stable, expected.agrees)
