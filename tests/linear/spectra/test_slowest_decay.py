"""The slowest decay of a large continuous system: what the turns of its determinant prove, against all eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import reduced_network
from orchestrator.linear.spectra.modes import ZERO, eigenvalues
from orchestrator.linear.spectra.reduced_network import ReducedNetwork
from orchestrator.linear.spectra.shifted_equations import GROWING, count_growing
from orchestrator.linear.spectra.slowest_decay import Decay, slowest_decay
from orchestrator.linear.spectra.stability import Cause, judge

UNITS, NODES, STEP = 12, 18, 1e-4


def system(planted=None, *, unit=None):
    """Units that swing at nodes of a ring of lines, each with two voltages and a current in two parts.

    ``planted``: eigenvalue of one unit more, which takes hardly any part in the others' [rad/s].
    ``unit``: a matrix in place of the first unit's."""
    rng = np.random.default_rng(3)
    units = []
    for _ in range(UNITS):
        omega, decay = 2 * np.pi * rng.uniform(0.4, 2.0), rng.uniform(0.2, 2.0)
        swing = [[-decay, omega], [-omega, -decay]]
        units.append(scipy.linalg.block_diag(swing, [[-rng.uniform(2, 30)]], [[-40.0]]))
    if unit is not None:
        units[0] = unit
    if planted is not None:
        units[1][:2, :2] = [[planted.real, planted.imag], [-planted.imag, planted.real]]
    lines = np.zeros(
        (4 * NODES, 4 * NODES)
    )  # per node: voltage (re, im), current of the line behind it (re, im)
    turn, omega_0 = np.array([[0.0, 1.0], [-1.0, 0.0]]), 314.0
    for k in range(NODES):
        v, i, following = 4 * k, 4 * k + 2, 4 * ((k + 1) % NODES)
        lines[v : v + 2, v : v + 2] = omega_0 * turn - 3.0 * np.eye(2)
        lines[i : i + 2, i : i + 2] = omega_0 * turn - 20.0 * np.eye(2)
        for node, sign in ((v, 1.0), (following, -1.0)):
            lines[node : node + 2, i : i + 2] -= sign * 2e3 * np.eye(2)
            lines[i : i + 2, node : node + 2] += sign * 5e2 * np.eye(2)
    F = scipy.linalg.block_diag(*units, lines)
    n, m, first = len(F), 4 * UNITS, 4 * UNITS
    G, H = np.zeros((n, m)), np.zeros((m, n))
    for u in range(UNITS):
        own, node, small = (
            slice(4 * u, 4 * u + 4),
            first + 4 * u,
            1e-4 if planted and u == 1 else 1.0,
        )
        G[own, 4 * u : 4 * u + 2] = small * rng.standard_normal((4, 2))
        H[4 * u : 4 * u + 2, node : node + 2] = np.eye(2)
        H[4 * u + 2 : 4 * u + 4, own] = 0.05 * rng.standard_normal((2, 4))
        G[node : node + 2, 4 * u + 2 : 4 * u + 4] = np.eye(2)
    matrices = (sp.csr_array(x) for x in (F, G, H, np.zeros((m, m))))
    return LinearModel(*matrices, tuple(f"x{k}" for k in range(n)), None, 0.0)


@pytest.fixture(autouse=True)
def few_states(monkeypatch):
    monkeypatch.setattr(reduced_network, "_FEW_STATES", 10)


def as_by_map(values):
    """The same eigenvalues as a step map shows them: slow ones nearly where they are, fast ones far away."""
    return values * (1 + 0.5 * STEP * np.abs(values.imag))


def test_determinants_are_those_of_the_whole_matrix():
    model = system()
    network, points = ReducedNetwork(model), 0.01 + 1j * np.geomspace(0.1, 3e4, 40)
    mine = network.log_determinants(points)
    sign, size = np.linalg.slogdet(model.A - points[:, None, None] * np.eye(len(model.names)))
    assert mine.real - mine.real[0] == pytest.approx(size - size[0], abs=1e-8)
    turned = np.exp(1j * (mine.imag - mine.imag[0])) * sign[0] / sign
    assert np.abs(turned - 1).max() < 1e-8
    assert len(network.alone) == len(model.names)


@pytest.mark.parametrize("planted", [None, 0.5 + 3j, 0.006 + 9j, 3.0 + 50j])
@pytest.mark.parametrize("line", [GROWING, -0.15])
def test_eigenvalues_to_the_right_of_a_line_are_counted(planted, line):
    model = system(planted)
    network = ReducedNetwork(model)
    expected = int((eigenvalues(model).real > line).sum())
    assert count_growing(network, network.alone, line=line) == expected
    assert expected >= (0 if planted is None else 2)


def test_the_slowest_decay_is_that_of_all_eigenvalues():
    model = system()
    values = eigenvalues(model)
    decay = slowest_decay(model, ReducedNetwork(model), as_by_map(values))
    assert decay == Decay(pytest.approx(values.real[np.abs(values) > ZERO].max(), rel=1e-9))


@pytest.mark.parametrize("planted", [0.5 + 3j, 0.006 + 9j, 2.0 + 300j])
def test_growth_that_the_step_map_hides_is_not_called_a_decay(planted):
    """The map's eigenvalues are those of the system without what was planted, so that no search is led to it."""
    of_map = as_by_map(eigenvalues(system()))
    growing = system(planted)
    assert eigenvalues(growing).real.max() > 0
    assert slowest_decay(growing, ReducedNetwork(growing), of_map) is None


def test_a_slower_decay_than_the_step_map_leads_to_is_not_missed():
    slower = system(-0.02 + 0.9j)
    true = eigenvalues(slower).real.max()
    of_map = as_by_map(eigenvalues(system()))
    found = slowest_decay(slower, ReducedNetwork(slower), of_map)
    assert found is None or found.rate == pytest.approx(true, rel=1e-6)


def test_poles_that_are_defective_are_noticed_or_do_no_harm():
    """Three poles at one place: residues of theirs are huge, and cancel."""
    chain = np.diag([-5.0] * 4) + np.diag([1.0] * 3, k=1)
    model = system(unit=chain)
    line = -0.05
    try:
        network = ReducedNetwork(model)
    except AnalysisError:
        return
    assert (
        count_growing(network, network.alone, line=line) == (eigenvalues(model).real > line).sum()
    )


def test_what_is_densely_coupled_is_left_to_all_eigenvalues(monkeypatch):
    monkeypatch.setattr(reduced_network, "_MOST_PRODUCTS", 100)
    with pytest.raises(AnalysisError, match="densely coupled"):
        ReducedNetwork(system())


def test_elimination_that_rounding_spoils_is_noticed(monkeypatch):
    original = ReducedNetwork._at

    def spoilt(self, points):
        found, magnified = original(self, points)
        return found + 0.3j * (np.abs(points) > 1e3), magnified

    monkeypatch.setattr(ReducedNetwork, "_at", spoilt)
    with pytest.raises(AnalysisError, match=r"off by 0\.3"):
        ReducedNetwork(system())


def test_a_point_of_large_pivots_is_computed_by_a_sparse_factorisation(monkeypatch):
    network, points = ReducedNetwork(system()), 0.01 + 1j * np.array([1.0, 30.0, 700.0])
    right = network.log_determinants(points)
    original = ReducedNetwork._at_some
    monkeypatch.setattr(
        ReducedNetwork,
        "_at_some",
        lambda self, s: (original(self, s)[0] + 9, np.full(len(s), 1e12)),
    )
    again = network.log_determinants(points)
    assert np.exp(again - right) == pytest.approx(np.ones(3), abs=1e-6)


def test_a_map_that_grows_is_judged_beside_the_systems_own_mode():
    """Growth that the communication step makes: with the proof of decay as with all eigenvalues of the system."""
    alone = LinearModel.from_matrix(np.diag([-0.3, -4.0]), ("a.x", "a.y"), None)
    grows = LinearModel.from_matrix(np.diag([np.exp(5 * STEP), 0.9]), ("a.x", "a.y"), STEP)
    verdict = judge(grows, None, alone, Decay(-0.3))
    assert verdict == judge(grows, None, alone)
    assert (verdict.stable, verdict.cause) == (False, Cause.COUPLING)
    assert verdict.continuous_growth_rate == pytest.approx(-0.3)
    decays = replace(grows, F=sp.csr_array(np.diag([np.exp(-0.3 * STEP), 0.9])))
    assert judge(decays, None, alone, Decay(-0.3)) == judge(decays, None, alone)
