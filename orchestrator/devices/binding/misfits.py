"""Judgement of how a device and its binding fit together, by what it gives at an operating point: one verdict for every
command, in the same words."""

import tomllib
from cmath import phase
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import pi, sqrt
from pathlib import Path

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import BoundDescription

# deviation of the power from what was asked up to which signs and bases are right; losses are below
BALANCE = 0.02

NO_LIMIT = 3.3
"""Current [pu, S_n] over the last cycle of a disturbance that no converter with a current limit gives.

Semiconductors carry 1.0 to 1.5 times the rated current, 2 where they are overrated; ours, with limits of 1.1 in either
axis, gives up to 1.7 at the grid's side of its filter. More must be declared (`I_max` of the binding), but of machines.
"""

# deviation of omega at rest from 1 above which a device is made for another frequency
FREQUENCY_APART = 0.02
_HIGHEST = 400.0  # rated frequency of a device [Hz]
SLIGHT = 1e-3  # the same below which nothing is said
# how often a device is held again whose omega still moves, as a meter's does that begins elsewhere,
# or at 1
_HELD = 5

REMEDIES: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("remedies.toml").read_text(encoding="utf-8")
)
WRONG_FREQUENCY = "wrong rated frequency"
_OF_RATING = (
    "wrong base",
    "power not as asked",
    "above its current limit",
    "no current limit",
    "no steady state",
)


@dataclass(frozen=True)
class Misfit:
    """A fault, by its name among `REMEDIES`, and what shows it."""

    fault: str
    evidence: str
    figures: Mapping[str, float] = field(default_factory=dict)

    def sentence(self, name: str) -> str:
        return f"{name}: {self.fault}: {self.evidence}; {REMEDIES[self.fault]}"


def at_rest(hold: Callable[[], Numbers]) -> tuple[float, bool]:
    """The omega of a device that is held at a bus for a while, again and again, and whether it has settled."""
    late = float("nan")
    for _ in range(_HELD):
        omega = hold()
        tenth, half = max(1, len(omega) // 10), max(1, len(omega) // 2)
        middle, late = float(np.median(omega[:half][-tenth:])), float(np.median(omega[-tenth:]))
        if abs(late - 1) <= SLIGHT or abs(late - middle) <= 0.1 * abs(late - 1):
            return late, True
    return late, False


def likely_cause(described: FmuDescription, fault: str) -> str:
    """Return what of the binding's ratings brings a fault; "" where nothing does."""
    return (
        described.likely_cause()
        if fault in _OF_RATING and isinstance(described, BoundDescription)
        else ""
    )


def is_consequence(described: FmuDescription, fault: str, others: Iterable[str]) -> bool:
    """Return whether a fault follows from a wrong rating, which shows in another fault as well.

    Behind a wrong rating a device stands at a point that it was not made for, where its frequency is none to judge."""
    return fault == WRONG_FREQUENCY and any(likely_cause(described, other) for other in others)


def omega_seen(omega: float) -> str:
    return f"omega is {omega:.6g} at rest, in a network of its rated frequency"


def of_frequency(omega: float, f_n: float | None) -> Misfit | None:
    """By what it shows at rest [pu]; ``f_n`` is what is bound, where something is [Hz]."""
    if not abs(omega - 1) > FREQUENCY_APART:
        return None
    return made_for(omega_seen(omega), omega, f_n, {"omega": omega})


def made_for(says: str, part: float, f_n: float | None, figures: Mapping[str, float]) -> Misfit:
    """By the part [pu, ``f_n``] that shows of its own frequency."""
    if not f_n or part * f_n > _HIGHEST:
        return Misfit(WRONG_FREQUENCY, says, figures)
    says += f", so it is made for {part * f_n:.4g} Hz where {f_n:g} Hz is bound"
    return Misfit(WRONG_FREQUENCY, says, {**figures, "made_for_hz": part * f_n})


def of_power(asked: complex, found: complex) -> Misfit | None:
    """By the power at its start [pu, S_n]."""
    if abs(found - asked) <= BALANCE or abs(asked) <= BALANCE:
        return None
    fault = "power not as asked"
    says = ""
    for a, b in ((-1, 0), (0, 1), (0, -1)):
        if abs(a * asked + b * asked.conjugate() - found) <= BALANCE * abs(asked):
            fault, says = diagnosis("S", a, b, 0j, 0.0)
    ratio = found / asked
    if not says and known_ratio(abs(ratio)):
        fault, says = diagnosis("S", ratio, 0j, 0j, 0.0)
    return Misfit(fault, power_seen("at the start", asked, found) + (f": {says}" if says else ""))


def of_current(size: float, limit: float | None) -> Misfit | None:
    """By its current at rest, and the largest one that is declared [pu, S_n]."""
    if limit is None or size <= limit * (1 + BALANCE):
        return None
    return Misfit(
        "above its current limit", f"at rest {size:.3g} pu of its rating; {limit:g} pu is declared"
    )


def of_dip(size: float, limit: float, begin: float) -> Misfit:
    """By its current in a disturbance [pu, S_n], over a cycle, that begins to be above its limit at a time [s]."""
    seen = f"{size:.3g} pu of its rating over a cycle, from t = {begin:.4g} s; {limit:g} pu is declared"
    return Misfit("above its current limit", seen, {"mean": size, "declared": limit})


def power_seen(at: str, asked: complex, found: complex) -> str:
    return f"{at} S = {_text(found)} pu of the rating where {_text(asked)} is asked"


def diagnosis(of: str, a: complex, b: complex, c: complex, rest: float) -> tuple[str, str]:
    """Name of the fault, and what the fit x = a·x_0 + b·conj(x_0) + c of powers S or currents i says."""
    fit = f"{of} = ({a:.3g})·{of}_0 + ({b:.3g})·{of}_0* + ({c:.3g})"
    if rest > BALANCE or abs(c) > BALANCE:
        return "power not as asked", "it does not follow P_0 and Q_0" if abs(a) < BALANCE else fit
    if abs(a) <= BALANCE and abs(b) <= BALANCE:
        return "power not as asked", "there is no power at all"
    if min(abs(a), abs(b)) > BALANCE:
        return "wrong axes", f"{fit}, so its axes are scaled or signed differently"
    if abs(b) > abs(a):
        return (
            "wrong sign",
            f"{'the reactive power' if of == 'S' else 'one axis of the current'} is reversed: {fit}",
        )
    turn = phase(a) * 180 / pi
    if abs(abs(a) - 1) > BALANCE:
        turned = f", turned by {turn:.0f}°" if abs(turn) > 2 else ""
        turned = ", with the opposite sign" if abs(turn) > 178 else turned
        fit = f"the power is {abs(a):.4g} times what is asked{known_ratio(abs(a))}"
        return "wrong base", f"{fit}{turned}"
    if abs(turn) > 178:
        return "wrong sign", "the power has the opposite sign"
    if abs(turn) > 1:
        return "wrong frame", f"the current is turned by {-turn:.1f}°"
    return "power not as asked", fit


def known_ratio(ratio: float) -> str:
    """Return what a factor between powers stands for; "" where it is none of the usual ones."""
    names = {
        sqrt(3): "√3: phase for line-to-line",
        sqrt(2): "√2: peak for rms",
        1.5: "3/2: of peak phase quantities",
        3.0: "3: three phases for one",
        1000.0: "1000: kilo",
    }
    for value, text in names.items():
        for name, seen in ((text, value), (f"1/({text})", 1 / value)):
            if abs(ratio / seen - 1) < 0.01:
                return f" ({name})"
    return ""


def _text(power: complex) -> str:
    return f"{power.real:.4g}{power.imag:+.4g}j"
