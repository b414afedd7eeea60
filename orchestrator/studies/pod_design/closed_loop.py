"""A running system that is linearised with any setting of its POD controllers.

Gain and lead/lag are tunable and the controllers' signals are zero in steady state, so the operating point is the same
for every setting: only the converters need be linearised again, and the rest of the system is kept."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.linear.doubts.examination import Examination, examine
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, compose, continuous, where_given
from orchestrator.linear.spectra.continuation import Eigenpair, follow_along
from orchestrator.linear.spectra.modes import (
    ELECTROMECHANICAL_HZ,
    Mode,
    Spectrum,
    damping_ratio,
    find_spectrum,
)
from orchestrator.linear.spectra.slowest_decay import decay_of
from orchestrator.linear.spectra.stability import WHOLE, spectrum_of
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION, LeadLag
from orchestrator.studies.pod_design.stages import GAIN_ALONE, NEEDED
from orchestrator.studies.points.key import key_of
from orchestrator.studies.points.store import Arrays, PointStore
from orchestrator.studies.points.task import StudyCase
from orchestrator.systems.coupling.master import Master


class KeptFigures:
    """Figures of a design that are on the disk as soon as they are computed: the same design continues from there."""

    def __init__(self, store: PointStore | None = None, mark: str = "") -> None:
        self._store, self._mark = store, mark

    def get(self, what: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
        if self._store is None:
            return compute()
        key = key_of({"design": self._mark, **what}, "orchestrator.studies.pod_design.design")
        found = self._store.load(key)
        if found is not None:
            return found[1]
        arrays = compute()
        self._store.save(key, {}, arrays)
        return arrays


def figures_of(prepared: PreparedScenario, store: PointStore | None) -> KeptFigures:
    schedule = [prepared.schedule.name, *map(list, prepared.schedule.groups)]
    return KeptFigures(
        store, StudyCase.of(prepared, step_size=prepared.step_size, schedule=schedule).mark
    )


def digest(*arrays: Any) -> str:
    hasher = hashlib.sha256()
    for array in arrays:
        hasher.update(array.tobytes())
    return hasher.hexdigest()


@dataclass(frozen=True)
class PodSetting:
    """Gain [pu of the converter's rating] and lead/lag of a controller; with gain 0 it is off."""

    gain: float
    filters: LeadLag

    def parameters(
        self, keys: Sequence[str], controller: str, stages: int, neutral: float | None = None
    ) -> dict[str, bool | float | str]:
        """By ``component.variable``, with eight significant digits: far more precise than any controller's setting.

        ``neutral``: As `tuned` has it."""
        numbers = self.tuned(neutral)
        found: dict[str, bool | float | str] = {"enabled": self.gain > 0}
        found |= {key: float(f"{number:.8g}") for key, number in numbers.items()}
        found |= {"N_S": stages} if neutral is None else {}
        return {
            f"{component}.{controller}.{key}": value
            for component in keys
            for key, value in found.items()
        }

    def tuned(self, neutral: float | None) -> dict[str, float]:
        """Gain and time constants.

        ``neutral``: both time constants [s] of a device with a fixed number of stages where there is no compensation;
        None where the number can be set; `GAIN_ALONE` where nothing of the lead/lag can."""
        filters = self.filters
        if neutral == GAIN_ALONE:
            return {"K": self.gain}
        if neutral is not None and not filters.T_S2:
            return {"K": self.gain, "T_S1": neutral, "T_S2": neutral}
        return {"K": self.gain, "T_S1": filters.T_S1, "T_S2": filters.T_S2}


@dataclass(frozen=True)
class Placed:
    setting: PodSetting
    pair: Eigenpair

    @property
    def eigenvalue(self) -> complex:
        return self.pair.eigenvalue

    @property
    def damping_ratio(self) -> float:
        return damping_ratio(self.eigenvalue)


class PodLoop:
    """Gives one controller of several components a common setting, and linearises the system.

    ``controller``: ``pod_p`` or ``pod_q``.
    ``kept``: Figures that an earlier start of the same design has left.
    ``neutral``: As `PodSetting.tuned` has it."""

    def __init__(
        self,
        master: Master,
        components: Sequence[str],
        controller: str,
        kept: KeptFigures | None = None,
        *,
        neutral: float | None = None,
    ) -> None:
        self._kept, self._neutral = kept or KeptFigures(), neutral
        self._master, self._components, self._controller = master, tuple(components), controller
        for name in components:
            check_tunable(name, master.components[name].description, controller)
        off = PodSetting(0.0, NO_COMPENSATION)
        self._apply(off)
        self._blocks = Blocks(master)
        self._off = compose(self._blocks, master.schedule)
        self._latest: tuple[PodSetting, LinearModel] | None = (off, self._off)
        self._latest_spectrum: tuple[LinearModel, Spectrum] | None = None

    def model(self, setting: PodSetting) -> LinearModel:
        return self._off if setting.gain == 0 else self._model(setting)

    def spectrum(self, setting: PodSetting) -> Spectrum:
        """All eigenvalues of the step map with this setting, and the modes from 0.1 to 2 Hz; computed once where they
        are asked for in a row."""
        model = self.model(setting)
        if self._latest_spectrum is None or self._latest_spectrum[0] is not model:
            self._latest_spectrum = model, find_spectrum(model, *ELECTROMECHANICAL_HZ)
        return self._latest_spectrum[1]

    def block(self, name: str) -> ComponentLinearization:
        return self._blocks.components[name]

    def examine(
        self,
        setting: PodSetting,
        values: NDArray[np.complex128] | None = None,
        modes: Sequence[Mode] | None = None,
        *,
        spectrum: Spectrum | None = None,
    ) -> Examination:
        """The verdict on the whole system with this setting, at any frequency, with its warnings.

        ``values``: all eigenvalues of a large system's step map with this setting [rad/s], where they are known.
        ``modes``: the modes that must not depend on the perturbation, where they are known.
        ``spectrum``: all eigenvalues of the step map with the modes of the range, where both are known.

        That a large continuous system decays is proved from its step map's eigenvalues, without all of its own."""
        system = where_given(lambda: self._continuous_model(setting))
        model = self._model(setting)
        if values is not None:
            spectrum = spectrum_of(model, values)
        elif spectrum is None and modes is None and len(model.names) <= WHOLE:
            spectrum = self.spectrum(setting)
        known = None if spectrum is None else spectrum.eigenvalues
        decay = None if known is None or system is None else decay_of(system, known)
        return examine(
            self._master,
            self._blocks,
            model,
            system,
            spectrum=spectrum,
            of_system=decay,
            modes=modes,
        )

    def _model(self, setting: PodSetting) -> LinearModel:
        """The step map with this setting, composed of the blocks; linearised once where it is asked for in a row."""
        if self._latest is not None and self._latest[0] == setting:
            self._apply(setting)
            return self._latest[1]
        self._latest = None  # until the blocks are whole again
        self._linearize_converters(self._blocks, setting)
        model = compose(self._blocks, self._master.schedule)
        self._latest = setting, model
        return model

    def continuous_models(self, setting: PodSetting) -> tuple[LinearModel, LinearModel]:
        """The continuous models with half the gain and with the gain. The state matrix is linear in the gain."""
        half, full = (
            self._continuous_model(replace(setting, gain=share * setting.gain))
            for share in (0.5, 1.0)
        )
        return half, full

    def _continuous_model(self, setting: PodSetting) -> LinearModel:
        self._linearize_converters(self._continuous_blocks, setting)
        return continuous(self._continuous_blocks)

    def opened(self) -> tuple[Master, LinearModel, Blocks]:
        """The running system with the controllers off, its continuous model, and the blocks of which that is made."""
        model = self._continuous_model(PodSetting(0.0, NO_COMPENSATION))
        return self._master, model, self._continuous_blocks

    @cached_property
    def _continuous_blocks(self) -> Blocks:
        return Blocks(self._master, without_step=True)

    def _linearize_converters(self, blocks: Blocks, setting: PodSetting) -> None:
        self._apply(setting)
        blocks.renew(self._master, self._components)

    def place(self, start: Placed, gain: float, filters: LeadLag | None = None) -> Placed:
        """Follow the target mode to another gain.

        ``start``: A setting with its known mode. It must have the same lead/lag, or a gain of 0.
        ``filters``: The lead/lag at the new gain; by default that of ``start``."""
        setting = PodSetting(gain, filters or start.setting.filters)
        if start.setting.gain and start.setting.filters != setting.filters:
            raise ValueError(
                "a mode is followed along the gain; with other lead/lag it starts from a gain of 0"
            )
        if gain == start.setting.gain:
            return Placed(setting, start.pair)
        pair = digest(np.array(start.pair.eigenvalue), start.pair.left, start.pair.right)
        what = {"from": astuple(start.setting), "pair": pair, "to": astuple(setting)}
        found = self.figures("place", what, lambda: self._followed(start, setting))
        return Placed(
            setting, Eigenpair(complex(found["eigenvalue"]), found["left"], found["right"])
        )

    def _followed(self, start: Placed, setting: PodSetting) -> Arrays:
        pair = follow_along(
            start.pair,
            lambda value: self.model(replace(setting, gain=value)),
            start.setting.gain,
            setting.gain,
        )
        return {"eigenvalue": np.array(pair.eigenvalue), "left": pair.left, "right": pair.right}

    def figures(self, kind: str, what: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
        """Figures of this loop, from the disk where an earlier start of the same design has left them."""
        own = {"kind": kind, "components": self._components, "controller": self._controller}
        return self._kept.get({**own, **what}, compute)

    def _apply(self, setting: PodSetting) -> None:
        values = {"enabled": setting.gain != 0, **setting.tuned(self._neutral)}
        for name in self._components:
            self._master.components[name].set(
                {f"{self._controller}.{key}": value for key, value in values.items()}
            )


def check_tunable(name: str, description: FmuDescription, controller: str) -> None:
    """A controller's switch and gain must be tunable; a lead/lag that is not stays as it is.

    ``controller``: ``pod_p`` or ``pod_q``."""
    fixed = [
        v
        for v in (f"{controller}.{key}" for key in NEEDED)
        if description.variables[v].variability != "tunable"
    ]
    if fixed:
        raise InputError(
            f"component {name!r}: {', '.join(fixed)} cannot be changed while the FMU runs; a design needs them tunable"
        )
