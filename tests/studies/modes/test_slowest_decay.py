"""The verdict by the proof of decay is that by all eigenvalues of the continuous system, on built-in cases."""

import pytest

from orchestrator.linear.spectra.slowest_decay import Decay, slowest_decay
from orchestrator.studies.modes import modes
from tests.support.scenarios import prepare_one


@pytest.mark.parametrize(("case", "scenario"), [("two_area", "pod_p"), ("wscc9", "pod_p")])
def test_the_verdict_is_that_of_all_eigenvalues(case, scenario, monkeypatch):
    prepared, proved = prepare_one(case, scenario), []
    by_all = modes.compute_modes(prepared)

    def noted(*arguments):
        proved.append(slowest_decay(*arguments))
        return proved[-1]

    monkeypatch.setattr(modes, "LEAST_STATES", 10)
    monkeypatch.setattr(modes, "slowest_decay", noted)
    by_proof = modes.compute_modes(prepared)
    rate = by_all.stability.continuous_growth_rate
    assert proved == [Decay(pytest.approx(rate, rel=1e-6))]
    assert by_proof.stability.continuous_growth_rate == proved[0].rate
    assert by_proof.stability.sentence() == by_all.stability.sentence()
    assert by_proof.warnings == by_all.warnings


def test_what_grows_has_all_eigenvalues(monkeypatch):
    prepared = prepare_one("two_area", "base")
    by_all = modes.compute_modes(prepared)
    monkeypatch.setattr(modes, "LEAST_STATES", 10)
    assert modes.compute_modes(prepared).stability == by_all.stability
