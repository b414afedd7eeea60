"""Loops closed in the coordinates of the modes, beside all eigenvalues of the closed loops' whole matrix."""

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import linear_sum_assignment

from orchestrator.studies.coordinated_design import modal_loops, open_loops
from orchestrator.studies.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION, lead_lag_turning

PLACES = [PodPlace(f"gfor{k}", "pod_p") for k in range(2)]
SETTINGS = {
    "open": (0.0, NO_COMPENSATION),
    "hardly closed": (4e-7, lead_lag_turning(60.0, 5.0, 2)),
    "gain alone": (60.0, NO_COMPENSATION),
    "no turn": (60.0, lead_lag_turning(0.0, 5.0, 2)),
    "lead": (40.0, lead_lag_turning(110.0, 5.0, 2)),
    "lag": (200.0, lead_lag_turning(-50.0, 9.0, 1)),
}


@pytest.fixture(scope="module")
def loops():
    """Forty swings and twenty real modes: most hardly move, some far, one not at all, and two have one eigenvalue."""
    random = np.random.default_rng(4)
    w, zeta = 2 * np.pi * np.geomspace(0.06, 3.9, 40), random.uniform(0.03, 0.4, 40)
    decay = np.geomspace(0.05, 90.0, 20)
    decay[7] = decay[8]
    swings = [
        size * np.array([[-z, np.sqrt(1 - z**2)], [-np.sqrt(1 - z**2), -z]])
        for size, z in zip(w, zeta, strict=True)
    ]
    A = scipy.linalg.block_diag(*(-decay[:, None, None]), *swings)
    n = len(A)
    reach = np.exp(random.uniform(-14, -3, n))
    U = random.standard_normal((n, 2)) * reach[:, None]
    V = random.standard_normal((2, n)) * reach
    U[3] = 0.0
    turned = np.linalg.qr(random.standard_normal((n, n)))[0]
    whole = turned @ A @ turned.T
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(open_loops, "REDUCED", 5)
        return OpenLoops.of(whole, turned @ U, V @ turned.T, PLACES, tuple(map(str, range(n))))


@pytest.fixture
def modal(monkeypatch):
    """Has no loops closed by the whole matrix."""
    monkeypatch.setattr(open_loops, "MODAL", 0)
    monkeypatch.setattr(np.linalg, "eigvals", only_small(np.linalg.eigvals))
    monkeypatch.setattr(scipy.linalg, "eig", None)


def only_small(eigvals):
    def values(matrix):
        assert len(matrix) < 80, "the whole matrix"
        return eigvals(matrix)

    return values


def apart(values, expected):
    """Largest distance of two spectra, as a part of an eigenvalue's size."""
    distance = np.abs(values[:, None] - expected) / np.abs(expected)
    return distance[linear_sum_assignment(distance)].max()


@pytest.mark.parametrize("used", [1, 2])
@pytest.mark.parametrize("kind", SETTINGS)
def test_closed_loops_have_the_modes_and_vectors_of_their_matrix(loops, used, kind, request):
    setting = dict.fromkeys(PLACES[:used], PodSetting(*SETTINGS[kind]))
    expected, left, right = scipy.linalg.eig(loops.closed(setting), left=True, right=True)
    whole = loops.eigenvalues(setting)
    request.getfixturevalue("modal")
    closed = loops.solve(setting)
    assert len(closed.values) == len(whole)
    # a gain of nothing splits the lead/lag's two equal eigenvalues by its root
    allowed = 1e-4 if kind == "hardly closed" else 1e-9
    for values in (closed.values, loops.eigenvalues(setting)):
        assert apart(values, whole) < allowed
        assert apart(values[values.imag > 0.3], whole[whole.imag > 0.3]) < 1e-9
    swings = np.flatnonzero(closed.values.imag > 0.3).tolist()
    for k, *sides in zip(swings, *(x.T for x in closed.vectors(swings)), strict=True):
        place = np.argmin(np.abs(expected - closed.values[k]))
        for one, other in zip(sides, (left[:, place], right[:, place]), strict=True):
            same = abs(np.vdot(one, other)) / (np.linalg.norm(one) * np.linalg.norm(other))
            assert same == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("wrong", ["a mode twice", "no convergence"])
def test_what_cannot_be_told_by_the_modes_is_told_by_the_matrix(loops, monkeypatch, wrong):
    """Where iterations end at one mode twice the sum of all modes is another one."""
    setting = {PLACES[0]: PodSetting(*SETTINGS["lead"])}
    whole = loops.eigenvalues(setting)
    monkeypatch.setattr(open_loops, "MODAL", 0)
    found = modal_loops.ModalLoops._corrected

    def twice(*given):
        values = found(*given)
        values[1] = values[0]
        return values

    monkeypatch.setattr(
        modal_loops.ModalLoops,
        "_corrected",
        twice if wrong == "a mode twice" else lambda *given: None,
    )
    assert np.array_equal(np.sort_complex(loops.eigenvalues(setting)), np.sort_complex(whole))
