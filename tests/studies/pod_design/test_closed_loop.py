"""The loop that a design searches in: every setting has its own linear model, linearised no more often than needed."""

from contextlib import contextmanager

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra import slowest_decay, stability
from orchestrator.linear.spectra.modes import find_spectrum
from orchestrator.studies.modes.modes import running
from orchestrator.studies.pod_design import closed_loop
from orchestrator.studies.pod_design.closed_loop import PodLoop, PodSetting
from orchestrator.studies.pod_design.lead_lag import LeadLag
from tests.support.scenarios import prepare_one

ON = PodSetting(200.0, LeadLag(0.3, 0.2, 2))
STRONGER = PodSetting(300.0, LeadLag(0.3, 0.2, 2))


@contextmanager
def pod_loop():
    prepared = prepare_one("two_area", "pod_p", {"*.native": True})
    with running(prepared) as master:
        find_operating_point(master)
        yield PodLoop(master, ["gfor"], "pod_p")


@pytest.fixture
def renewed(monkeypatch):
    """Blocks whose converters were linearised again, one entry each time."""
    seen, renew = [], Blocks.renew

    def counted(self, *arguments):
        seen.append(self)
        renew(self, *arguments)

    monkeypatch.setattr(Blocks, "renew", counted)
    return seen


def test_a_setting_that_was_just_linearised_is_examined_with_that_model(renewed):
    with pod_loop() as loop:
        first = loop.examine(ON)
        assert len(renewed) == 2  # the step map, and the continuous model
        step_map = loop.model(ON)
        assert len(renewed) == 2
        assert loop.examine(ON) == first
        assert len(renewed) == 3
        other = loop.model(STRONGER)
        assert len(renewed) == 4
        # and not that of the setting in between
        assert loop.examine(ON).stability == first.stability
        np.testing.assert_array_equal(loop.model(ON).A, step_map.A)
        assert np.abs(other.A - step_map.A).max() > 1e-6


def test_after_an_error_the_blocks_are_not_taken_for_those_of_the_setting_before(
    renewed, monkeypatch
):
    with pod_loop() as loop:
        right = loop.model(ON).A

        def broken(*arguments):
            raise AnalysisError("planted")

        with monkeypatch.context() as patched:
            patched.setattr("orchestrator.studies.pod_design.closed_loop.compose", broken)
            with pytest.raises(AnalysisError, match="planted"):
                loop.model(STRONGER)
        before = len(renewed)
        np.testing.assert_array_equal(loop.model(ON).A, right)
        assert len(renewed) == before + 1


def test_one_spectrum_of_a_large_system_serves_its_verdict_and_its_modes(monkeypatch):
    """That the system without a communication step decays is proved without another spectrum."""
    computed = []

    def counted(model, *within):
        computed.append(model)
        return find_spectrum(model, *within)

    monkeypatch.setattr(closed_loop, "find_spectrum", counted)
    with pod_loop() as loop:
        by_both = loop.examine(ON).stability
        monkeypatch.setattr(slowest_decay, "LEAST_STATES", 0)
        monkeypatch.setattr(stability, "whole_spectrum", None)
        proved = loop.examine(ON).stability
        assert proved.stable is by_both.stable is True
        assert proved.continuous_growth_rate == pytest.approx(by_both.continuous_growth_rate)
        assert loop.spectrum(ON).rightmost.eigenvalue == proved.mode.eigenvalue
    assert len(computed) == 1
