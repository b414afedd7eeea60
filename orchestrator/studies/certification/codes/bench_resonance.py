"""Oscillations of a row that the bench's own capacitance makes: found by measuring them with less of it.

The capacitance lets the bench's voltage be a state. Together with the source's inductance it resonates at a frequency
in proportion to 1/√C, which no grid has. A device that is not passive there drives it. An oscillation of the device and
the grid keeps its frequency, or nearly so, where the capacitance is another."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import ComponentError, ErrorKind
from orchestrator.simulation.watch.finding import BENCH_RESONANCE, Finding
from orchestrator.studies.certification.codes.measured import RESONANCE
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.recorder import Recorder

PARTS = (1.0, 0.5, 0.25)  # of the capacitance, with which a row is measured

FINER = 0.5
"""Part of the communication step for less than the whole capacitance: a resonance that is twice as fast is seen by as
many points of a period."""

NEAR = (
    0.05  # part by which a frequency may miss what 1/√C asks; the three honest devices miss 0.3 %
)
GONE = 0.1  # part of its size below which an oscillation that dies out is gone

FAST = (
    200.0  # least frequency of such an oscillation, in the frame that turns at the rated one [Hz]
)
ROUGH = 0.02  # least size of its voltage (root mean square) that can make a row fail [pu]
SHARE = 0.5  # least part of the voltage's whole motion that it is

BLOCK = 0.01  # of a record, in which its second differences are compared with those before [s]
KEPT = 0.9  # part that is left after a block where it lasts; the source's own damping leaves 0.73

SPAN = 0.1  # time after its beginning in which it is measured [s]
WINDOW = 0.04  # time over which its frequency is measured [s]
LASTING = 0.5  # part of its largest size that is left at the end of the span; the source's damping leaves 0.15
_FINER = 16  # points of the spectrum for one that the window gives

Preparation = Callable[[float, float], PreparedScenario]


@dataclass(frozen=True)
class Ring:
    """A fast oscillation of the bus voltage, where it is largest.

    Attributes
    ----------
    frequency
        In the frame of the phases [Hz].
    size
        Root mean square of its voltage [pu].
    share
        Part of the voltage's whole motion there.
    lasts
        If it does not die out within the span.
    driven
        Power at which the plant feeds it [pu of its rating]; negative where the plant damps it.
    """

    frequency: float
    size: float
    share: float
    lasts: bool
    driven: float


def ringing_since(times: Numbers, v: Complex) -> float | None:
    """Return since when a row's voltage is rough without becoming smoother [s]; None where it never is.

    ``v``: at the record's interval, shape (n,), which may be longer than a period: roughness alone is looked at."""
    count = int(np.argmin(np.isfinite(v))) if not np.isfinite(v).all() else len(v)
    if count < 3:
        return None
    times, v = times[:count], v[:count]
    high = np.flatnonzero(np.abs(v) > RESONANCE)
    found = [float(times[high[0]])] if len(high) else []
    length = max(1, round(BLOCK / float(times[1] - times[0])))
    rough = np.abs(np.diff(v, 2)) ** 2
    blocks = len(rough) // length
    sizes = np.sqrt(rough[: blocks * length].reshape(blocks, length).mean(axis=1))
    lasting = (sizes[:-1] > ROUGH) & (sizes[1:] >= KEPT * sizes[:-1])
    # three blocks in a row, as the jump of an event is rough by itself, and may stand in two
    begun = np.flatnonzero(lasting[1:] & lasting[:-1])
    found += [float(times[begun[0] * length])] if len(begun) else []
    return min(found, default=None)


def ring_of(times: Numbers, v: Complex, i: Complex, f_n: float) -> Ring | None:
    """Return the largest fast oscillation of a voltage in the frame that turns at the rated frequency.

    ``v``, ``i``: voltage and the plant's current at evenly spaced times, shape (n,); None where there are too few."""
    length = round(WINDOW / float(times[1] - times[0])) if len(times) > 1 else 0
    starts = range(0, len(times) - length + 1, max(1, length // 2))
    if not length or not starts:
        return None
    fast = [_fast_part(v[k : k + length], times[1] - times[0]) for k in starts]
    sizes = [_size(part) for part in fast]
    k = int(np.argmax(sizes))
    window = slice(starts[k], starts[k] + length)
    own = v[window]
    current = _fast_part(i[window], times[1] - times[0])
    return Ring(
        frequency=abs(_frequency(fast[k], times[1] - times[0]) + f_n),
        size=sizes[k],
        share=sizes[k] / max(_size(own - own.mean()), 1e-12),
        lasts=sizes[-1] >= LASTING * sizes[k],
        driven=float(np.mean((fast[k] * current.conj()).real)),
    )


def _size(v: Complex) -> float:
    return float(np.sqrt(np.mean(np.abs(v) ** 2)))


def _fast_part(v: Complex, step: float) -> Complex:
    """The part of a window above `FAST`, without a straight drift, whose ends would add to it."""
    place = np.linspace(-1.0, 1.0, len(v))
    slope = np.sum(place * v) / np.sum(place**2)
    spectrum = np.fft.fft(v - v.mean() - slope * place)
    spectrum[np.abs(np.fft.fftfreq(len(v), step)) < FAST] = 0
    return np.asarray(np.fft.ifft(spectrum))


def _frequency(v: Complex, step: float) -> float:
    """Return the frequency of the largest part [Hz]; negative where it turns the other way."""
    count = _FINER * len(v)
    spectrum = np.abs(np.fft.fft(v * np.hanning(len(v)), count))
    return float(np.fft.fftfreq(count, step)[int(np.argmax(spectrum))])


def of_the_bench(rings: Sequence[Ring], highest: float) -> bool:
    """Return whether an oscillation is the bench's own, from what it is with each of `PARTS` of the capacitance.

    ``highest``: voltage that it reaches with the whole [pu].

    Of a motion that is mostly slow, or dies out by itself, it says nothing: what fails there has another cause."""
    first = rings[0]
    large = first.size > ROUGH and first.share > SHARE
    if not large or first.driven <= 0 or not (first.lasts or highest > RESONANCE):
        return False
    return all(
        (_moves(first, ring, part) or _is_gone(first, ring))
        for ring, part in zip(rings[1:], PARTS[1:], strict=True)
    )


def _moves(first: Ring, ring: Ring, part: float) -> bool:
    return bool(abs(ring.frequency * part**0.5 / first.frequency - 1) < NEAR)


def _is_gone(first: Ring, ring: Ring) -> bool:
    return ring.size < GONE * first.size and not ring.lasts


def find_resonance(
    prepare: Preparation, times: Numbers, v: Complex, names: Sequence[str], f_n: float
) -> Finding | None:
    """Measure a row again where its voltage rings, and return the finding if that is the bench's own resonance.

    Parameters
    ----------
    prepare
        The row's scenario for a part of the capacitance and one of the communication step.
    times, v
        Voltage of the row that failed, shape (n,) [s, pu].
    names
        Of the bench's real and imaginary voltage, and of the plant's active and reactive power.
    f_n
        Rated frequency [Hz].
    """
    begin = ringing_since(times, v)
    if begin is None:
        return None
    rings: list[Ring] = []
    highest = 0.0
    for part in PARTS:
        at, voltage, current = _measured(prepare(part, 1.0 if part == 1.0 else FINER), begin, names)
        ring = ring_of(at, voltage, current, f_n)
        if ring is None:
            return None
        rings.append(ring)
        highest = highest if highest else float(np.abs(voltage).max())
        if part == 1.0 and (ring.share < SHARE or ring.driven <= 0):
            return None
    return _finding(begin, rings, highest) if of_the_bench(rings, highest) else None


def _measured(
    prepared: PreparedScenario, begin: float, names: Sequence[str]
) -> tuple[Numbers, Complex, Complex]:
    """Times, voltage and current of a row at each of its communication points after a beginning."""
    recorder, step = Recorder(names, 1), prepared.step_size
    first, stop = (
        min(round(time / step) * step, prepared.stop_time) for time in (begin, begin + SPAN)
    )
    sooner = [event for event in prepared.events if event.time < first]
    later = [event for event in prepared.events if first <= event.time < stop]
    with running(prepared) as master:
        try:
            master.run(first, sooner)  # without an observer at each step it is far faster
            master.run(stop, later, (recorder,))
        except ComponentError as error:
            if error.kind is ErrorKind.HANG:
                raise
    shown = np.isfinite(recorder.values).all(axis=1)
    v_re, v_im, p, q = recorder.values[shown].T
    v = v_re + 1j * v_im
    return recorder.times[shown], v, np.conj((p + 1j * q) / np.where(np.abs(v) < 1e-6, 1e-6, v))


def _finding(begin: float, rings: Sequence[Ring], highest: float) -> Finding:
    first, *others = rings
    figures = {"frequency_hz": first.frequency, "highest": highest, "driven": first.driven}
    seen = []
    for ring, part in zip(others, PARTS[1:], strict=True):
        moved = _moves(first, ring, part)
        figures[f"frequency_at_{part:g}"] = ring.frequency if moved else 0.0
        seen.append(f"{ring.frequency:.0f} Hz" if moved else "gone")
    asked = " and ".join(f"{first.frequency / part**0.5:.0f}" for part in PARTS[1:])
    message = (
        f"from t = {begin:.4g} s on the voltage rings at {first.frequency:.0f} Hz, up to {highest:.3g} pu: the "
        "resonance of the bench's own capacitance with the source. With a half and a quarter of the capacitance it is "
        f"{' and '.join(seen)} ({asked} Hz by 1/√C): no grid has it. What decides is the device's conductance at this "
        f"frequency: it feeds {first.driven:.3g} pu of power into the oscillation, as a current that lags its voltage "
        "there does. `gfor fmu admittance` tells where it is not passive"
    )
    return Finding(BENCH_RESONANCE, begin, "", "", message, figures=figures)
