"""How far a simulated response is from the measured one: errors by windows, delay, steps and ring-down.

The errors are those that published descriptions of IEC 61400-27-2 name: the simulated value less the measured one in
per unit of the rating, its largest magnitude, its mean, and the mean of its magnitude in each window."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, rms
from orchestrator.core.errors import CosimError
from orchestrator.core.late import xr
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.linear.signals.mode_doubts import FEWEST_PERIODS
from orchestrator.output.results.readers import LINE_FREQUENCY
from orchestrator.studies.signals.comparison import modes_without_doubts, strongest_modes
from orchestrator.studies.signals.measured import order_of
from orchestrator.studies.validation.correlation import correlation_length
from orchestrator.studies.validation.record import LEAST_VOLTAGE, Recording
from orchestrator.studies.validation.ring_gaps import without_gaps
from orchestrator.studies.validation.shared_modes import shared_modes
from orchestrator.studies.validation.windows import Windows

SIGNALS = ("p", "q", "i_p", "i_q")
"""Active and reactive power, active and reactive current, all in pu of the rating and into the grid."""

CURRENTS = ("i_p", "i_q")

ModePair = tuple[IdentifiedMode | None, IdentifiedMode | None]
"""A mode of the measured signal and the same one of the simulated; None where there is none."""

ModeLists = tuple[Sequence[IdentifiedMode], Sequence[IdentifiedMode]]
"""Modes of the measured and of the simulated signal."""

Identify = Callable[..., list[IdentifiedMode]]
"""Modes of a signal, strongest first, at an ``order``."""

_MOST_LAG = 0.25  # longest delay that is looked for [s]
_LEAST_MOVES = 0.005  # movement [pu] that has a delay, a step or a ring-down
_FITS = (
    0.1  # part of the measured signal's variance that the difference has at most at its best shift
)
_AS_GOOD = 2.0  # times the least sum of squares, up to which no delay explains the signals as well
_AT_END = 0.1  # part of a window whose mean is the value that a step ends at
_SETTLED = 0.05  # part of a step within which it has settled
_FEW = 20  # samples of a ring-down
_MOST_SAMPLES = 150  # of which modes are looked for; more take seconds and say little more
_SLOWEST_PERIODS = 1.5  # periods of a mode that a window has to hold
_PERIODS_OF_DAMPING = 3.0
"""Periods of a mode in a ring-down, of which fewer tell no damping: 2.3 periods of one with 1.7 % showed 15.7 %."""
_OTHER_LOOKS = ((0.03, 0), (0.06, 0), (0.0, -2), (0.0, 2))
"""Other looks at a ring-down, to see what they change: the part left out at its begin, and how many exponentials more
the model has, as an oscillation takes two."""
_OTHER_LOOKS_AT_SEVERAL = (*_OTHER_LOOKS, (0.1, 0), (0.1, 2), (0.15, 0))
"""The same where several modes are strong, which noise moves further than one by itself."""
_LAST = 0.03  # part of a ring-down at its end that is left out, where the filter of a recorder ends
_AS_STRONG = 0.5  # part of the strongest mode's amplitude, above which another one may pass for it
_SAME_MODE = 0.3  # part of the frequency by which two modes may differ and be the same


@dataclass(frozen=True)
class ErrorFigures:
    """Errors of one signal in one window [pu of the rating], and what the recording alone may make of them.

    That is its scatter, and what is not known between its samples."""

    max_error: float
    max_at: float  # time in the recording's own clock [s]
    mean_error: float
    mean_abs_error: float
    max_of_noise: float
    mean_of_noise: float
    mean_abs_of_noise: float
    least_voltage: float = 1.0  # in the window [pu]

    def doubted(self, doubt: Numbers, *, of_mean: bool = True) -> ErrorFigures:
        """The same with a doubt of each sample's error counted as noise [pu].

        ``of_mean``: Whether it may have the same sign throughout, so that the mean error is in doubt as well."""
        most, usual = float(doubt.max(initial=0.0)), float(doubt.mean())
        return replace(
            self,
            max_of_noise=self.max_of_noise + most,
            mean_of_noise=self.mean_of_noise + (usual if of_mean else 0.0),
            mean_abs_of_noise=self.mean_abs_of_noise + usual,
        )

    def as_json(self) -> dict[str, float]:
        return {
            "max_error_pu": self.max_error,
            "max_at_s": self.max_at,
            "mean_error_pu": self.mean_error,
            "mean_abs_error_pu": self.mean_abs_error,
            "max_of_noise_pu": self.max_of_noise,
            "mean_of_noise_pu": self.mean_of_noise,
            "mean_abs_of_noise_pu": self.mean_abs_of_noise,
        }


@dataclass(frozen=True)
class StepFigures:
    """A signal's way to another value: the step [pu], rise and settling [s], overshoot [part of the step]."""

    step: float
    rise: float | None
    overshoot: float
    settling: float | None

    def as_json(self) -> dict[str, float | None]:
        return {
            "step_pu": self.step,
            "rise_s": self.rise,
            "overshoot_percent": 100 * self.overshoot,
            "settling_s": self.settling,
        }


@dataclass(frozen=True)
class SignalNoise:
    """Scatter of a signal before the event [pu], and for how long a sample is like the next ones [samples]."""

    scatter: float
    together: float


@dataclass(frozen=True)
class ComparedMode:
    """A strong mode of the measured signal, and the simulated one's same mode, or None where that has none.

    ``doubt``: of how far they are apart, by other looks: [%], [points of percent]; ``periods``: of the measured one in
    the ring-down."""

    modes: tuple[IdentifiedMode, IdentifiedMode | None]
    doubt: tuple[float, float] = (0.0, 0.0)
    periods: float = math.inf

    @property
    def few_periods(self) -> str:
        """Why the ring-down tells nothing of the mode; empty where it does."""
        return _few_periods(self.periods)

    def as_json(self) -> dict[str, object]:
        measured, own = self.modes
        return {
            "measured": _mode_json(measured),
            "simulated": _mode_json(own),
            "frequency_doubt_percent": self.doubt[0],
            "damping_doubt_points": self.doubt[1],
        }


@dataclass(frozen=True)
class SignalFigures:
    """Figures of one signal outside of windows, measured and simulated."""

    delay: float | None  # by which the measured one comes later [s]
    steps: tuple[StepFigures | None, StepFigures | None]
    compared_modes: Sequence[ComparedMode] = ()  # of the measured signal's strong modes
    strong_modes: ModeLists = ((), ())  # nearly as strong as the strongest one, by frequency

    @property
    def modes(self) -> ModePair:
        """The strongest mode of the measured signal, and the simulated one's same mode."""
        return self.compared_modes[0].modes if self.compared_modes else (None, None)

    @property
    def modes_doubt(self) -> tuple[float, float]:
        """The doubt of how far these are apart: [%], [points of percent]."""
        return self.compared_modes[0].doubt if self.compared_modes else (0.0, 0.0)

    def as_json(self) -> dict[str, object]:
        step = [one.as_json() if one else None for one in self.steps]
        mode = [_mode_json(one) for one in self.modes]
        strong = [[_mode_json(one) for one in modes] for modes in self.strong_modes]
        return {
            "delay_s": self.delay,
            "step": {"measured": step[0], "simulated": step[1]},
            "ring_down": {
                "measured": mode[0],
                "simulated": mode[1],
                "frequency_doubt_percent": self.modes_doubt[0],
                "damping_doubt_points": self.modes_doubt[1],
                "compared_modes": [one.as_json() for one in self.compared_modes],
                "strong_modes": {"measured": strong[0], "simulated": strong[1]},
            },
        }


def _mode_json(mode: IdentifiedMode | None) -> dict[str, object] | None:
    if mode is None:
        return None
    return {
        "frequency_hz": mode.frequency_hz,
        "damping_percent": mode.damping_percent,
        "amplitude_pu": mode.amplitude,
        "doubts": list(mode.doubts),
    }


def signals_of(recording: Recording, power: Complex) -> dict[str, Numbers]:
    """The compared signals of a power beside a recording's voltage, by name [pu of the rating]."""
    current = recording.current_of(power)
    values = (power.real, power.imag, current.real, current.imag)
    return {name: np.asarray(x) for name, x in zip(SIGNALS, values, strict=True)}


def noise_in(recording: Recording, values: Numbers, windows: Windows) -> SignalNoise:
    """From the window before the event, less its straight line.

    Of an error the scatter is that of the measured power and of what the device makes of the voltage's."""
    part = windows.part("before", recording.times) & recording.good
    seen = values[part]
    if len(seen) < 4:
        return SignalNoise(0.0, 1.0)
    line = np.polyval(np.polyfit(np.arange(len(seen)), seen, 1), np.arange(len(seen)))
    rest = seen - line
    scatter = float(rest.std() * np.sqrt(len(seen) / max(len(seen) - 2, 1)))
    return SignalNoise(scatter, correlation_length(rest))


def errors_in(
    recording: Recording,
    errors: Mapping[str, Numbers],
    windows: Windows,
    place: tuple[str, str],
    noise: SignalNoise,
) -> ErrorFigures | None:
    """Figures of one signal in one window; None without a sample in it.

    ``place``: the window and the signal. The same noise of a power is a larger one of a current where the voltage is
    lower."""
    window, signal = place
    part = windows.part(window, recording.times) & recording.good
    if not part.any():
        return None
    inside, times = errors[signal][part], recording.times[part]
    worst = int(np.abs(inside).argmax())
    independent = max(1.0, len(inside) / noise.together)
    voltage = recording.magnitude[part]
    grows = np.ones(len(inside))
    if signal in CURRENTS:
        before = recording.magnitude[windows.part("before", recording.times)].mean()
        grows = before / np.maximum(voltage, LEAST_VOLTAGE)
    return ErrorFigures(
        max_error=float(np.abs(inside).max()),
        max_at=recording.begin + float(times[worst]),
        mean_error=float(inside.mean()),
        mean_abs_error=float(np.abs(inside).mean()),
        max_of_noise=float(grows.max()) * largest_of_noise(noise, len(inside)),
        mean_of_noise=2 * rms(grows) * noise.scatter / float(np.sqrt(independent)),
        mean_abs_of_noise=float(grows.mean()) * noise.scatter * float(np.sqrt(2 / np.pi)),
        least_voltage=float(voltage.min()),
    )


def largest_of_noise(noise: SignalNoise, count: int) -> float:
    """The largest magnitude that noise alone is expected to have in so many samples [pu]."""
    independent = max(1.0, count / noise.together)
    return noise.scatter * float(np.sqrt(2 * np.log(2 * independent)))


def delay_between(
    recording: Recording, measured: Numbers, simulated: Numbers, windows: Windows
) -> float | None:
    """By how much the measured signal comes after the simulated one [s]; None where nothing moves, or no shift fits.

    The shift at which the difference's sum of squares is least, with a parabola between samples; 0 where no shift
    explains the signals better by much. Shapes that differ at every shift have no delay."""
    if not windows.seen:
        return None
    part = recording.times >= windows.begin - _MOST_LAG
    times = recording.times[part]
    y, x = measured[part], simulated[part]
    if min(np.ptp(x), np.ptp(y)) < _LEAST_MOVES:
        return None
    most = max(2, round(_MOST_LAG / recording.interval))
    shifts = np.arange(-most, most + 1)
    if len(times) < 4 * most:
        return None
    count = len(times) - 2 * most
    cost = np.array([np.var(y[most:-most] - x[most - k :][:count]) for k in shifts])
    best = int(cost.argmin())
    if best in (0, len(shifts) - 1) or cost[best] > _FITS * np.var(y[most:-most]):
        return None
    if cost[most] <= _AS_GOOD * cost[best] + 1e-18:
        return 0.0
    left, middle, right = cost[best - 1 : best + 2]
    curvature = left - 2 * middle + right
    between = 0.5 * (left - right) / curvature if curvature > 0 else 0.0
    return float((shifts[best] + between) * recording.interval)


def step_of(recording: Recording, values: Numbers, windows: Windows) -> StepFigures | None:
    """A step from before the event to the end of what follows it; None where there is none."""
    own = recording.times <= windows.until
    times, values = recording.times[own], values[own]
    before = float(values[windows.part("before", times)].mean())
    late = times >= windows.until - _AT_END * (windows.until - windows.begin)
    step = float(values[late].mean()) - before
    if abs(step) < _LEAST_MOVES or 2 * abs(step) < np.ptp(values[late]):
        return None
    after = times > windows.begin
    way, since = (values[after] - before) / step, times[after] - windows.begin
    above = [np.flatnonzero(way >= part) for part in (0.1, 0.9)]
    rise = float(since[above[1][0]] - since[above[0][0]]) if all(map(len, above)) else None
    outside = np.flatnonzero(np.abs(way - 1) > _SETTLED)
    last = int(outside[-1]) + 1 if len(outside) else 0
    settling = float(since[last]) if last < len(since) else None
    return StepFigures(step, rise, max(0.0, float(way.max()) - 1), settling)


def _ring_downs(
    recording: Recording,
    signals: tuple[Numbers, Numbers],
    windows: Windows,
    more: int = 0,
    least: int = 2,
    identify: Identify = modes_without_doubts,
) -> ModeLists:
    """The modes with which the measured and the simulated signal ring after the event.

    Both have the measured one's order: at an order of its own, each would have other modes. ``more``: how many
    exponentials are added to it; ``least``: how many it has at least."""
    curves = [_ringing(recording, values, windows) for values in signals]
    order = _order(curves[0], more, least)
    measured, own = (_modes(recording, one, windows, order, identify) for one in curves)
    return measured, own


def _order(curve: xr.DataArray | None, more: int = 0, least: int = 2) -> int:
    """How many exponentials a ring-down has; 0 where there is none."""
    return 0 if curve is None else max(least, order_of(curve) + more)


def _same_modes(
    sought: Sequence[IdentifiedMode | None], modes: Sequence[IdentifiedMode]
) -> list[IdentifiedMode | None]:
    """For each mode that is sought the same one of a list, which is of a near frequency; None where there is none.

    No mode is taken twice: of all pairs the nearest one comes first."""
    pairs = [
        (abs(other.eigenvalue - one.eigenvalue), k, j)
        for k, one in enumerate(sought)
        if one is not None
        for j, other in enumerate(modes)
        if abs(other.frequency_hz - one.frequency_hz) < _SAME_MODE * one.frequency_hz
    ]
    taken: dict[int, int] = {}
    for _, k, j in sorted(pairs):
        if k not in taken and j not in taken.values():
            taken[k] = j
    return [modes[taken[k]] if k in taken else None for k in range(len(sought))]


def _strong(modes: Sequence[IdentifiedMode]) -> list[IdentifiedMode]:
    """The modes that another look may take for the strongest one, strongest first."""
    return [one for one in modes if one.amplitude > _AS_STRONG * modes[0].amplitude]


def _by_frequency(modes: Iterable[IdentifiedMode]) -> list[IdentifiedMode]:
    return sorted(modes, key=lambda one: one.frequency_hz)


def modes_apart(modes: ModePair) -> tuple[float, float] | None:
    """By how much the simulated mode is off: frequency [%], damping [points of percent]; None without both."""
    measured, own = modes
    if measured is None or own is None:
        return None
    frequency = (own.frequency_hz / measured.frequency_hz - 1) * 100
    return frequency, own.damping_percent - measured.damping_percent


def _compared_modes(
    recording: Recording, signals: tuple[Numbers, Numbers], windows: Windows, rings: ModeLists
) -> list[ComparedMode]:
    """The strong modes of the measured signal, each beside the simulated one's, with what other looks make of them."""
    strong = _strong(rings[0])
    own = _same_modes(strong, rings[1])
    looks = [] if not any(own) else list(_other_looks(recording, signals, windows, (strong, own)))
    found = []
    for k, pair in enumerate(zip(strong, own, strict=True)):
        doubt = _doubt_of_mode(pair, [look[k] for look in looks])
        found.append(ComparedMode(pair, doubt))
    return found


def _other_looks(
    recording: Recording,
    signals: tuple[Numbers, Numbers],
    windows: Windows,
    sought: tuple[Sequence[IdentifiedMode], Sequence[IdentifiedMode | None]],
) -> Iterator[list[ModePair]]:
    """The same modes, measured and simulated, as each other look at the ring-down shows them.

    With fewer exponentials than all strong modes take, a look would lose one of them by itself."""
    rest, least = windows.until - windows.end, 2 * len(sought[0])
    looks = _OTHER_LOOKS_AT_SEVERAL if len(sought[0]) > 1 else _OTHER_LOOKS
    for part, more in looks:
        later = replace(windows, end=windows.end + part * rest)
        measured, own = _ring_downs(recording, signals, later, more, least)
        yield list(zip(_same_modes(sought[0], measured), _same_modes(sought[1], own), strict=True))


def _doubt_of_mode(found: ModePair, looks: Sequence[ModePair]) -> tuple[float, float]:
    """How far the difference of two modes moves by other looks at the ring-down.

    A look that does not show both modes leaves in doubt whether they differ at all."""
    here = modes_apart(found)
    if here is None:
        return 0.0, 0.0
    seen = [here]
    for look in looks:
        there = modes_apart(look)
        seen.append((-here[0], -here[1]) if there is None else there)
    frequency, damping = 0.5 * np.ptp(np.array(seen), axis=0)
    return float(frequency), float(damping)


def _last_seen(windows: Windows) -> float:
    """The time up to which a ring-down is looked at [s]."""
    return windows.until - _LAST * (windows.until - windows.end)


def _ringing(recording: Recording, values: Numbers, windows: Windows) -> xr.DataArray | None:
    """The part of a signal after the event, thinned; None where it is short or hardly moves."""
    part = (recording.times > windows.end) & (recording.times < _last_seen(windows))
    if part.sum() < _FEW or np.ptp(values[part]) < _LEAST_MOVES:
        return None
    thin = max(1, round(part.sum() / _MOST_SAMPLES))
    times, thinned = (_thinned(x[part], thin) for x in (recording.times, values))
    return xr.DataArray(thinned, {"time": times, LINE_FREQUENCY: 0.0}, ("time",))


def _modes(
    recording: Recording,
    curve: xr.DataArray | None,
    windows: Windows,
    order: int,
    identify: Identify,
) -> list[IdentifiedMode]:
    """The modes of a ring-down that its length and its samples can show."""
    if curve is None:
        return []
    times = curve["time"].values
    try:
        found = identify(curve, order=order)
    except CosimError:
        return []
    slowest = _SLOWEST_PERIODS / (windows.until - windows.end)
    fastest = 0.25 / float(np.median(np.diff(times)))
    length = _last_seen(windows) - windows.end
    return [_doubted(one, length) for one in found if slowest < one.frequency_hz < fastest]


def _doubted(mode: IdentifiedMode, length: float) -> IdentifiedMode:
    """The mode with a doubt of its damping where a ring-down of this length [s] has few periods of it."""
    periods = mode.frequency_hz * length
    few = _few_periods(periods) if periods >= FEWEST_PERIODS else ""  # fewer are doubted already
    return replace(mode, doubts=(*mode.doubts, few)) if few else mode


def _few_periods(periods: float) -> str:
    if periods >= _PERIODS_OF_DAMPING:
        return ""
    return f"the ring-down has {periods:.2g} periods of it, and a damping takes {_PERIODS_OF_DAMPING:g}"


def _thinned(values: Numbers, factor: int) -> Numbers:
    """Means of so many samples after one another."""
    whole = values[: len(values) // factor * factor]
    return np.asarray(whole.reshape(-1, factor).mean(axis=1))


def _compared_rings(
    recording: Recording, signals: tuple[Numbers, Numbers], windows: Windows
) -> tuple[Sequence[ComparedMode], ModeLists]:
    """The strong modes beside each other, and those of each signal by frequency.

    Where the signals are nearly the same, both have the same modes, and what sets these apart is in the difference."""
    shared = _shared_rings(recording, signals, windows)
    if shared:
        measured, own = zip(*(one.modes for one in shared), strict=True)
        strong = _by_frequency(measured), _by_frequency(filter(None, own))
        return shared, strong
    rings = _ring_downs(recording, signals, windows, identify=strongest_modes)
    compared = _compared_modes(recording, signals, windows, rings)
    of_model = [
        *_strong(rings[1]),
        *filter(None, (one.modes[1] for one in compared)),
    ]
    of_each = _by_frequency(_strong(rings[0])), _by_frequency(dict.fromkeys(of_model))
    return compared, of_each


def _shared_rings(
    recording: Recording, signals: tuple[Numbers, Numbers], windows: Windows
) -> list[ComparedMode]:
    """The strong modes of two signals that are nearly the same; empty where they are not."""
    measured, own = (_ringing(recording, values, windows) for values in signals)
    mean = _ringing(recording, 0.5 * (signals[0] + signals[1]), windows)
    modes = _modes(recording, mean, windows, _order(mean), strongest_modes)
    if not modes or measured is None or own is None:
        return []
    both = np.asarray(measured.values), np.asarray(own.values)
    shared = shared_modes(measured["time"].values, both, modes, _strong(modes))
    return [ComparedMode(one.modes, one.doubt) for one in shared]


def compare_signals(
    recording: Recording, simulated: Complex, windows: Windows
) -> Mapping[str, SignalFigures]:
    """Delay, steps and ring-down of P and Q."""
    measured, own = recording.power, simulated
    rung = without_gaps(recording, windows)
    length = _last_seen(rung) - rung.end
    found = {}
    for name, y, x in (("p", measured.real, own.real), ("q", measured.imag, own.imag)):
        pairs, strong = _compared_rings(recording, (y, x), rung)
        compared = [replace(one, periods=one.modes[0].frequency_hz * length) for one in pairs]
        found[name] = SignalFigures(
            delay_between(recording, y, x, windows),
            (step_of(recording, y, windows), step_of(recording, x, windows)),
            compared,
            strong_modes=strong,
        )
    return found
