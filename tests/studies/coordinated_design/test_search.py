"""The search for settings: starts that are improved, and steps that are trusted."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.coordinated_design.objective import (
    Watched,
    Worth,
)
from orchestrator.studies.coordinated_design.search import SettingSearch, Tried, _Program


@pytest.mark.parametrize(("groups", "alone"), [(1, 0), (2, 2)])
def test_as_many_starts_as_were_asked_for_are_improved(groups, alone, monkeypatch):
    """Those of each group alone come on top."""
    search = SettingSearch(SimpleNamespace(groups=["a", "b"][:groups]), ())
    improved = []
    monkeypatch.setattr(search, "tried", lambda x: Tried(x, Worth(0.1, -1.0)))
    monkeypatch.setattr(search, "_coarse", lambda: (np.array([float(k), 0.0]) for k in range(9)))
    monkeypatch.setattr(
        search, "_alone", lambda: [search.tried(np.array([-5.0 - k, 0.0])) for k in range(alone)]
    )
    monkeypatch.setattr(search, "improved", lambda one: improved.append(one) or one)
    search.best(3, polish=False)
    assert len(improved) == alone + 3


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_a_step_goes_where_the_damping_rises_and_no_further_than_trusted(slope):
    mode = Watched(5 * complex(-0.1, 1.0), 0, None)
    program = _Program([(mode, np.array([slope]))], np.array([-1.0]), np.array([0.2]))
    assert program.change(0.1) == pytest.approx([np.copysign(0.1, slope)])
    assert program.change(0.5) == pytest.approx([0.2 if slope > 0 else -0.5])
