"""Which schedules a component without saved states can be tried with, and when a parameter moves nothing."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.studies.modes import step_choice
from orchestrator.studies.sensitivities import sensitivities
from orchestrator.studies.sensitivities.parameters import Parameter


class TriedError(Exception):
    """It went on."""


@pytest.mark.parametrize(
    ("schedule", "saves", "goes_on"),
    [("newton", False, False), ("newton", True, True), ("gauss-seidel", False, True)],
)
def test_newton_alone_needs_components_that_save_their_state(schedule, saves, goes_on, monkeypatch):
    def go_on(*_, **__):
        raise TriedError

    monkeypatch.setattr(step_choice, "Blocks", go_on)
    component = SimpleNamespace(description=SimpleNamespace(can_save_state=saves))
    prepared = SimpleNamespace(rescheduled=lambda name: SimpleNamespace(schedule=name))
    with pytest.raises(TriedError if goes_on else AnalysisError):
        step_choice._trial(
            prepared, SimpleNamespace(components={"a": component}), schedule, 1e-3, np.zeros(0), 0.0
        )


@pytest.mark.parametrize(("moved", "stays"), [(0.0, True), (5e-14, True), (5e-13, False)])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_what_moves_by_no_more_than_rounding_stays(size, moved, stays, monkeypatch):
    """By rounding of its size, or of 1 where it is smaller."""
    answers = [np.array([size]), *[np.array([size + moved * max(1.0, size)])] * 2]
    monkeypatch.setattr(sensitivities, "_answer", lambda master, name: answers.pop(0))
    monkeypatch.setattr(sensitivities, "changed", lambda *_: nullcontext())
    assert sensitivities._stays(None, Parameter("a", "K", "pu", 2.0, tunable=True), 1) is stays
