"""How to run the probe pair in a tool, and which schedule the tool runs, found from the results."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError
from orchestrator.simulation.interop.probe_result import (
    EXTRAPOLATIONS,
    SIGNALS,
    Candidate,
    ProbeResult,
    candidates,
)
from orchestrator.simulation.interop.rules import MASTERS, MasterRules

STEP_SIZE = 0.1  # that the instructions ask for [s]
STOP_TIME = 2.0  # that the instructions ask for [s]

_LEAST_ROWS = 4
_ON_POINT = 1e-3  # how far a label may be from a communication point, in steps
_FITS = 1e-3
"""A schedule fits if it differs by less than this from the record. Two schedules differ by more within a few rows; the
signals are near 1."""


@dataclass(frozen=True)
class Identified:
    fits: tuple[Candidate, ...]  # every schedule that gives the recorded values; empty if none does
    nearest: Candidate
    difference: float
    rows: int  # how many rows were at communication points and so were compared
    last_row: int  # index of the last of them: it has the label ``last_row``·H
    # step_size, stop_time: step size and stop time with which the tool was run [s]
    step_size: float
    stop_time: float

    def answers(self, name: str) -> list[object]:
        """The values of one of the schedule's properties among all that fit."""
        return list(dict.fromkeys(getattr(fit, name) for fit in self.fits))

    @property
    def intervals(self) -> int:
        return round(self.stop_time / self.step_size)

    @property
    def steps(self) -> int | None:
        """How many steps were taken until the last row; None where the results do not show it."""
        (early, *others) = self.answers("early_label") or [None]
        return self.last_row + early if isinstance(early, int) and not others else None

    @property
    def masters(self) -> tuple[str, ...]:
        """Known masters with one of these schedules; only those that end at the same row, if there are any."""
        alike = [rules for rules in MASTERS.values() if any(_is(fit, rules) for fit in self.fits)]
        ending = [
            rules
            for rules in alike
            if rules.rows(self.step_size, self.stop_time) == self.last_row + 1
        ]
        return tuple(rules.name for rules in ending or alike)


PROPERTIES = tuple(field.name for field in fields(Candidate))


def identify(
    result: ProbeResult, step_size: float = STEP_SIZE, stop_time: float = STOP_TIME
) -> Identified:
    """Compare a result with every schedule.

    Raises an `InputError` if too few rows are at communication points, or the result shows that the steps had another
    size."""
    intervals = round(stop_time / step_size)
    if intervals < _LEAST_ROWS or abs(intervals * step_size - stop_time) > _ON_POINT * step_size:
        raise InputError(
            f"{stop_time:g} s are not a whole number of steps of {step_size:g} s, {_LEAST_ROWS} at least"
        )
    points = result.times / step_size
    on_point = np.abs(points - np.round(points)) <= _ON_POINT
    index = np.round(points).astype(int)
    known = on_point & (index >= 0) & (index <= intervals)
    if known.sum() < _LEAST_ROWS:
        raise InputError(
            f"only {known.sum()} of {len(points)} rows are at multiples of {step_size:g} s up to {stop_time:g} s; "
            "record at communication points, or say with --step and --stop how the tool was run"
        )
    _check_steps(result, step_size)
    differences = list(_differences(index[known], result.values[known], step_size, intervals))
    best, nearest = min(differences, key=lambda pair: pair[0])
    fits = tuple(c for d, c in differences if d <= max(10 * best, 1e-9)) if best <= _FITS else ()
    return Identified(
        fits,
        nearest,
        difference=best,
        rows=int(known.sum()),
        last_row=int(index[on_point].max()),
        step_size=step_size,
        stop_time=stop_time,
    )


def _differences(
    index: NDArray[np.int64], values: NDArray[np.float64], step_size: float, intervals: int
) -> Iterator[tuple[float, Candidate]]:
    """Largest difference from each schedule. Extrapolation is looked at only where nothing fits without it."""
    best = np.inf
    for extrapolation in EXTRAPOLATIONS:
        if extrapolation and best <= _FITS:
            return
        for candidate, rows in candidates(step_size, intervals, extrapolation):
            difference = float(np.nanmax(np.abs(rows[index] - values)))
            best = min(best, difference)
            yield difference, candidate


def _check_steps(result: ProbeResult, step_size: float) -> None:
    """The FMUs count the time that was stepped: it shows the true size of the steps."""
    for signal in ("a.stepped", "b.stepped"):
        stepped = result.values[:, SIGNALS.index(signal)]
        parts = stepped / step_size
        wrong = np.abs(parts - np.round(parts)) > _ON_POINT
        if wrong.any():
            raise InputError(
                f"{signal} is {stepped[wrong][0]:g} s in a row, no multiple of {step_size:g} s: the tool stepped with "
                "another communication step; set it there, or give the one it had with --step"
            )


def _is(fit: Candidate, rules: MasterRules) -> bool:
    in_turn = fit.order != "side by side"
    same = ("first_inputs", "extrapolation", "early_label", "after_exchange", "wire_by_wire")
    return in_turn == (rules.steps == "in turn") and all(
        getattr(fit, name) == getattr(rules, name) for name in same
    )


def instructions(step_size: float, stop_time: float, platforms: tuple[str, ...]) -> str:
    signals = ", ".join(f"`{signal}`" for signal in SIGNALS)
    usual = (step_size, stop_time) == (STEP_SIZE, STOP_TIME)
    options = "" if usual else f" --step {step_size:g} --stop {stop_time:g}"
    page = Path(__file__).with_name("instructions.txt").read_text(encoding="utf-8")
    return page.format(
        step=step_size,
        stop=stop_time,
        signals=signals,
        platforms=", ".join(platforms),
        options=options,
    )
