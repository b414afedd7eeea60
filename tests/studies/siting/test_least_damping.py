"""A POD is set in a large system as by all eigenvalues of every setting, with few of them computed: planted growth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import followed_swings
from orchestrator.linear.spectra.changed_spectra import ChangedSpectra
from orchestrator.linear.spectra.continuation import pair_at
from orchestrator.linear.spectra.mode_refinement import RefinedModes
from orchestrator.studies.pod_design import one_form
from orchestrator.studies.pod_design.closed_loop import Placed, PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from orchestrator.studies.siting import confirmation, least_damping
from orchestrator.studies.siting.least_damping import GROWS, LeastDamping
from tests.studies.siting.test_measures import Loop

FAST = -np.linspace(30.0, 900.0, 40)
H = 2e-3


def swing(w, zeta):
    """A pair of eigenvalues of the size w [rad/s]."""
    across = w * np.sqrt(1 - zeta**2)
    return np.array([[-w * zeta, across], [-across, -w * zeta]])


class LargeLoop(Loop):
    """The same with fast states, with an oscillation of 8 Hz, and as a step map; the states are mixed."""

    def __init__(self, other, elsewhere=lambda K: 0.1):
        super().__init__(other)
        self._elsewhere = elsewhere
        self._models = {}

    def model(self, setting):
        if setting not in self._models:
            self._models[setting] = self._mixed(setting)
        return self._models[setting]

    def _mixed(self, setting):
        pairs = zip((self.SWING, self.OTHER), self.dampings(setting), strict=True)
        blocks = [swing(w, zeta) for w, zeta in pairs]
        blocks.append(swing(16 * np.pi, self._elsewhere(setting.gain)))
        A = block_diag(*blocks, np.diag(FAST))
        values, vectors = np.linalg.eig(A)
        over_a_step = ((vectors * np.exp(values * H)) @ np.linalg.inv(vectors)).real
        mixed = np.eye(len(A)) + 0.02 * np.random.default_rng(2).standard_normal(A.shape)
        names = tuple(f"c.x{k}" for k in range(len(A)))
        return LinearModel.from_matrix(mixed @ over_a_step @ np.linalg.inv(mixed), names, H)


def tuned(loop):
    off = PodSetting(0.0, NO_COMPENSATION)
    start = Placed(off, pair_at(loop.model(off), complex(0.0, Loop.SWING)))
    return confirmation.tuned_setting(loop, start, complex(-1.0), complex(0.0, Loop.SWING), 200.0)


@pytest.fixture
def spectra(monkeypatch):
    """Settings whose eigenvalues were all computed."""
    found = []
    whole = LeastDamping.all_values

    def all_values(self, setting):
        found.append(setting)
        return whole(self, setting)

    monkeypatch.setattr(LeastDamping, "all_values", all_values)
    return found


@pytest.mark.parametrize(
    ("other", "elsewhere", "gain"),
    [
        (lambda K: 0.15, lambda K: 0.1, 200.0),
        (lambda K: 0.09 - 4e-4 * K, lambda K: 0.1, 50.0),
        (lambda K: 0.15, lambda K: -0.01 if K > 120 else 0.1, 100.0),
        (lambda K: 0.15, lambda K: -0.01 if K > 60 else 0.1, 50.0),
        (lambda K: 0.15, lambda K: -0.01 if K > 20 else 0.1, 12.5),
        (lambda K: -0.01 if K > 60 else 0.15, lambda K: 0.1, 50.0),
    ],
)
def test_followed_settings_lead_to_the_same(monkeypatch, spectra, other, elsewhere, gain):
    loop = LargeLoop(other, elsewhere)
    expected = tuned(loop)
    assert expected[0].gain == gain
    assert len(set(spectra)) == 15
    spectra.clear()
    monkeypatch.setattr(least_damping, "MOST_WHOLE", 0)
    setting, end = tuned(loop)
    assert setting == expected[0]
    assert (end.bound, end.next_gain) == (expected[1].bound, expected[1].next_gain)
    assert end.next_mode == (
        None if expected[1].next_mode is None else pytest.approx(expected[1].next_mode, abs=1e-7)
    )
    assert setting in spectra
    assert len(set(spectra)) < 15


def test_a_system_too_large_for_all_eigenvalues_has_none_computed(monkeypatch, spectra):
    """Planted: with the largest gain something grows that no followed swing shows."""
    loop = LargeLoop(lambda K: 0.15, lambda K: -0.01 if K > 120 else 0.1)
    expected = tuned(loop)
    spectra.clear()
    for name, number in (("MOST_WHOLE", 0), ("WHOLE", 0), ("FOLLOWED", 1)):
        monkeypatch.setattr(least_damping, name, number)
    assert tuned(loop) == expected
    assert not spectra


def test_what_grows_elsewhere_is_unseen_until_it_is_asked_for(monkeypatch):
    """This is why those settings that decide have all their eigenvalues computed."""
    monkeypatch.setattr(least_damping, "MOST_WHOLE", 0)
    looks = LeastDamping(LargeLoop(lambda K: 0.15, lambda K: -0.01))
    setting = PodSetting(50.0, NO_COMPENSATION)
    assert looks.of(setting) == pytest.approx(0.055, abs=1e-9)
    assert not looks.is_sure(setting)
    assert looks.surely(setting) == GROWS
    assert looks.of(setting) == GROWS


def test_a_swing_that_was_not_among_those_followed_is_found(monkeypatch):
    """Planted: the modes without the device lack the one that is damped least with it."""
    monkeypatch.setattr(least_damping, "MOST_WHOLE", 0)
    loop = LargeLoop(lambda K: 0.15 if K == 0 else 0.01)
    whole = followed_swings.search_swings(loop.model(PodSetting(0.0, NO_COMPENSATION)))
    kept = np.abs(whole.values.imag - Loop.SWING) < 0.5
    parts = (whole.values[kept], whole.left[:, kept], whole.right[:, kept])
    some = RefinedModes(*parts, settled=True)
    model = loop.model(PodSetting(50.0, NO_COMPENSATION))
    assert followed_swings.follow_swings(model, whole) is not None
    assert followed_swings.follow_swings(model, some) is None
    assert LeastDamping(loop).of(PodSetting(50.0, NO_COMPENSATION)) == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize("other", [lambda K: 0.15, lambda K: 0.09 - 4e-4 * K])
def test_one_schur_form_leads_to_the_same_with_one_whole_spectrum(monkeypatch, spectra, other):
    loop = LargeLoop(other)
    expected = tuned(loop)
    spectra.clear()
    monkeypatch.setattr(one_form, "LEAST_CHANGED", 0)
    setting, end = tuned(loop)
    assert setting == expected[0]
    assert end.next_gain == expected[1].next_gain
    assert end.next_mode == (
        None if expected[1].next_mode is None else pytest.approx(expected[1].next_mode, abs=1e-7)
    )
    assert set(spectra) == {setting}


def test_a_form_that_the_whole_spectrum_contradicts_is_given_up(monkeypatch, spectra):
    """Planted: the form tells of most damping with a setting that is not the best."""
    loop = LargeLoop(lambda K: 0.15)
    expected = tuned(loop)
    wrong = replace(expected[0], gain=12.5)
    assert expected[0] != wrong
    spectra.clear()
    monkeypatch.setattr(one_form, "LEAST_CHANGED", 0)
    whole = ChangedSpectra.of

    def planted(self, model):
        found = whole(self, model)
        if model is loop.model(wrong):
            found.values = found.values - 20.0
        return found

    monkeypatch.setattr(ChangedSpectra, "of", planted)
    assert tuned(loop) == expected
    assert len(set(spectra)) == 15
