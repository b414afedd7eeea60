"""How far a parameter may go: the first value at which a scenario is unstable, or damped less than wanted.

The range is tried on a coarse grid first; between the last value that holds and the next one, the limit is bisected.
Every value is one of the coupled FMUs, perturbed at their own operating point."""

import fnmatch
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import takewhile
from typing import Any

import numpy as np

from orchestrator.core.bisection import halve_towards
from orchestrator.core.errors import ErrorKind, few
from orchestrator.core.options import Option
from orchestrator.core.units import whole_percent
from orchestrator.linear.spectra.modes import Mode, damping_percent, make_mode
from orchestrator.studies.sweep.point import PointRecord

COARSE = 9  # values of the coarse grid where none are asked for
HALVINGS = 8  # of the stretch between two values of the grid
_PARTS = 3  # components that are named where nothing swings against something
# the growing mode is one of those in the range where both differ by less than this part of its size
_SAME = 0.02
_NO_POINT = {ErrorKind.POWER_FLOW, ErrorKind.START, ErrorKind.STEADY_STATE, ErrorKind.ISLANDING}


class Ending(StrEnum):
    HOLDS = "holds"
    FAILS = "fails"
    NO_POINT = "no operating point"
    NOT_KNOWN = "not known"


@dataclass(frozen=True)
class Until:
    """A condition that must hold on: stability and, where ``damping`` [%] exceeds 0, as much of it in all modes of the
    range."""

    damping: float = 0.0

    @property
    def holding(self) -> str:
        return f"damped by {self.damping:g} % or more" if self.damping else "stable"

    @property
    def failing(self) -> str:
        return f"damped by less than {self.damping:g} %" if self.damping else "UNSTABLE"

    def kind(self, record: PointRecord) -> Ending:
        if record.failure is not None:
            return Ending.NO_POINT if record.failure.kind in _NO_POINT else Ending.NOT_KNOWN
        stable = record.stability.get("stable")
        least = least_damping(record)
        if stable is False or (self.damping and least is not None and least < self.damping):
            return Ending.FAILS
        return Ending.NOT_KNOWN if stable is None else Ending.HOLDS


def least_damping(record: PointRecord) -> float | None:
    """The least damping of the modes in the range [%]; None where there is none."""
    if record.modes is None or not len(record.modes.eigenvalues):
        return None
    return min(damping_percent(complex(value)) for value in record.modes.eigenvalues)


def search(
    kinds: Sequence[Ending], at: Callable[[float], Ending], between: Callable[[float, float], bool]
) -> tuple[float | None, float | None, list[int]]:
    """The first change along a grid, bisected: the last place that holds, the first that does not, and the places of
    the grid beyond that hold again.

    ``kinds``: At the places 0, 1, … of the coarse grid.
    ``at``: What another place comes to.
    ``between``: Whether there is a value between two places."""
    first = next((k for k, kind in enumerate(kinds) if kind is not Ending.HOLDS), None)
    if first is None:
        return float(len(kinds) - 1), None, []
    again = [k for k in range(first + 1, len(kinds)) if kinds[k] is Ending.HOLDS]
    if not first:
        return None, 0.0, again
    holds_at, beyond = halve_towards(
        float(first - 1),
        float(first),
        lambda place: at(place) is Ending.HOLDS,
        goes_on=between,
        most=HALVINGS,
    )
    return holds_at, beyond, again


@dataclass(frozen=True, repr=False)
class ParameterLimit:
    key: str
    unit: str
    scenario: str
    title: str
    until: Until
    # what ends the range: `Ending.FAILS` is a limit, anything else is none; `Ending.HOLDS` where nothing does.
    kind: Ending
    # holds_at, beyond: the last value that holds and the first that does not; None where there is none.
    holds_at: float | None
    beyond: float | None
    # mode, who: the mode behind it, and who takes part.
    mode: dict[str, Any] | None
    who: str
    # values of the coarse grid: what each comes to, least damping [%], largest growth rate [1/s].
    tried: tuple[dict[str, Any], ...]
    again: tuple[float, ...]  # values of it beyond the limit that hold again
    why: str  # the failure's text, or what the verdict is not known for
    worst_at: float  # where the least damped mode of the coarse grid is
    # the first value on the way with units beyond their rating that are within it at the start, and their names
    strained: tuple[float, tuple[str, ...]] | None = None

    @property
    def limit(self) -> float | None:
        """The last value that holds before the first that fails; None where nothing fails, or nothing is known."""
        return self.holds_at if self.kind is Ending.FAILS else None

    def __repr__(self) -> str:
        return f"<ParameterLimit of {self.scenario}: {'; '.join(self.lines)}>"

    @property
    def sentence(self) -> str:
        """The first limit on the way."""
        return self.lines[0]

    @property
    def lines(self) -> list[str]:
        """Every limit on the way, a line each, in the order in which they are met."""
        found = []
        if self.strained:
            value, units = self.strained
            verb = "is" if len(units) == 1 else "are"
            at = self._value(value)
            found.append(f"{', '.join(units)} {verb} beyond rating from {self.key} = {at} on")
        return [*found, *self._ending()]

    def _ending(self) -> list[str]:
        start, stop = (self._value(self.tried[k]["value"]) for k in (0, -1))
        mode = f": {self._mode(self.mode)}" if self.mode else ""
        why = f": {' '.join(self.why.split())}" if self.why else ""
        at, holding = self._value(self.beyond), self.until.holding
        if self.kind is Ending.HOLDS:
            worst = f"; least damped at {self._value(self.worst_at)}{mode}"
            return [f"{holding} over the whole range, {self.key} from {start} to {stop}{worst}"]
        what = self.until.failing if self.kind is Ending.FAILS else str(self.kind)
        if self.holds_at is None:
            at_start = f"{what} already at the start, {self.key} = {at}{self._later()}"
            return [f"{at_start}{mode}{why}{self._nowhere()}"]
        falls = self.tried[-1]["value"] < self.tried[0]["value"]
        direction = "down to" if falls else "up to"
        up_to = f"{holding} {direction} {self.key} = {self._value(self.holds_at)}{self._dip()}"
        if self.kind is Ending.FAILS:
            return [f"{up_to}, {what} at {at}{self._again()}{mode}"]
        no_limit = "where stability is not judged (it is no limit of stability)"
        return [
            f"{what} from {self.key} = {at} on, {no_limit}{why}",
            f"{up_to}{self._again()}",
        ]

    def _dip(self) -> str:
        """The least damping on the way, where it is less than at both ends."""
        held = [
            x
            for x in takewhile(lambda x: x["kind"] == str(Ending.HOLDS), self.tried)
            if x["damping_percent"]
        ]
        least = min(held, key=lambda x: x["damping_percent"], default=None)
        if least is None or least is held[0] or least is held[-1]:
            return ""
        return f" (on the way {least['damping_percent']:.2f} % at {self._value(least['value'])})"

    def _again(self) -> str:
        return self._in_pieces(f"again at {self._places_again}") if self.again else ""

    def _later(self) -> str:
        """Where a range that does not hold at its start holds."""
        if not self.again:
            return ""
        values = [x["value"] for x in self.tried]
        first = values.index(self.again[0])
        between = " and ".join(self._value(values[k]) for k in (first - 1, first))
        return self._in_pieces(f"at {self._places_again}, first reached between {between}")

    def _in_pieces(self, where: str) -> str:
        return f" ({self.until.holding} {where}: the range is not of one piece)"

    @property
    def _places_again(self) -> str:
        return few(map(self._value, self.again), 2)

    def _nowhere(self) -> str:
        """Tell that no value of the grid holds, if all of them are known to fail."""
        fails = all(x["kind"] == str(Ending.FAILS) for x in self.tried)
        return f"; and nowhere in the range {self.until.holding}" if fails else ""

    @property
    def remarks(self) -> list[str]:
        return [
            f"{self.title}: {len(self.tried)} values were tried before the bisection; a narrower range between two of "
            "them that does not hold would not be seen: COUNT in " + Option.VARY + " tries more"
        ]

    def _value(self, value: float | None) -> str:
        return f"{value:.5g} {self.unit}".rstrip() if value is not None else "–"

    def _mode(self, mode: dict[str, Any]) -> str:
        named, hertz = f"{mode['name']!r}, " if mode["name"] else "", mode["frequency_hz"]
        where = (
            f"{hertz:.3f} Hz, {mode['damping_percent']:.2f} %"
            if hertz
            else f"{mode['real']:+.3g} 1/s, no swing"
        )
        return f"{named}{where} ({self.who})"

    def as_json(self) -> dict[str, Any]:
        return {
            "scenario": self.scenario,
            "parameter": self.key,
            "unit": self.unit,
            "until": f"{self.until.damping:g} %" if self.until.damping else "unstable",
            "limit": self.limit,
            "reason": None if self.limit is not None else "; ".join(self.lines),
            "holds_at": self.holds_at,
            "beyond": self.beyond,
            "ends_with": str(self.kind),
            "mode": self.mode,
            "beyond_rating": self.strained
            and {"value": self.strained[0], "units": self.strained[1]},
            "why": self.why,
            "holds_again_at": list(self.again),
            "tried": list(self.tried),
            "sentence": self.sentence,
            "lines": self.lines,
        }


def mode_behind(record: PointRecord, speeds: Sequence[str]) -> tuple[dict[str, Any] | None, str]:
    """The mode that decides on a point, and who takes part in it.

    Of an unstable point this is the one that grows fastest, at any frequency; else the least damped one of the range.
    """
    modes, verdict = record.modes, record.stability
    grows = verdict.get("stable") is False
    if modes is None or not (grows or len(modes.eigenvalues)):
        return None, ""
    if grows:
        value = complex(verdict["largest_growth_rate"], 2 * np.pi * verdict["frequency_hz"])
        # the step map may be stable where the system is not
        near = np.abs(modes.eigenvalues - value)
        place = int(near.argmin()) if len(near) and near.min() <= _SAME * abs(value) else None
    else:
        place = min(
            range(len(modes.eigenvalues)),
            key=lambda k: damping_percent(complex(modes.eigenvalues[k])),
        )
        value = complex(modes.eigenvalues[place])
    if place is None:  # outside of the range: the verdict knows the states
        shares: dict[str, float] = {}
        for entry in verdict["participation"]:
            component = entry["state"].partition(".")[0]
            shares[component] = shares.get(component, 0.0) + entry["factor"]
        return _mode_json("", value, shares), ", ".join(
            e["state"] for e in verdict["participation"][:_PARTS]
        )
    mode = make_mode(value, modes.left[place], modes.right[place], modes.names)
    name = next((name for name, k in record.named.items() if k == place), "")
    return _mode_json(name, value, mode.by_component), _who(mode, speeds)


def _mode_json(name: str, value: complex, components: dict[str, float]) -> dict[str, Any]:
    return {
        "name": name,
        "frequency_hz": value.imag / (2 * np.pi),
        "damping_percent": damping_percent(value),
        "real": value.real,
        "imag": value.imag,
        "components": {
            component: share for component, share in components.items() if share >= 0.01
        },
    }


def _who(mode: Mode, speeds: Sequence[str]) -> str:
    states = [
        name for name in mode.shape if any(fnmatch.fnmatchcase(name, pattern) for pattern in speeds)
    ]
    said = mode.swing_groups(states).words(", ".join)
    if mode.participation_of(states) >= 0.1 and said:
        return said
    return ", ".join(
        f"{name} {whole_percent(share)}" for name, share in list(mode.by_component.items())[:_PARTS]
    )
