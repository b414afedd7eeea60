"""Growth beside the critical modes of a system that is too large for all its eigenvalues."""

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.linear.models import hub_elimination, linear_model
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import growth_search
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.screening import modes
from orchestrator.studies.screening.modes import CriticalRegion, find_modes_here
from tests.linear.models.test_hub_elimination import system

REGION = CriticalRegion(0.1, 2.0, 0.1)
GROWS = 4.0  # rate [1/s] of the states that grow by themselves, before the network takes part


def with_growth_elsewhere(count):
    """Units around a network, one of which swings in growth; in some others a state without oscillation grows."""
    given = system(planted=True)
    F = given.F.toarray()
    for u in range(20, 20 + count):
        F[3 * u + 2, 3 * u + 2] = GROWS + u / 10
    return LinearModel(sp.csr_array(F), given.G, given.H, given.K, given.names, None, 0.0)


@pytest.mark.parametrize("count", [0, 2])
def test_growth_outside_of_the_range_is_found_as_in_the_full_spectrum(count, monkeypatch):
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    monkeypatch.setattr(growth_search, "FASTEST", 30.0)  # no mode is faster here
    monkeypatch.setattr(modes, "MOST_COUNTED", 0)
    monkeypatch.setattr(
        modes, "count_growing", None
    )  # hundreds of factors of a hub in a large system
    model = with_growth_elsewhere(count)
    values = eigenvalues(model)
    growing = values[values.real > 1e-3]
    alone = np.linalg.eigvals(model.F.toarray())
    found = find_modes_here(model, alone, REGION, None, count=True)
    swinging = found.modes.eigenvalues[found.modes.eigenvalues.real > 1e-3]
    assert len(swinging) >= 1
    assert found.growing_elsewhere == len(growing) - 2 * len(swinging) >= count
    assert (found.fastest is not None) == (count > 0)
    if found.fastest is not None:
        real = growing[growing.imag == 0]
        assert abs(found.fastest - real.real.max()) < 1e-6
