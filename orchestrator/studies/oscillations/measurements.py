"""Phasors and powers at places of a grid over the time, made ready: even, without gaps, angles without wraps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError

RATE = 40.0  # samples a second that are kept; denser records pass an anti-alias filter
_LONGEST_GAP = 0.25  # gap that is filled by a straight line [s]: a quarter of a period at 1 Hz
_FEWEST = 60
_MOST_FILLED = 0.1  # part of a place's samples that may be missing

Kind = Literal["unit", "branch"]


@dataclass(frozen=True)
class Site:
    """Voltage of a bus and the power that goes into it from a unit or out of a branch."""

    name: str
    kind: Kind
    bus: str
    # v, angle: magnitude [any unit] and angle [rad] of the voltage.
    v: Numbers
    angle: Numbers
    # p, q: into the bus; a branch's are minus what flows off through it.
    p: Numbers
    q: Numbers
    beyond: str = ""


@dataclass(frozen=True)
class Measurements:
    """Places of one record at common, evenly spaced times [s]."""

    label: str
    times: Numbers
    places: tuple[Site, ...]
    remarks: tuple[str, ...] = field(default=())
    base: float = 1.0  # what 100 MVA are in the unit of the powers

    @property
    def interval(self) -> float:
        return float(self.times[1] - self.times[0])

    @property
    def candidates(self) -> tuple[Site, ...]:
        """Units, and branches to buses that are not observed: what can feed an oscillation into the observed part."""
        observed = {place.bus for place in self.places}
        return tuple(p for p in self.places if p.kind == "unit" or p.beyond not in observed)


def made_ready(
    label: str, times: Numbers, places: Sequence[Site], remarks: Sequence[str] = ()
) -> Measurements:
    """Bring a record into the form in which it is analysed; what was done to it is in the remarks.

    Raises `InputError` if too little is left."""
    said = list(remarks)
    times, places = _without_doubles(times, places, said)
    times, places = _longest_stretch(times, places, said)
    places = [whole for place in places if (whole := _filled(place, times, said)) is not None]
    if len(times) < _FEWEST or not places:
        raise InputError(
            f"{label}: {len(times)} samples at {len(places)} places without longer gaps; an oscillation is looked for "
            f"in at least {_FEWEST} samples of voltage, angle, P and Q at one place"
        )
    return _thinned(label, times, [_unwrapped(place) for place in places], said)


def _each(place: Site, change: Callable[[Numbers], Numbers]) -> Site:
    return replace(
        place, v=change(place.v), angle=change(place.angle), p=change(place.p), q=change(place.q)
    )


def _without_doubles(
    times: Numbers, places: Sequence[Site], said: list[str]
) -> tuple[Numbers, list[Site]]:
    """A time that is written twice, as simulators do at a discontinuity, counts with what comes after it."""
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise InputError("the times of the record do not rise; sort its rows")
    keep = np.append(np.diff(times) > 0, True)[: len(times)]
    if not keep.all():
        said.append(f"{int((~keep).sum())} times are written twice; the later row of each is used")
    return times[keep], [_each(place, lambda x: x[keep]) for place in places]


def _longest_stretch(
    times: Numbers, places: list[Site], said: list[str]
) -> tuple[Numbers, list[Site]]:
    """Even times, with missing rows as NaN; of a record with long gaps the longest part."""
    if len(times) < 2:
        return times, places
    step = float(np.median(np.diff(times)))
    cuts = np.flatnonzero(np.diff(times) > max(_LONGEST_GAP, 1.5 * step))
    if len(cuts):
        edges = [0, *(int(c) + 1 for c in cuts), len(times)]
        a, b = max(pairwise(edges), key=lambda e: e[1] - e[0])
        said.append(
            f"rows are missing: only the part from {times[a]:g} to {times[b - 1]:g} s is used"
        )
        times, places = times[a:b], [_each(place, lambda x: x[a:b]) for place in places]
    even = times[0] + step * np.arange(round((times[-1] - times[0]) / step) + 1)
    if len(even) == len(times) and np.allclose(even, times, rtol=0, atol=0.02 * step):
        return even, places
    said.append(f"times are uneven or rows are missing: values are interpolated every {step:g} s")

    def interpolated(values: Numbers) -> Numbers:
        return np.asarray(np.interp(even, times, values), dtype=np.float64)

    return even, [_each(_unwrapped(place), interpolated) for place in places]


def _filled(place: Site, times: Numbers, said: list[str]) -> Site | None:
    """Short gaps bridged by straight lines; None for a place with longer ones."""
    bad = ~(
        np.isfinite(place.v)
        & np.isfinite(place.angle)
        & np.isfinite(place.p)
        & np.isfinite(place.q)
    )
    if not bad.any():
        return place
    edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
    longest = int((edges[1::2] - edges[::2]).max()) * float(times[1] - times[0])
    if longest > _LONGEST_GAP or bad.mean() > _MOST_FILLED:
        said.append(
            f"{place.name} is left out: up to {longest:.3g} s of its samples are missing together"
        )
        return None
    said.append(f"{place.name}: {int(bad.sum())} missing samples are interpolated")
    turned = place.angle.copy()
    turned[~bad] = np.unwrap(place.angle[~bad])
    return _each(replace(place, angle=turned), lambda x: np.interp(times, times[~bad], x[~bad]))


def _unwrapped(place: Site) -> Site:
    good = np.isfinite(place.angle)
    angle = place.angle.copy()
    angle[good] = np.unwrap(angle[good])
    return replace(place, angle=angle)


def _thinned(label: str, times: Numbers, places: list[Site], said: list[str]) -> Measurements:
    step = float(times[1] - times[0])
    factor = int(1 / (RATE * step) + 1e-6)
    if factor > 1:
        from scipy.signal import firwin  # noqa: PLC0415 - slow to import

        weights = firwin(10 * factor + 1, 0.8 / factor)
        half = len(weights) // 2
        if len(times) <= 4 * half:
            raise InputError(
                f"{label}: {times[-1] - times[0]:.3g} s are too short a record to find an oscillation in"
            )

        def smooth(values: Numbers) -> Numbers:
            """Filtered around the straight line through its ends, so that angles may run away."""
            level = np.linspace(values[0], values[-1], len(values))
            kept = np.convolve(values - level, weights, mode="valid") + level[half:-half]
            return np.asarray(kept[::factor], dtype=np.float64)

        places, times = [_each(place, smooth) for place in places], times[half:-half][::factor]
    return Measurements(label, times, tuple(places), tuple(dict.fromkeys(said)))
