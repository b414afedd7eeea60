"""Units around a network whose port voltages depend on all of them, against dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.linear.models import hub_elimination
from orchestrator.linear.models.hub_elimination import HubFactors, hub_equations
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.modes import eigenvalues, find_modes
from orchestrator.linear.spectra.shifted_equations import (
    GROWING,
    FactorsByHub,
    ShiftedEquations,
    count_growing,
)

UNITS = 110
STATES = 3 * UNITS + 2
UNSTABLE = 2 * np.pi * 0.4 * complex(0.03, np.sqrt(1 - 0.03**2))


def system(coupling=0.02, planted=False):
    """Each unit swings and takes two voltages, which all units change; the network has two states; one output per unit
    leads nowhere."""
    rng = np.random.default_rng(5)
    hertz, ratios = rng.uniform(0.5, 1.8, UNITS), rng.uniform(0.04, 0.3, UNITS)
    if planted:
        hertz[7], ratios[7] = 0.4, -0.03
    units = [
        scipy.linalg.block_diag(
            [[0, 1], [-((2 * np.pi * f) ** 2), -4 * np.pi * f * z]], [[-rng.uniform(1, 9)]]
        )
        for f, z in zip(hertz, ratios, strict=True)
    ]
    n, m = STATES, 3 * UNITS  # w: the voltages, what units give, what leads nowhere
    F = scipy.linalg.block_diag(*units, [[-3.0]], [[-4.0]])
    G, H, K = np.zeros((n, m)), np.zeros((m, n)), np.zeros((m, m))
    for u in range(UNITS):
        own = slice(3 * u, 3 * u + 3)
        G[own, u] = rng.standard_normal(3)
        G[own, (u + 1) % UNITS] = 0.1 * rng.standard_normal(3)
        H[UNITS + u, own] = rng.standard_normal(3)
        K[2 * UNITS + u, :UNITS] = 1.0
    K[:UNITS, UNITS : 2 * UNITS] = coupling * rng.standard_normal((UNITS, UNITS))
    G[-2:, :UNITS] = 0.1 * rng.standard_normal((2, UNITS))
    H[:UNITS, -2:] = 0.1 * rng.standard_normal((UNITS, 2))
    if planted:
        K[:UNITS, UNITS + 7] = 0
    return LinearModel(
        *map(sp.csr_array, (F, G, H, K)), tuple(f"x{k}" for k in range(n)), None, 0.0
    )


@pytest.fixture(autouse=True)
def small_hub(monkeypatch):
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", 50)


def test_the_hub_is_the_voltages_and_the_networks_states_and_the_rest_falls_apart_into_units():
    model = system()
    equations = hub_equations(model.F, model.G, model.H, model.K)
    assert len(equations.hub) == UNITS + 2
    assert equations.blocks[0] >= UNITS
    assert equations.whole.shape[0] == STATES + 2 * UNITS  # without what leads nowhere


@pytest.mark.parametrize("own", [0.0, 1.0, 0.3])
def test_the_equations_hold_each_number_once(own):
    """Places in w may take themselves, and a number that is there and 0 takes nothing from what leads nowhere."""
    given = system()
    K = given.K.toarray()
    K[3, 3] = K[UNITS + 4, UNITS + 4] = own
    nowhere = 2 * UNITS + 5
    rows, columns = given.G.nonzero()
    entries = np.append(given.G.toarray()[rows, columns], 0.0)
    places = (np.append(rows, 1), np.append(columns, nowhere))
    G = sp.csr_array(sp.coo_array((entries, places), shape=given.G.shape))
    assert G.nnz == given.G.nnz + 1
    whole = hub_equations(given.F, G, given.H, sp.csr_array(K)).whole
    taken = slice(2 * UNITS)
    F, G, H = given.F.toarray(), G.toarray()[:, taken], given.H.toarray()[taken]
    assert (whole.toarray() == np.block([[F, G], [H, K[taken, taken] - np.eye(2 * UNITS)]])).all()


@pytest.mark.parametrize("sigma", [0.7, -0.3 + 5j])
def test_both_equations_are_solved(sigma):
    model = system()
    shifted = model.A - sigma * np.eye(STATES)
    solver = model.hub.at(sigma)
    b = np.random.default_rng(1).standard_normal(STATES).astype(type(sigma))
    assert np.allclose(shifted @ solver.solve(b), b, atol=1e-9)
    assert np.allclose(shifted.conj().T @ solver.solve_adjoint(b), b, atol=1e-9)


def test_determinants_and_solutions_by_blocks_are_those_of_the_sparse_equations(monkeypatch):
    """As a count of growing modes asks them: a constant of the model apart, which is the same at each point."""
    model, b = system(), np.random.default_rng(1).standard_normal((STATES, 2)).astype(complex)
    equations, points = ShiftedEquations(model), (2e-3, 0.7j, -0.3 + 5j, 2e-3 + 40j)
    by_hub = [equations.at(point) for point in points]
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", STATES)
    sparse = ShiftedEquations(system())
    apart = []
    for point, factors in zip(points, by_hub, strict=True):
        assert isinstance(factors, FactorsByHub)
        other = sparse.at(point)
        assert not isinstance(other, FactorsByHub)
        for adjoint in (False, True):
            assert np.allclose(
                factors.solve(b, adjoint=adjoint), other.solve(b, adjoint=adjoint), atol=1e-9
            )
        apart.append(np.exp(factors.log_determinant - other.log_determinant))
    assert np.allclose(apart, apart[0], rtol=1e-9)
    assert np.abs(apart[0]) == pytest.approx(1.0)


@pytest.mark.parametrize("coupling", [0.02, 0.3])
def test_growth_is_counted_by_blocks(coupling):
    """Against all eigenvalues; 69 of them in one crowd turn the determinant more than once from point to point."""
    model = system(coupling, planted=coupling < 0.1)
    alone = np.linalg.eigvals(model.F.toarray())
    growing = int((eigenvalues(model).real > GROWING).sum())
    assert growing >= 2
    assert count_growing(ShiftedEquations(model), alone) == growing


def test_on_an_eigenvalue_of_a_unit_alone_the_whole_is_factorised():
    model = system()
    alone = complex(np.linalg.eigvals(model.F[:3, :3].toarray())[0])
    for sigma in (alone, alone * (1 + 1e-15)):
        assert model.hub.at(sigma) is None
        b = np.ones(STATES, dtype=complex)
        x = model.shifted(sigma).solve(b)
        assert np.allclose(model.A @ x - sigma * x, b, atol=1e-8)


LARGE = 1e5  # so much more others take of some states, as a fast filter does


def with_integrators():
    """The same where a state of some units is moved by nothing, as an integrator at the sum that it holds."""
    given = system()
    third = np.arange(2, UNITS, 3)
    F, G, H = given.F.toarray(), given.G.toarray(), given.H.toarray()
    F[third], G[third] = 0.0, 0.0
    H[:, third] *= LARGE
    return replace(given, F=sp.csr_array(F), G=sp.csr_array(G), H=sp.csr_array(H))


@pytest.mark.parametrize("part", [1.0, 1 + 1j])
def test_next_to_zeros_rounding_is_no_reason_to_factorise_the_whole(part):
    """States are far larger than the right side there, and no solution leaves over less of it than rounding."""
    model, sigma = with_integrators(), 1e-4 * part
    b = np.ones(STATES).astype(type(part))
    shifted = model.A - sigma * np.eye(STATES)
    factors = model.hub.at(sigma)
    assert factors is not None
    assert not next(factors.left_over(b)).of_right <= hub_elimination._ACCURATE
    found, dense = factors.solve_exactly(b), np.linalg.solve(shifted, b)
    assert np.abs(found - dense).max() < 1e-9 * np.abs(dense).max()


def test_an_equations_terms_are_added_up_only_where_much_is_left_over(monkeypatch):
    asked = []
    terms = HubFactors._terms
    monkeypatch.setattr(HubFactors, "_terms", lambda *given: asked.append(1) or terms(*given))
    assert system().hub.at(-0.3 + 5j) is not None
    assert not asked
    assert with_integrators().hub.at(1e-4) is not None
    assert asked


def test_critical_modes_are_those_of_the_full_spectrum():
    model = system()
    found, full = find_critical_modes(model, 0.1, 2.0, 0.1), find_modes(model, 0.1, 2.0)
    wanted = [mode for mode in full if -0.1 <= mode.damping_ratio <= 0.1]
    assert len(found) == len(wanted) > 5
    for one, other in zip(found, wanted, strict=True):
        assert abs(one.eigenvalue - other.eigenvalue) < 1e-9
        assert dict(one.participation) == pytest.approx(dict(other.participation), abs=1e-6)


def test_a_planted_unstable_mode_is_found():
    found = find_critical_modes(system(planted=True), 0.1, 2.0, 0.1)
    assert abs(found[0].eigenvalue - UNSTABLE) < 1e-9
    assert np.abs(eigenvalues(system(planted=True)) - UNSTABLE).min() < 1e-9


def test_a_small_system_has_no_hub(monkeypatch):
    monkeypatch.setattr(hub_elimination, "LEAST_HUB", UNITS + 3)
    model = system()
    assert hub_equations(model.F, model.G, model.H, model.K) is None
