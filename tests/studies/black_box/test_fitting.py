"""The fit of a state-space model to a frequency response: exact where the response is rational, honest where not."""

import numpy as np
import pytest
import scipy.linalg

from orchestrator.core.errors import AnalysisError
from orchestrator.studies.black_box import fitting
from orchestrator.studies.black_box.fitting import fit, passivity
from orchestrator.studies.black_box.frequency_response import FrequencyResponse
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
H = 1e-4
FREQUENCIES = 0.05 * (2 * np.unique(np.round((np.geomspace(1, 19999, 120) - 1) / 2)) + 1)


def response(A, B, C, D=None, bound=1e-9):
    """Measured response of a continuous system with its inputs held over each step."""
    D = np.zeros((len(C), B.shape[1])) if D is None else D
    Ad, Bd, *_ = scipy_signal.cont2discrete((A, B, C, D), H, method="zoh")
    z = np.exp(2j * np.pi * FREQUENCIES * H)
    values = np.array([C @ np.linalg.solve(x * np.eye(len(A)) - Ad, Bd) + D / x for x in z])
    names = tuple(f"u{k}" for k in range(B.shape[1])), tuple(f"y{k}" for k in range(len(C)))
    bounds = np.full(values.shape, bound * np.abs(values).max())
    return FrequencyResponse(
        FREQUENCIES, values, bounds, D, np.zeros(len(C)), H, *names, 0.0, "exact"
    )


def wide_system(seed=1):
    """Poles from 0.2 to 8000 1/s, some of them complex, two inputs and two outputs."""
    rng = np.random.default_rng(seed)
    blocks = [np.array([[-0.2]]), np.array([[-5.0]]), np.array([[-8000.0]])]
    blocks += [
        np.array([[-d, w], [-w, -d]])
        for d, w in ((1.0, 6.0), (5.0, 32.0), (2.0, 239.0), (1800.0, 4000.0))
    ]
    A = scipy.linalg.block_diag(*blocks)
    scale = np.sqrt(np.abs(np.linalg.eigvals(A)))[:, None]
    return A, scale * rng.normal(size=(11, 2)), (scale * rng.normal(size=(11, 2))).T


def test_a_rational_response_is_found_with_its_poles_and_no_more_states():
    A, B, C = wide_system()
    model = fit(response(A, B, C))
    assert model.error < 1e-5
    wanted = np.linalg.eigvals(A)
    for pole in wanted[np.abs(wanted) < 1000]:
        assert np.abs(model.poles - pole).min() < 1e-3 * abs(pole)
    assert len(model.A) <= 14
    assert not model.D.any()


def test_direct_feedthrough_is_kept_apart():
    A, B, C = wide_system(2)
    D = np.array([[0.5, 0.0], [-1.0, 2.0]])
    measured = response(A, B, C, D)
    model = fit(measured)
    assert model.error < 1e-5
    assert np.array_equal(model.D, D)
    assert (
        np.abs(model.response(measured.z) + D / measured.z[:, None, None] - measured.values).max()
        < 1e-4 * np.abs(measured.values).max()
    )


def test_a_model_over_a_step_is_scipys_to_the_last_bit():
    rng = np.random.default_rng(2)
    A, B, C = (rng.normal(size=shape) for shape in ((7, 7), (7, 2), (3, 7)))
    wanted = scipy_signal.cont2discrete((A, B, C, np.zeros((3, 2))), 1e-3, method="bilinear")
    found = fitting._over_a_step(A, B, C, 1e-3)
    assert all(np.array_equal(one, other) for one, other in zip(found, wanted[:3], strict=True))


def test_what_no_rational_model_fits_is_refused(monkeypatch):
    monkeypatch.setattr(fitting, "ORDERS", fitting.ORDERS[:4])
    measured = response(*wide_system())
    noise = np.random.default_rng(3).normal(size=(2, *measured.values.shape))
    measured.values[:] = noise[0] + 1j * noise[1]
    with pytest.raises(
        AnalysisError, match=r"no rational model fits .*: the best has an error above"
    ):
        fit(measured)
    monkeypatch.setattr(fitting, "_fit_with", lambda *_: None)
    with pytest.raises(
        AnalysisError, match=r"no rational model fits .*: none is stable; measure more lines"
    ):
        fit(measured)


def test_the_hold_can_be_taken_out_below_the_communication_rate():
    A, B, C = wide_system()
    measured = response(A, B, C)
    low = FREQUENCIES < 50
    exact = np.array(
        [C @ np.linalg.solve(2j * np.pi * f * np.eye(len(A)) - A, B) for f in FREQUENCIES]
    )
    error = np.linalg.norm(measured.continuous() - exact, axis=(1, 2)) / np.linalg.norm(
        exact, axis=(1, 2)
    )
    assert error[low].max() < 1e-2
    held = np.linalg.norm(measured.values - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
    assert held[-1] > 3 * error[-1]


@pytest.mark.parametrize(("resistance", "passive"), [(0.1, True), (-0.1, False)])
def test_an_impedance_is_passive_and_a_negative_one_is_not(resistance, passive):
    """R-L in the turning frame: (X/ω)·di/dt = v − (R + jX)·i, with i counted into the device."""
    omega, X = 2 * np.pi * 50, 0.3
    # stable either way, so that the sign of the current is what differs
    damping = -abs(resistance) * omega / X
    A = np.array([[damping, omega], [-omega, damping]])
    B = omega / X * np.eye(2)
    measured = response(A, B, -np.sign(resistance) * np.eye(2))
    found = passivity(measured)
    below = measured.frequencies < 40
    assert (found.relative[below] > 0).all() == passive
    assert bool(found.ranges()) != passive
    assert np.abs(found.relative).max() <= 1 + 1e-12
