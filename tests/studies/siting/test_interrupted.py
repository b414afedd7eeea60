"""What a search for places has found stays if its confirmations are interrupted."""

import pytest

import orchestrator as gfor
from orchestrator.studies.siting import study
from orchestrator.studies.siting.confirmation import how_sure, in_turn


@pytest.mark.parametrize(
    ("ends_at", "said"),
    [
        ("", ["bus_1: yes", "bus_2: yes"]),
        ("bus_2", ["bus_1: yes", "interrupted before coupled FMUs confirmed bus_2"]),
        ("bus_1", ["interrupted before coupled FMUs confirmed bus_1, bus_2"]),
    ],
)
def test_places_confirmed_before_an_interrupt_stay(ends_at, said):
    def confirm(place):
        if place == ends_at:
            raise KeyboardInterrupt
        return f"{place}: yes"

    counts = []
    places = ("bus_1", "bus_2")
    done = in_turn(places, confirm, counts.append)
    assert counts == [1, 2][: len(done)]
    assert how_sure(done, places[len(done) :]) == said


def test_the_ranking_is_told_if_its_confirmation_is_interrupted(monkeypatch):
    def interrupt(*given, **named):
        raise KeyboardInterrupt

    case = gfor.load("two_area_rms")
    asked = {"scenario": "gfor", "buses": ["bus_2", "bus_3"]}
    whole = case.site("droop", confirm=0, **asked)
    monkeypatch.setattr(study, "confirmed", interrupt)
    found = case.site("droop", confirm=2, **asked)
    assert found.ranking == whole.ranking
    assert found.as_json()["unconfirmed"] == [*found.ranking]
    assert any(text.startswith("interrupted before") for text in found.remarks)
    unjudged = f"{found.ranking[1]}: interrupted before coupled FMUs confirmed it"
    assert found.as_json()["open_points"][-1] == unjudged
    assert found.answer == whole.answer
