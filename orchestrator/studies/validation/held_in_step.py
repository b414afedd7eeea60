"""A play-back that gives way: the recorded voltage turns with a model that would fall out of step beside it.

A device at its limit of the current is unstable beside a voltage that does not give way, though the plant was stable
in its grid. What no sample holds then makes the right model fall as well as a wrong one. So the angle of the voltage
follows that of the model's current, as an observer's state follows what is measured (Luenberger, 1964). With the
model's current i and the measured one i_m, both in the recording's frame [pu of the rating], the turn φ moves by

    dφ/dt = g · Im(i · conj(i_m)).

A model that is right feeds the measured current, and nothing turns. What gives way is counted as an error: as the
power that it would move through a usual reactance. The page on play-back derives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.black_box.bench import STEPS_AT_ONCE, Stretches, Turning

_GAIN = 2.0
"""Speed of the turn for a whole current that is a radian off [1/s]; from 1 to 4 the right model leaves the least."""

_INTERVAL = 1e-3
"""Time for which that speed is held [s]; with twice as much the ringing between device and voltage grows."""

_LASTS = 1.0
"""Time for which a turn counts [s]: an angle that stays is another zero, and moves nothing."""

_REACTANCE = 1.0
"""Between the turned voltage and the recorded one, through which a turn counts as power [pu of the rating]."""

Drive = Callable[[Complex, Complex], Complex]
"""Steps a device with the voltages of some steps, and with those at which it is read; gives its currents."""


@dataclass(frozen=True)
class StepRun:
    """The currents of a run that was held in step, in the recording's frame, and the turn as power [pu]."""

    current: Complex
    turn: Numbers


def steps_held(step_size: float) -> int:
    """Steps of a device for which the speed of the turn is held."""
    return max(1, round(_INTERVAL / step_size))


def hold_at_once(
    stretches: Stretches,
    voltage: tuple[Complex, Complex],
    measured: Complex,
    step_size: float,
    scale: float,
) -> StepRun:
    """The same as `hold_in_step` to the last bit, in C, for a component that is stepped in this process.

    ``scale``: of its outputs, which makes them a current [pu of the rating]."""
    each, count = steps_held(step_size), len(measured)
    held, late = map(np.ascontiguousarray, voltage)
    means = _means_of_stretches(measured, each)
    along = step_size * np.arange(1, each + 1)
    angle, ahead = np.empty(each), np.empty(each, dtype=complex)
    current, turns = np.empty(count, dtype=complex), np.empty(count)
    asked = Turning(
        along=along.ctypes.data,
        angle=angle.ctypes.data,
        ahead=ahead.ctypes.data,
        each=each,
        gain=_GAIN,
        lasts=_LASTS,
        scale=scale,
    )
    at_once = max(1, STEPS_AT_ONCE // each)  # stretches
    for first in range(0, count, at_once * each):
        asked.count = min(at_once * each, count - first)
        asked.voltage, asked.late = held[first:].ctypes.data, late[first:].ctypes.data
        asked.measured = means[first // each :].ctypes.data
        asked.current, asked.turns = current[first:].ctypes.data, turns[first:].ctypes.data
        stretches.turn(asked)
    return StepRun(current, turns / _REACTANCE)


def _means_of_stretches(values: Complex, each: int) -> Complex:
    """The conjugates of the means over so many values each; the last one may be over fewer."""
    whole = len(values) // each * each
    means = values[:whole].reshape(-1, each).sum(axis=1) / each
    if whole < len(values):
        means = np.append(means, values[whole:].sum() / (len(values) - whole))
    return np.ascontiguousarray(means.conj())


def hold_in_step(
    drive: Drive, voltage: tuple[Complex, Complex], measured: Complex, step_size: float
) -> StepRun:
    """Drive a device while the voltage turns with its current.

    ``voltage``: for each step that which is held in it, and that at which the current is read; ``measured``: the
    current at the ends of the steps [pu of the rating], as ``drive`` gives it."""
    held, late = voltage
    each = steps_held(step_size)
    along = step_size * np.arange(1, each + 1)
    parts, turns = [], []
    turn = slow = rate = 0.0
    for first in range(0, len(held), each):
        part = slice(first, first + each)
        angle = turn + rate * along[: len(held) - first]  # a jump of it would ring
        ahead = np.exp(1j * angle)
        current = drive(held[part] * ahead, late[part] * ahead) * ahead.conj()
        parts.append(current)
        turns.append((angle - slow) / _REACTANCE)
        count, turn = len(angle), float(angle[-1])
        slow += (turn - slow) * float(along[count - 1]) / _LASTS
        off = current.sum() / count * np.conj(measured[part].sum() / count)
        rate = _GAIN * float(off.imag)
    return StepRun(np.concatenate(parts), np.concatenate(turns))
