"""Which setting is the final one: that of the equations, that of a search, or that of another gain."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.pod_design import design

SEARCHED = SimpleNamespace(eigenvalue=-0.8 + 4j, setting="searched")
DESIGNED = SimpleNamespace(eigenvalue=-0.4 + 4j, setting="designed")


def chosen(monkeypatch, found, *, required, refine=False, gain_bounds=None):
    """The choice where a search finds so, and whether it was searched."""
    searches = []

    def search(*_):
        searches.append(1)
        return SimpleNamespace(chosen=found)

    monkeypatch.setattr(design, "_refined", search)
    monkeypatch.setattr(design, "sweep", lambda *_: SimpleNamespace(chosen=None))
    judge = SimpleNamespace(
        start=SimpleNamespace(
            request=SimpleNamespace(
                refine=refine, gain_bounds=gain_bounds, bounds=lambda search: (0.0, 1.0)
            ),
            off=None,
        ),
        loop=None,
        around=lambda placed: SimpleNamespace(counting=lambda eigenvalue: eigenvalue, of=placed),
        breach_in=lambda after: None,
    )
    choice = design._choose(judge, DESIGNED, None, required, lambda stage: None)
    assert choice.after.of is choice.final
    return choice, bool(searches)


@pytest.mark.parametrize(("found", "final"), [(SEARCHED, SEARCHED), (None, DESIGNED)])
@pytest.mark.parametrize(("required", "refine"), [(0.2, False), (0.05, True)])
def test_what_a_search_finds_is_the_final_one_and_else_the_designed(
    monkeypatch, found, final, required, refine
):
    """The designed one has a damping ratio of 0.0995."""
    choice, searched = chosen(monkeypatch, found, required=required, refine=refine)
    assert searched
    assert choice.final is final
    assert choice.refinement.chosen is found


@pytest.mark.parametrize(("required", "gain_bounds"), [(0.05, None), (0.2, (1.0, 2.0))])
def test_a_setting_that_suffices_or_a_bounded_gain_is_not_searched(
    monkeypatch, required, gain_bounds
):
    choice, searched = chosen(monkeypatch, SEARCHED, required=required, gain_bounds=gain_bounds)
    assert (choice.final, choice.refinement, searched) == (DESIGNED, None, False)
