"""All eigenvalues of a running system with one setting of a POD after the other, from one Schur form for all."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.changed_spectra import ChangedSpectra, ChangedSpectrum
from orchestrator.linear.spectra.continuation import Eigenpair, follow_along
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION

MOST_WHOLE = 3500
"""Up to this number of states all eigenvalues are computed with each setting. With 3,049 (WECC's 240 buses) they take
8.3 to 9.2 s of processor time, and following 96 swings 11.4 s; the first grow with the third power of the states."""

LEAST_CHANGED = 1_000
"""From this number of states on, one Schur form serves all settings; with fewer, all eigenvalues take half a second at
most. With 3,049 states the form takes 9.2 s of processor time, and each setting 0.4 s."""

_NEIGHBOURS = 8  # pairs among which a mode is recognised


class OneForm:
    """All eigenvalues by setting, from one Schur form of the system without the controller's component.

    ``forget``: is told of which settings the eigenvalues hold no longer, once the form has failed. From then on it
    serves none."""

    def __init__(
        self,
        loop: PodLoop,
        forget: Callable[[Iterable[PodSetting]], None] = lambda settings: None,
    ) -> None:
        self._loop, self._forget = loop, forget
        self._found: dict[PodSetting, ChangedSpectrum] = {}
        self._changes: ChangedSpectra | None = None
        # a pair from which others are followed, and the same in the coordinates of the form's modes
        self._start: tuple[Eigenpair, Eigenpair] | None = None
        self._has_failed = False

    def __contains__(self, setting: PodSetting) -> bool:
        return setting in self._found

    def at(self, setting: PodSetting) -> ChangedSpectrum | None:
        """All eigenvalues with a setting; None where that is not worthwhile, or fails."""
        if setting in self._found:
            return self._found[setting]
        off = self._loop.model(PodSetting(0.0, NO_COMPENSATION))
        within = LEAST_CHANGED <= len(off.names) <= MOST_WHOLE
        if self._has_failed or not (within and setting.gain):
            return None
        model = self._loop.model(setting)
        with suppress(AnalysisError, np.linalg.LinAlgError):
            if self._changes is None:
                self._changes = ChangedSpectra(off, model)
            self._found[setting] = self._changes.of(model)
            return self._found[setting]
        self.fail()
        return None

    def followed(self, start: Placed, setting: PodSetting) -> complex | None:
        """The mode of a start with a gain of 0 where it is with another setting [rad/s]; None where `at` is None.

        Raises `AnalysisError` where it cannot be followed."""
        if self.at(setting) is None or self._changes is None:
            return None
        latest = setting

        def model_at(gain: float) -> LinearModel:
            nonlocal latest
            latest = replace(setting, gain=gain)
            return self._loop.model(latest)

        def near(model: LinearModel, wanted: complex) -> Sequence[Eigenpair]:
            changed = self.at(latest)
            if changed is None:
                raise AnalysisError(f"with a gain of {latest.gain:g} the system has other modes")
            return changed.pairs_near(wanted, _NEIGHBOURS)

        if self._start is None or self._start[0] is not start.pair:
            self._start = start.pair, self._changes.seen(start.pair)
        return follow_along(self._start[1], model_at, 0.0, setting.gain, near=near).eigenvalue

    def fail(self) -> None:
        """Forget what the form gave, and serve none any more."""
        self._forget(self._found)
        self._found.clear()
        self._changes = None
        self._start = None
        self._has_failed = True
