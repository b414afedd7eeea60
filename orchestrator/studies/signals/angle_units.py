"""Questions on angles whose stated unit their own values contradict: radians called degrees, and degrees radians."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from orchestrator.core.arrays import Numbers

if TYPE_CHECKING:
    import xarray as xr

_TURNS = {"rad": 2 * np.pi, "deg": 360.0}
"""A whole turn in each unit that an angle may be labelled with."""

_OTHER = {"rad": "deg", "deg": "rad"}  # the unit that is meant where the stated one is wrong
_WORDS = {"rad": "radians", "deg": "degrees"}
_MARGIN = 1.01  # of a turn: what is rounded, or a little beyond it
_NEAR = 0.05  # part of a turn by which a jump of a wrapped angle differs from it, with the motion of a sample
_END = 0.1  # part of a turn from either end of its range at which an angle is wrapped
_ALIKE = 0.9  # correlation from which on an angle moves as a frequency has it
_RATIO_MARGIN = 0.2
"""Part by which the ratio of the motions by angle and by frequency may differ from 180/π = 57.3, which a wrong unit
makes of it: far from 1, which the right unit gives."""

_FEWEST = 20  # samples that tell a correlation
_HERTZ = {"Hz": 1.0, "mHz": 1e-3}
_SPEEDS = ("omega", "speed", "w")
"""Last parts of names of speeds in pu."""

_NOMINAL = 55.0  # [Hz] between 50 and 60: either is within `_RATIO_MARGIN` of it


def doubtful_angles(dataset: xr.Dataset, signal: str | None = None) -> list[str]:
    """A question on each unit that angles are labelled with and contradict, with the first column that shows it.

    ``signal``: the only columns that are looked at, ``a.b`` or ``a.b - c.d``; None for all."""
    found: dict[str, str] = {}
    looked_at = None if signal is None else [part.strip() for part in signal.split(" - ")]
    for name in map(str, dataset.data_vars):
        if looked_at is not None and name not in looked_at:
            continue
        unit = str(dataset[name].attrs.get("units", "")).strip()
        if unit in _TURNS and unit not in found and (why := _contradiction(dataset, name, unit)):
            other = _OTHER[unit]
            found[unit] = (
                f"angles are labelled {unit}, and {name} {why}: are they in {_WORDS[other]}? "
                f"Write [{other}] behind the names"
            )
    return list(found.values())


def _contradiction(dataset: xr.Dataset, name: str, unit: str) -> str:
    """The motion of an angle that its unit cannot have; "" where nothing speaks against the unit."""
    values = np.asarray(dataset[name].values, dtype=np.float64)
    known = np.isfinite(values)
    seen = values[known]
    if len(seen) < 2:
        return ""
    if unit == "rad" and abs(seen[0]) > _TURNS["rad"] * _MARGIN:
        return f"begins with {abs(seen[0]):.4g}, more than a turn"
    turn = _TURNS[_OTHER[unit]]
    if _is_wrapped(seen, turn):
        return f"jumps by {turn:.4g} from one end of its range to the other"
    times = np.asarray(dataset["time"].values, dtype=np.float64)[known]
    for other, hertz in _frequencies(dataset, name):
        whole = np.unwrap(seen, period=turn)
        ratio = _ratio(times, whole / _TURNS[unit], hertz[known])
        expected = _TURNS[unit] / turn
        if ratio is not None and abs(ratio * expected - 1) < _RATIO_MARGIN:
            amount = "57.3 times as far as" if expected < 1 else "a 57.3rd of what"
            return f"moves {amount} {other} says"
    return ""


def _is_wrapped(values: Numbers, turn: float) -> bool:
    """Return whether an angle stays from 0 to a turn, or half a turn to both sides, and jumps from end to end."""
    steps = np.abs(np.diff(values))
    jumps = np.flatnonzero(np.abs(steps - turn) < _NEAR * turn)
    low, high = float(values.min()), float(values.max())
    begins = min(abs(low), abs(low + turn / 2))
    if not len(jumps) or high - low > _MARGIN * turn or begins > _END * turn:
        return False
    ends = np.minimum(values - low, high - values)
    return bool(np.all(ends[jumps] < _END * turn) and np.all(ends[jumps + 1] < _END * turn))


def _frequencies(dataset: xr.Dataset, angle: str) -> Iterator[tuple[str, Numbers]]:
    """Columns of a frequency or a speed, those of the angle's own place first [Hz]."""
    place = angle.rpartition(".")[0]
    scales = {}
    for name in map(str, dataset.data_vars):
        unit = str(dataset[name].attrs.get("units", "")).strip()
        is_speed = unit in ("pu", "1", "") and name.rpartition(".")[2].lower() in _SPEEDS
        scales[name] = _NOMINAL if is_speed else _HERTZ.get(unit, 0.0)
    names = [name for name, scale in scales.items() if scale]
    for name in sorted(names, key=lambda n: n.rpartition(".")[0] != place):
        yield name, scales[name] * np.asarray(dataset[name].values, dtype=np.float64)


def _ratio(times: Numbers, turns: Numbers, hertz: Numbers) -> float | None:
    """Motion of an angle [turns] for each turn that a frequency [Hz] has it move; None where it does not follow.

    Steady slopes are left out of both: an angle may be counted in a frame that turns."""
    if len(times) < _FEWEST or not np.all(np.isfinite(hertz)) or np.any(np.diff(times) <= 0):
        return None
    steps = np.diff(times) * (hertz[1:] + hertz[:-1]) / 2
    wanted = _without_slope(times, np.concatenate(([0.0], np.cumsum(steps - np.mean(steps)))))
    moved = _without_slope(times, turns)
    size = float(np.linalg.norm(wanted) * np.linalg.norm(moved))
    if not size or abs(float(wanted @ moved)) < _ALIKE * size:
        return None
    return abs(float(wanted @ moved)) / float(wanted @ wanted)


def _without_slope(times: Numbers, values: Numbers) -> Numbers:
    line = np.polynomial.Polynomial.fit(times, values, 1)
    return np.asarray(values - line(times), dtype=np.float64)
