"""The search for growing modes on a matrix that is known."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import block_diag, expm

from orchestrator.linear.models import hub_elimination, linear_model
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import growth_search
from orchestrator.linear.spectra.growth_search import SLOWEST, find_growing_modes
from orchestrator.linear.spectra.modes import eigenvalues
from tests.linear.models.test_hub_elimination import UNITS, system

MANY = 40
"""Units of negative damping, far more growing modes than a sector gives one by one."""


def test_growing_modes_come_fastest_first():
    known = [0.2 + 9j, 1.5 + 3j, 0.7 + 40j, -0.5 + 5j]
    A = block_diag(
        *([[z.real, z.imag], [-z.imag, z.real]] for z in known), -np.diag(np.arange(1.0, 61.0))
    )
    names = tuple(f"x{k}" for k in range(len(A)))
    found = find_growing_modes(LinearModel.from_matrix(expm(0.01 * A), names, 0.01, 0.0))
    assert list(found.eigenvalues) == pytest.approx([known[1], known[2], known[0]])
    assert found.fastest.eigenvalue == pytest.approx(known[1])
    assert {name for name, _ in found.fastest.participation[:2]} == {"x2", "x3"}


def test_the_parts_of_a_sector_are_alike_and_hold_each_of_its_points_once():
    whole = growth_search._Sector(2.0, 18.0, -0.5, 0.7)
    parts = whole.parts()
    assert len(parts) == 4
    for one in parts:
        assert (one.outer / one.inner, one.high - one.low) == pytest.approx((3.0, 0.6))
    random = np.random.default_rng(1)
    for radius, angle in random.uniform((1.0, -1.0), (20.0, 1.2), (200, 2)):
        value = radius * np.exp(1j * angle)
        assert sum(one.holds(value) for one in parts) == whole.holds(value)


@pytest.fixture
def in_blocks(monkeypatch):
    """Models of this size are searched as large ones are."""
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)
    monkeypatch.setattr(linear_model, "LEAST_IN_BLOCKS", 0)
    monkeypatch.setattr(growth_search, "FASTEST", 30.0)  # no mode is faster here


def with_growing_units(count):
    """Units around a network, of which the first few have negative damping, and integrators with no edge: pairs of
    states that add up what one voltage is, and of which only the sum counts."""
    given = system()
    F, G = given.F.toarray(), given.G.toarray()
    for u in range(count):
        F[3 * u + 1, 3 * u + 1] *= -1
    for u in range(UNITS - 20, UNITS):
        F[3 * u + 2] = 0.0
        G[3 * u + 2] = 0.0
    return LinearModel(sp.csr_array(F), sp.csr_array(G), given.H, given.K, given.names, None, 0.0)


@pytest.mark.parametrize("count", [0, 1, MANY])
def test_a_large_system_gives_all_that_grows_and_vectors_of_one(count, in_blocks, monkeypatch):
    """Against all eigenvalues, beside twenty zeros."""
    model, asked = with_growing_units(count), []
    nearest = growth_search.nearest_pairs
    monkeypatch.setattr(
        growth_search, "nearest_pairs", lambda *of: asked.append(of) or nearest(*of)
    )
    values = eigenvalues(model)
    assert (np.abs(values) < 1e-9).sum() == 20
    growing = values[(values.real > 0) & (np.abs(values) > SLOWEST) & (values.imag >= 0)]
    growing = growing[np.argsort(-growing.real)]
    found = find_growing_modes(model)
    assert len(growing) >= count
    assert len(found.eigenvalues) == len(growing)
    assert np.abs(np.array(found.eigenvalues) - growing).max(initial=0.0) < 1e-6
    assert len(asked) == min(len(growing), 1)
    if len(growing):
        assert abs(found.fastest.eigenvalue - growing[0]) < 1e-9


def test_no_vector_is_taken_alone_where_many_are(in_blocks, monkeypatch):
    """A crowd of modes next to a sector costs a search with one vector at a time minutes."""
    monkeypatch.setattr(growth_search, "_one_by_one", None)
    assert not find_growing_modes(with_growing_units(0)).eigenvalues
