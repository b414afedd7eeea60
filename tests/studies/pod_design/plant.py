"""A loop that a POD design can be tried on, with modes whose motion with the gain is known exactly."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import Eigenpair
from orchestrator.linear.spectra.modes import find_spectrum
from orchestrator.studies.pod_design.closed_loop import Placed, PodSetting
from orchestrator.studies.pod_design.lead_lag import LeadLag

NONE = LeadLag(0.0, 0.0, 0)
_VECTOR = np.ones(1, complex)


@dataclass
class Plant:
    """Modes λ(K) = λ₀ + K·S·C, where C turns by what the lead/lag does at the frequency of the target.

    The first mode is the target. ``turned`` says of each mode whether the lead/lag acts on it.
    """

    modes: tuple[complex, ...] = (-0.4 + 4j,)
    slopes: tuple[complex, ...] = (-0.01 + 0j,)

    def eigenvalues(self, setting):
        s, f = 1j * self.modes[0].imag, setting.filters
        compensation = ((1 + s * f.T_S1) / (1 + s * f.T_S2)) ** f.N_S
        return [
            z + setting.gain * slope * (compensation if k == 0 else 1)
            for k, (z, slope) in enumerate(zip(self.modes, self.slopes, strict=True))
        ]

    def figures(self, kind, what, compute):
        return compute()

    def model(self, setting):
        blocks = [[[z.real, z.imag], [-z.imag, z.real]] for z in self.eigenvalues(setting)]
        A = scipy.linalg.block_diag(*blocks)
        return LinearModel.from_matrix(A, tuple(f"x{k}" for k in range(len(A))), None)

    def spectrum(self, setting):
        return find_spectrum(self.model(setting))

    def continuous_models(self, setting):
        return self.model(PodSetting(setting.gain / 2, setting.filters)), self.model(setting)

    def place(self, start, gain, filters=None):
        setting = PodSetting(gain, filters or start.setting.filters)
        return Placed(setting, Eigenpair(self.eigenvalues(setting)[0], _VECTOR, _VECTOR))

    @property
    def off(self):
        return self.place(
            Placed(PodSetting(0.0, NONE), Eigenpair(self.modes[0], _VECTOR, _VECTOR)), 0.0
        )


def gain_for(mode, slope, damping):
    """The gain with which a mode that moves straight to the left has a damping ratio."""
    real = -damping * mode.imag / np.sqrt(1 - damping**2)
    return (real - mode.real) / slope
