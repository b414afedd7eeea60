"""Native FMUs: modes by perturbation against modes from the FMUs' own directional derivatives."""

import numpy as np
import pytest

from orchestrator.analysis.linearization import Blocks, compose, continuous
from orchestrator.analysis.modes import eigenvalues
from orchestrator.cases.case import load_case
from orchestrator.coupling.master import Master
from orchestrator.errors import AnalysisError
from orchestrator.study.modes import compute_modes


@pytest.fixture(params=["base", "pod_pq"])
def prepared(request):
    return load_case("two_area").prepare([request.param], {"*.native": True})[0]


def farthest(ours, theirs):
    """Largest distance of an eigenvalue from the nearest one on the other side."""
    return np.abs(ours[:, None] - theirs[None]).min(axis=1).max()


def test_the_continuous_systems_are_the_same(prepared):
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        perturbed = eigenvalues(continuous(Blocks(master, derivatives=True)))
        exact = eigenvalues(continuous(Blocks(master, directional=True)))
    assert len(exact) == len(perturbed)
    assert farthest(exact, perturbed) < 1e-7 * np.abs(exact).max()
    slow = np.abs(exact) < 2 * np.pi * 5
    assert farthest(exact[slow], perturbed) < 1e-7


def test_the_step_maps_give_the_same_modes(prepared):
    """But for the FMUs' integrators, which are of order four."""
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        perturbed = eigenvalues(compose(Blocks(master), master.schedule))
        exact = eigenvalues(compose(Blocks(master, directional=True), master.schedule))
    slow = np.abs(exact) < 2 * np.pi * 5
    assert farthest(exact[slow], perturbed) < 1e-5


def test_the_named_mode_is_the_same(prepared):
    case = load_case("two_area")
    by_perturbation = compute_modes(case, prepared).electromechanical
    by_derivatives = compute_modes(case, prepared, directional=True).electromechanical
    assert by_derivatives.eigenvalue == pytest.approx(by_perturbation.eigenvalue, abs=1e-6)


def test_a_kind_without_derivatives_is_refused_with_the_remedy():
    prepared = load_case("two_area").prepare(["base"], {"*.native": True, "sg2.native": False})[0]
    with (
        Master(prepared.system, prepared.schedule, prepared.step_size) as master,
        pytest.raises(AnalysisError, match=r"component 'sg2'.*no directional derivatives.*--native"),
    ):
        Blocks(master, directional=True)
