"""The least damping of a system with one setting of a POD after the other.

Of a system with few states all eigenvalues are computed with each setting. In a larger one they come from one Schur
form of the system without the controller's component, and are computed from the whole matrix with the setting that is
chosen. In a very large one the swings are followed from setting to setting, which says what grows among them, and
nothing of what grows elsewhere: all eigenvalues are computed with those settings that decide. Of a system too large
for these, the least damped swings alone are followed, and modes of little damping and growth are searched with the
settings that decide."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.followed_swings import (
    LITTLE,
    follow_swings,
    least_damped_swings,
    search_swings,
    swings_among,
    weakest_swing,
)
from orchestrator.linear.spectra.growth_search import find_growing_modes
from orchestrator.linear.spectra.mode_refinement import RefinedModes
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    Mode,
    Spectrum,
    damping_ratio,
    eigenvalues,
    find_spectrum,
    least_damped_first,
    make_mode,
)
from orchestrator.linear.spectra.stability import WHOLE, fastest_growth
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.guard import weakest_and_growing
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from orchestrator.studies.pod_design.one_form import MOST_WHOLE, OneForm

GROWS = -1.0  # in the place of a damping ratio, where something grows

FOLLOWED = 24
"""Swings that are followed in a system too large for all eigenvalues, the least damped: 285 modes of 11,330 states do
not settle in 109 s. Where another one falls below them, or all rise above the last one, modes are searched."""

_WIDER = (LITTLE, 0.9)  # damping ratios up to which modes are searched, one after the other

_ALIKE = 1e-6  # the least damped mode in both ways differs by at most this part of its size


class LeastDamping:
    """Least damping ratios by setting.

    ``known``: modes of the system without the device, from which those with it are followed.
    ``frequency_range``: of the study [Hz]; the swings from 0.1 to 2 Hz count whatever it is."""

    def __init__(
        self,
        loop: PodLoop,
        known: Sequence[Mode] = (),
        frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
    ) -> None:
        self._loop, self._known = loop, known
        low, high = zip(ELECTROMECHANICAL_HZ, frequency_range, strict=True)
        self._within = min(low), max(high)
        self._swings: dict[PodSetting, RefinedModes | None] = {}
        self._whole: dict[PodSetting, NDArray[np.complex128]] = {}
        self._found: dict[PodSetting, float] = {}
        self._spectra: dict[
            PodSetting, Spectrum
        ] = {}  # with the swings, of settings that were proved
        self._form = OneForm(loop, self._forget)
        self._little = LITTLE
        # of a system too large for all eigenvalues, by setting: what grows [rad/s], and modes of little damping
        self._growing: dict[PodSetting, NDArray[np.complex128]] = {}
        self._searched: dict[PodSetting, list[Mode]] = {}

    def of(self, setting: PodSetting) -> float:
        """The least damping ratio, `GROWS` where something is seen to grow.

        Where swings are followed, it is that from 0.1 to 2 Hz; `surely` knows those of a wider range as well."""
        if setting not in self._found:
            model = self._loop.model(setting)
            swings = None if len(model.names) <= MOST_WHOLE else self._followed(setting)
            weakest = None if swings is None else weakest_swing(swings, self._little)
            if swings is None or weakest is None:
                return self.surely(setting)
            grows = fastest_growth(swings.values, step_map=model.step_size is not None) is not None
            self._found[setting] = GROWS if grows else damping_ratio(weakest)
        return self._found[setting]

    def surely(self, setting: PodSetting) -> float:
        """The same in the whole range and with growth at any frequency, by all eigenvalues."""
        weakest = self.weakest(setting)
        self._found[setting] = GROWS if weakest is None else damping_ratio(weakest)
        return self._found[setting]

    def weakest(self, setting: PodSetting) -> complex | None:
        """The least damped mode [rad/s], by all eigenvalues or a search for it; None where something grows."""
        if self._is_vast:
            return None if self._grows(setting) else _least_of(self._found_by_search(setting))
        if setting not in self._whole:
            by_form = self._form.at(setting)
            if by_form is not None:
                return self._weakest_of(by_form.values)
        return self._weakest_of(self.all_values(setting))

    def _weakest_of(self, values: NDArray[np.complex128]) -> complex | None:
        is_map = self._loop.model(PodSetting(0.0, NO_COMPENSATION)).step_size is not None
        weakest, growing = weakest_and_growing(values, step_map=is_map, within=self._within)
        return weakest if growing is None else None

    def is_sure(self, setting: PodSetting) -> bool:
        """Tell whether growth at any frequency is known, or that something grows."""
        known = setting in self._whole or setting in self._form or setting in self._growing
        return known or self._found.get(setting) == GROWS

    def is_proved(self, setting: PodSetting) -> bool:
        """Compute all eigenvalues from the whole matrix, and compare them with those by one form for all settings.

        Where they differ, nothing of that form is used any more, and what was found by it is forgotten."""
        by_form = self._form.at(setting) if setting in self._form else None
        if by_form is None:
            return True
        one, other = self._weakest_of(by_form.values), self._weakest_of(self.all_values(setting))
        if one == other or (
            one is not None and other is not None and abs(one - other) <= _ALIKE * abs(other)
        ):
            return True
        self._form.fail()
        return False

    def followed(self, start: Placed, setting: PodSetting) -> complex:
        """The mode of a start with a gain of 0 where it is with another setting [rad/s].

        Raises `AnalysisError` where it cannot be followed."""
        by_form = self._form.followed(start, setting)
        if by_form is not None:
            return by_form
        return self._loop.place(start, setting.gain, setting.filters).eigenvalue

    def _forget(self, settings: Iterable[PodSetting]) -> None:
        for setting in settings:
            self._found.pop(setting, None)

    def all_values(self, setting: PodSetting) -> NDArray[np.complex128]:
        """All eigenvalues [rad/s]."""
        if setting not in self._whole:
            with one_thread():
                model = self._loop.model(setting)
                if setting in self._form:  # it is chosen: its swings are asked for as well
                    self._spectra[setting] = find_spectrum(model, *ELECTROMECHANICAL_HZ)
                    self._whole[setting] = self._spectra[setting].eigenvalues
                else:
                    self._whole[setting] = eigenvalues(model)
        return self._whole[setting]

    def known_values(self, setting: PodSetting) -> NDArray[np.complex128]:
        """All eigenvalues [rad/s]; of a system too large for them those of little damping."""
        if not self._is_vast:
            return self.all_values(setting)
        found = [mode.eigenvalue for mode in self._found_by_search(setting)]
        return np.array([*found, *self._growing.get(setting, ())], dtype=complex)

    def is_stable(self, setting: PodSetting) -> bool | None:
        """The verdict on the whole system, at any frequency; None where it is not known."""
        if self._is_vast:
            modes = self._found_by_search(setting)
            return self._loop.examine(setting, modes=modes).stability.stable
        swings = self._swings.get(setting)
        if swings is None:
            spectrum = self._spectra.get(setting)
            return self._loop.examine(setting, spectrum=spectrum).stability.stable
        modes = _in_range(swings, self._loop.model(setting).names)
        return self._loop.examine(setting, self.all_values(setting), modes).stability.stable

    def _followed(self, setting: PodSetting) -> RefinedModes | None:
        """The swings from those of the nearest smaller gain with the same lead/lag; None where only all eigenvalues
        show them, which take less than a search."""
        if setting not in self._swings:
            before = self._nearest(setting)
            model = self._loop.model(setting)
            found = None if before is None else follow_swings(model, before, self._little)
            if found is None and not setting.gain:  # from here all others are followed
                found = _searched(model)
            self._swings[setting] = found
        return self._swings[setting]

    @property
    def _is_vast(self) -> bool:
        """Tell if the system is too large for all its eigenvalues."""
        return len(self._loop.model(PodSetting(0.0, NO_COMPENSATION)).names) > WHOLE

    def _grows(self, setting: PodSetting) -> bool:
        """Tell by a search of the right half-plane if something grows at any frequency."""
        model = self._loop.model(setting)
        if setting not in self._growing:
            found = find_growing_modes(model).eigenvalues
            self._growing[setting] = np.array(found, dtype=complex)
        is_map = model.step_size is not None
        return fastest_growth(self._growing[setting], step_map=is_map) is not None

    def _found_by_search(self, setting: PodSetting) -> list[Mode]:
        """Modes of little damping in the whole range."""
        for damping in _WIDER:
            if not self._searched.get(setting):
                model = self._loop.model(setting)
                self._searched[setting] = find_critical_modes(model, *self._within, damping)
        return self._searched[setting]

    def _start(self, model: LinearModel) -> RefinedModes:
        """The known swings; of a system too large for all eigenvalues the least damped of them."""
        every = swings_among(self._known, model)
        if not self._is_vast:
            return every
        some, self._little = least_damped_swings(every, FOLLOWED)
        return some

    def _nearest(self, setting: PodSetting) -> RefinedModes | None:
        """Return what a setting's swings are followed from; None where they were lost at a smaller gain already."""
        if not setting.gain:
            return self._start(self._loop.model(setting)) if self._known else None
        alike = [
            one
            for one in self._swings
            if one.filters == setting.filters and 0 < one.gain < setting.gain
        ]
        nearest = max(alike, key=lambda one: one.gain, default=PodSetting(0.0, NO_COMPENSATION))
        return self._followed(nearest)


def _in_range(swings: RefinedModes, names: tuple[str, ...]) -> list[Mode]:
    """The swings from 0.1 to 2 Hz, least damped first."""
    every = (
        make_mode(value, swings.left[:, k], swings.right[:, k], names)
        for k, value in enumerate(swings.values.tolist())
    )
    low, high = ELECTROMECHANICAL_HZ
    return least_damped_first(mode for mode in every if low <= mode.frequency_hz <= high)


def _least_of(modes: Sequence[Mode]) -> complex:
    """The least damped of some modes [rad/s]; −1 if there is none, as `weakest_and_growing` has it."""
    found = [mode.eigenvalue for mode in modes]
    return min(found, key=damping_ratio, default=complex(-1))


def _searched(model: LinearModel) -> RefinedModes | None:
    try:
        return search_swings(model)
    except AnalysisError:
        return None
