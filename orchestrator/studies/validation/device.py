"""A device behind the recorded voltage: where it starts, and what it feeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.device_or_controller import NO_BUS, PORT, is_controller_alone
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.studies.black_box.bench import MOST_BESIDE, Stretches, drive
from orchestrator.studies.validation.averaging import averaged
from orchestrator.studies.validation.held_in_step import hold_at_once, hold_in_step, steps_held
from orchestrator.studies.validation.instances import InstanceRun, InstanceShelf
from orchestrator.studies.validation.over_limit import OverLimit, limit_outputs, over_limit
from orchestrator.studies.validation.record import SHORT_STEP, Driving, Recording
from orchestrator.studies.validation.side_by_side import (
    AskingRun,
    StepsAsked,
    run_alone,
    run_beside,
)
from orchestrator.studies.validation.trials import TrialLog
from orchestrator.systems.coupling.step_awareness import STEP_PARAMETER

_VOLTAGE, _CURRENT = ("v_re", "v_im"), ("i_re", "i_im")
_NAMES = (_VOLTAGE, _CURRENT)
_IN_PHASOR = np.array([1.0, 1j])  # of a row of two components
_STARTS = ("P_0", "Q_0", "v_0", "theta_0")
_STILL = 1e-4  # movement of the current in a round [pu of the rating] at which a device is at rest
_ROUND = 0.5  # time [s] for which it is looked at
_ROUGH_STEP = (
    5e-4  # communication step [s] for a first look: half the time of a run in steps of 100 us
)
_PROBE_STEPS = 200  # that move most states of a device
_PROBE_JUMP = 0.95 + 0.05j  # of the voltage, in magnitude and angle
_LONGEST_REST = 20.0  # time [s] after which it is driven, at rest or not
_MOST_SAMPLES = 2_000_000  # of the outcomes of plays that are kept, 32 MB
_FEWEST = 4
"""Plays that are sooner made side by side than one by one: eight lanes take as long as 3.2 of our EMT converter alone,
and as long as 4 of that of phasors, whether all are used or not."""


@dataclass(frozen=True)
class OperatingStart:
    """The operating point before the event: voltage [pu], power [pu of the rating]."""

    voltage: complex
    power: complex


class StartRefusedError(InputError):
    """A device does not take the operating point before the event.

    ``said``: what it takes, without a guess why."""

    def __init__(self, said: str, guess: str) -> None:
        super().__init__(said + "; " + guess)
        self.said = said


@dataclass(frozen=True)
class Played:
    """The power that a device fed at the times of a recording.

    ``current``: [pu of the rating], in the recording's frame; ``settled_after``: time that it needed to come to rest at
    the operating point before [s]; ``rest``: power with which it stood there [pu of the rating]."""

    power: Complex
    settled_after: float
    rest: complex
    still: bool  # whether it came to rest
    over_limit: OverLimit | None = None  # where its current is above a limit that it lacks

    def same_as(self, other: Played) -> bool:
        """Return whether both are the same to the last bit."""
        mine, others = ((one.settled_after, one.rest, one.still) for one in (self, other))
        return mine == others and np.array_equal(self.power, other.power)


@dataclass(frozen=True)
class Play:
    """A device by a recording, from an operating point on."""

    device: PlayedDevice
    recording: Recording
    start: OperatingStart

    def same_as(self, other: Play) -> bool:
        """Return whether both give the same: their recordings are one, which is not compared."""
        mine, others = ((one.device, one.start) for one in (self, other))
        return self.recording is other.recording and mine == others

    def answers_as(self, other: Play) -> bool:
        """Return whether both give the same, by recordings that drive the device alike."""
        if (self.device, self.start) != (other.device, other.start):
            return False
        mine, others = self.recording, other.recording
        if mine is others:
            return True
        if self.device.gives_way and not mine.measured_as(others):
            return False
        return mine.drives_as(others)

    @property
    def goes_beside(self) -> bool:
        """Return whether it can be made beside others: the voltage does not turn with it, and it runs in here."""
        return not (self.device.gives_way or self.device.isolated)


class AnnouncedPlays:
    """Plays that are likely asked for, and those that were made beside the first one that was."""

    def __init__(self) -> None:
        self._awaited: list[Play] = []
        self._made: list[tuple[Play, Played]] = []

    def renew(self, plays: Sequence[Play]) -> None:
        """Await others in place of those that were awaited before."""
        self._awaited, self._made = [one for one in plays if one.goes_beside], []

    def take(self, play: Play) -> Played | None:
        """The outcome of a play that was made beside others; None of one that is to be made alone."""
        for k, one in enumerate(self._awaited):
            if one.same_as(play):
                beside = self._awaited[k : k + MOST_BESIDE]
                del self._awaited[: k + MOST_BESIDE]
                self._made += _made_beside(beside)
                break
        for k, (one, _) in enumerate(self._made):
            if one.same_as(play):
                return self._made.pop(k)[1]
        return None


class MadePlays:
    """The outcomes of plays between `keeping` and its end, inside which none is made twice.

    A search comes back to where it was: to the device as it is given for each of its parts, and to the best values."""

    def __init__(self) -> None:
        self._known: dict[frozenset[tuple[str, float | bool]], list[tuple[Play, Played]]] = {}
        self._samples = 0
        self._keeps = False

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Inside ``with``, outcomes are kept; at its end they are forgotten."""
        self._keeps = True
        try:
            yield
        finally:
            self._keeps = False
            self._forget()

    def find(self, play: Play) -> Played | None:
        """The outcome of a play that was made before; None of another one."""
        if not self._keeps:
            return None
        known = self._known.get(frozenset(play.device.values.items()), ())
        return next((made for one, made in known if one.answers_as(play)), None)

    def keep(self, play: Play, made: Played) -> None:
        """Keep an outcome, if need be in place of all others."""
        if not self._keeps:
            return
        if self._samples + len(made.power) > _MOST_SAMPLES:
            self._forget()
        self._samples += len(made.power)
        self._known.setdefault(frozenset(play.device.values.items()), []).append((play, made))

    def _forget(self) -> None:
        self._known.clear()
        self._samples = 0


@dataclass(frozen=True)
class PlayedDevice:
    """A device with its values, at a port of ours."""

    name: str
    description: FmuDescription
    values: Mapping[str, float | bool]
    rating: float  # [MVA]
    rated_hz: float
    step_size: float = 1e-4  # communication step [s]
    held: Mapping[str, float] = field(default_factory=dict)  # its other inputs
    isolated: bool | None = None  # as in `open_component`
    gives_way: bool = False  # whether the voltage turns with it, so that it stays in step
    shelf: InstanceShelf = field(default_factory=InstanceShelf, compare=False)
    trials: TrialLog = field(default_factory=TrialLog, compare=False)  # that it refused
    announced: AnnouncedPlays = field(default_factory=AnnouncedPlays, compare=False)
    made: MadePlays = field(default_factory=MadePlays, compare=False)

    @property
    def path(self) -> Path:
        return self.description.path

    @property
    def takes_any_step(self) -> bool:
        """Return whether it runs with any communication step, as our own FMUs do."""
        return not self.isolated and is_ours(self.path)

    @property
    def rough(self) -> PlayedDevice:
        """The same in longer steps, where it takes any: good enough to see what is worth a look."""
        if not self.takes_any_step or self.step_size >= _ROUGH_STEP:
            return self
        return replace(self, step_size=_ROUGH_STEP)

    @property
    def in_step(self) -> PlayedDevice:
        """The same beside a voltage that turns with it."""
        return replace(self, gives_way=True)

    def with_values(self, values: Mapping[str, float | bool]) -> PlayedDevice:
        return replace(self, values={**self.values, **values})

    @property
    def rating_is_told(self) -> bool:
        """Return whether the rating was given, or no other one can be: else it is the start value of its file."""
        return "S_n" in self.values or "S_n" not in self.description.variables

    def value(self, name: str) -> float | bool:
        """A parameter's value with which it runs."""
        if name in self.values:
            return self.values[name]
        start = self.description.variables[name].start
        return start if isinstance(start, bool) else float(start or 0.0)

    def check_port(self) -> None:
        missing = [name for name in PORT if name not in self.description.variables]
        if not missing:
            return
        lacks = f"{self.path.name}: it has no {', '.join(missing)}"
        if is_controller_alone(self.description):
            raise InputError(f"{lacks}: {NO_BUS}")
        raise InputError(
            f"{lacks}; it is driven at our port, to which a vendor.toml maps another "
            "FMU's variables: give it with " + Option.BINDING + " (`gfor fmu bind` drafts one)"
        )

    def play(self, recording: Recording, start: OperatingStart) -> Played:
        """Bring it to rest at the operating point, and let the recorded voltage drive it.

        The voltage of a step is that at its begin, as in a coupled run. A longer step takes the mean of what such short
        steps would hold, and its end what the last of them would: that at its begin alone would be late by half of it
        in what a device integrates, and by all of it in what follows the voltage at once."""
        play = Play(self, recording, start)
        made = self.made.find(play)
        if made is None:
            made = self.announced.take(play) or self._play_alone(recording, start)
            self.made.keep(play, made)
        return made

    def _play_alone(self, recording: Recording, start: OperatingStart) -> Played:
        values = self._values_at(start)
        run = InstanceRun(
            self.description,
            self.isolated,
            values,
            work=lambda component: run_alone(
                self.asking_run(component, recording, start), component
            ),
            probe=lambda component: self._probe(self._begin(component, values, start), start),
        )
        return self.shelf.run(run)

    def announce(self, plays: Sequence[Play]) -> None:
        """Tell which plays will likely be asked for next, in their order, of this device with any values.

        They are then made side by side where they can be, each with the bits that it has alone. What was announced
        before is forgotten."""
        self.announced.renew([one for one in plays if self.made.find(one) is None])

    def asking_run(
        self, component: Component, recording: Recording, start: OperatingStart
    ) -> AskingRun[Played]:
        """A run of an instance from its start on, which asks for its steps."""
        self._begin(component, self._values_at(start), start)
        return (yield from self._run(component, recording, start))

    def _values_at(self, start: OperatingStart) -> dict[str, float | bool]:
        """The values of a run at an operating point."""
        return {**self._told_step(), **self._start_values(start), **self.values}

    def _begin(
        self, component: Component, values: Mapping[str, float | bool], start: OperatingStart
    ) -> Component:
        """Initialise an instance at the operating point."""
        component.setup(0.0, None)
        component.set(values)
        component.enter_initialization_mode()
        at = (start.voltage.real, start.voltage.imag)
        component.set({**self.held, **dict(zip(_VOLTAGE, at, strict=True))})
        component.exit_initialization_mode()
        return component

    def _probe(self, component: Component, start: OperatingStart) -> Numbers:
        """Currents after a jump of the voltage, in few steps."""
        jumped = np.full(_PROBE_STEPS, start.voltage * _PROBE_JUMP)
        return drive(component, _NAMES, _columns(jumped), self.step_size)

    def _run(
        self, component: Component, recording: Recording, start: OperatingStart
    ) -> AskingRun[Played]:
        """A run of an instance that stands at the operating point."""
        at = (start.voltage.real, start.voltage.imag)
        begin = RealBatch(component, _CURRENT).read().copy()
        before = yield from self._rest(at, begin)
        driven, over = yield from self._driven(component, recording, before)
        rest = start.voltage * complex(*before[-1]).conjugate() * SYSTEM_BASE_MVA / self.rating
        settled_after = (len(before) - 1) * self.step_size
        still = settled_after < _LONGEST_REST
        return Played(driven, settled_after, rest, still, over)

    def _told_step(self) -> dict[str, float]:
        """The communication step, for a device whose outputs are for the middle of the next one.

        No longer one than a coupled run has: what is measured is of its own time."""
        info = self.description.variables.get(STEP_PARAMETER)
        known = info is not None and info.causality == "parameter"
        return {STEP_PARAMETER: min(self.step_size, SHORT_STEP)} if known else {}

    def _start_values(self, start: OperatingStart) -> dict[str, float]:
        """The power flow's values of a device; those that it does not know are left out."""
        found = {
            "P_0": start.power.real,
            "Q_0": start.power.imag,
            "v_0": abs(start.voltage),
            "theta_0": float(np.angle(start.voltage)),
        }
        for name in ("P_0", "Q_0", "v_0"):
            info = self.description.variables.get(name)
            if info is None:
                continue
            low, high = info.minimum, info.maximum
            if (low is not None and found[name] < low) or (high is not None and found[name] > high):
                raise StartRefusedError(
                    f"{self.name}: before the event the recording has {name} = {found[name]:.4g} pu, and the device "
                    f"takes {low} to {high}",
                    f"is its rating {self.rating:g} MVA ("
                    + Option.SET
                    + " S_n=…), and are the recording's units as gfor reads them ("
                    + Option.CHANNEL
                    + ")?",
                )
        return {name: value for name, value in found.items() if name in self.description.variables}

    def _rest(self, at: tuple[float, float], begin: Numbers) -> AskingRun[Numbers]:
        """Currents while the voltage before the event is held, until they are still; the first is that of the start."""
        each = max(1, round(_ROUND / self.step_size))
        rows = [begin[None, :]]
        held = np.tile(at, (each, 1))
        scale = SYSTEM_BASE_MVA / self.rating
        for k in range(round(_LONGEST_REST / _ROUND)):
            rows.append((yield StepsAsked(_NAMES, held, self.step_size, k * each)))
            if np.abs(rows[-1] - rows[-2][-1]).max() * scale <= _STILL:
                break
        return np.concatenate(rows)

    def _driven(
        self, component: Component, recording: Recording, before: Numbers
    ) -> AskingRun[tuple[Complex, OverLimit | None]]:
        """Power at the recording's times [pu of the rating], as means over as long as the recording's.

        And where the current is above a limit that the device lacks, unless the voltage turns with it."""
        driving = recording.driving_in(self.step_size)
        held = driving.held
        index = len(before) - 1
        scale = SYSTEM_BASE_MVA / self.rating
        turn: Numbers = np.zeros(len(held) + 1)
        over = None
        if self.gives_way:
            currents, turn[1:] = self._held_in_step(component, recording, driving, index)
        else:
            late = _columns(held[:, -1]) if held.shape[1] > 1 else None
            inputs = _columns(driving.means)
            outputs = yield StepsAsked(self._names, inputs, self.step_size, index, late)
            currents = outputs[:, :2] @ _IN_PHASOR
            over = over_limit(outputs[:, 2], self.step_size) if outputs.shape[1] > 2 else None
        currents = np.concatenate([before[-1:] @ _IN_PHASOR, currents])
        power = driving.voltage * currents.conj() * scale + turn
        means = averaged(driving.times, power, recording.average, recording.times, recording.ahead)
        return means, over

    def _held_in_step(
        self, component: Component, recording: Recording, driving: Driving, index: int
    ) -> tuple[Complex, Numbers]:
        """Currents while the voltage turns with them, and the turn as power [pu of the rating]."""
        scale = SYSTEM_BASE_MVA / self.rating
        each = steps_held(self.step_size)
        stretches = Stretches(component, self._names, each, self.step_size, index)

        def stretch(voltage: Complex, late: Complex) -> Complex:
            found = stretches.drive(_columns(voltage), _columns(late))
            return np.asarray(found[:, :2] @ _IN_PHASOR * scale)

        good = recording.good
        current: Complex = np.conj(recording.power[good] / recording.voltage[good])
        ends: Numbers = np.asarray(self.step_size * np.arange(1, len(driving.held) + 1))
        measured: Complex = np.interp(ends, recording.times[good], current)
        voltage = driving.means, driving.held[:, -1]
        if stretches.turns_at_once:
            run = hold_at_once(stretches, voltage, measured, self.step_size, scale)
        else:
            run = hold_in_step(stretch, voltage, measured, self.step_size)
        return run.current / scale, run.turn

    @cached_property
    def _names(self) -> tuple[Sequence[str], Sequence[str]]:
        """Names of the inputs and of the outputs of a run."""
        return _VOLTAGE, (*_CURRENT, *limit_outputs(self.description))


def _columns(values: Complex) -> Numbers:
    return np.ascontiguousarray(values).view(float).reshape(-1, 2)


def _made_beside(plays: Sequence[Play]) -> list[tuple[Play, Played]]:
    """Plays with their outcomes; without those that fail, and none where too few go side by side."""
    if len(plays) < _FEWEST:
        return []
    device = plays[0].device
    with device.shelf.side_by_side(device.description, len(plays)) as components:
        if not components:
            return []
        runs = [
            one.device.asking_run(component, one.recording, one.start)
            for one, component in zip(plays, components, strict=True)
        ]
        found = run_beside(runs, components)
    return [(plays[number], played) for number, played in sorted(found.items())]
