"""What the converter survives with each of its current limits: `.docs/validation/current-limits.md`.

    python -m tests.benchmarks.limiters              prints the tables (about five minutes)
    python -m tests.benchmarks.limiters informed     prints only the limiters whose names contain the word

A dip takes the source's voltage to a part of its own for some time. The critical clearing time is the longest after
which the converter comes back to its old angle, without a slipped pole. A jump turns the source; forwards is ahead.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tests.support.converter_at_grid import AtGrid, Response

KIND, ANGLE = "current_limit.kind", "current_limit.angle"
PODS = {"pod_p.enabled": 1.0, "pod_q.enabled": 1.0}

LIMITERS: dict[str, dict[str, float]] = {
    "box": {KIND: 0},
    "circular, 0°": {KIND: 1, ANGLE: 0.0},
    "circular, 45°": {KIND: 1},
    "threshold, X/R = 5": {KIND: 2, "current_limit.X_R": 5.0},
    "threshold, X/R = 1": {KIND: 2, "current_limit.X_R": 1.0},
    "informed, 45°": {KIND: 3},
    "informed, 45°, both PODs": {KIND: 3, **PODS},
}
"""Name → parameters."""

POWERS = (0.1, 0.5, 0.9)
"""P_0 [pu, S_n]."""

RATIOS = (20.0, 1.5)
"""Short-circuit ratios of the grid."""

DIPS = (0.02, 0.05, 0.1, 0.15, 0.25, 0.5, 1.0)
"""Durations of a dip that are tried [s]."""

JUMPS = (10, 20, 30, 45, 60, 90, 120, 150)
"""Jumps that are tried [°]; one beyond 180° is one the other way."""

_BEFORE, _AFTER = 0.02, 3.0
"""Time before the event and after it [s]."""


@dataclass(frozen=True)
class Row:
    """One limiter at one power and one grid.

    Attributes
    ----------
    peak, steady
        Largest current of the converter in a dip to 0.2, and that after 140 ms of it [pu, S_n].
    dip, short
        Critical clearing times at 0.2 of the source's voltage and at none [s].
    forwards, backwards
        Largest jumps that it survives, and all smaller ones [°].
    """

    limiter: str
    power: float
    ratio: float
    peak: float
    steady: float
    dip: float
    short: float
    forwards: float
    backwards: float

    def text(self) -> str:
        """As a line of the page's table."""

        cells = [
            self.limiter,
            f"{self.power:g}",
            f"{self.ratio:g}",
            f"{self.peak:.2f}",
            f"{self.steady:.2f}",
        ]
        cells += [
            f"≥ {most:g}" if most == tried[-1] else f"{most:g}"
            for most, tried in (
                (self.dip, DIPS),
                (self.short, DIPS),
                (self.forwards, JUMPS),
                (self.backwards, JUMPS),
            )
        ]
        return f"| {' | '.join(cells)} |"


def dip(
    grid: AtGrid, values: dict[str, float], left: float, seconds: float, after: float = _AFTER
) -> Response:
    """A dip to a part of the source's voltage."""
    return grid.run(
        values, [(_BEFORE, {}), (seconds, {"source.v": left}), (after, {"source.v": 1.0})]
    )


def jump(grid: AtGrid, values: dict[str, float], degrees: float) -> Response:
    """A jump of the source's angle."""
    return grid.run(values, [(_BEFORE, {}), (_AFTER, {"source.jump": np.deg2rad(degrees)})])


def critical_clearing_time(grid: AtGrid, values: dict[str, float], left: float) -> float:
    """Longest of `DIPS` that is survived together with all shorter ones [s]."""
    return _largest(DIPS, lambda seconds: dip(grid, values, left, seconds).keeps_synchronism)


def largest_jump(grid: AtGrid, values: dict[str, float], sign: int) -> float:
    """Largest of `JUMPS` that is survived together with all smaller ones [°]."""
    return _largest(JUMPS, lambda degrees: jump(grid, values, sign * degrees).keeps_synchronism)


def _largest(tried: Sequence[float], lasts: Callable[[float], bool]) -> float:
    """0 if the first does not last. A longer one than the first that is lost may come back by chance."""
    most = 0.0
    for value in tried:
        if not lasts(value):
            break
        most = value
    return most


def row(limiter: str, power: float, ratio: float) -> Row:
    """All figures of one limiter at one power and one grid."""
    grid, values = AtGrid(ratio), LIMITERS[limiter] | {"P_0": power}
    deep = dip(grid, values, 0.2, 0.15, after=0.3)["i_s"]
    at = round((_BEFORE + 0.14) / 1e-3)
    return Row(
        limiter,
        power,
        ratio,
        float(deep.max()),
        float(deep[at]),
        critical_clearing_time(grid, values, 0.2),
        critical_clearing_time(grid, values, 0.0),
        largest_jump(grid, values, 1),
        largest_jump(grid, values, -1),
    )


def rows(word: str = "") -> Iterator[Row]:
    """All rows of the limiters whose names contain a word."""
    for ratio in RATIOS:
        for power in POWERS:
            yield from (row(limiter, power, ratio) for limiter in LIMITERS if word in limiter)


def main(words: list[str]) -> None:
    print(
        "| Limit | P_0 | SCR | peak | in the dip | dip to 0.2 | dip to 0 | jump ahead | jump back |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for found in rows(*words):
        print(found.text(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
