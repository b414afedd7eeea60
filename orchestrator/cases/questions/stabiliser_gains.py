"""Stabilisers whose gain carries the least change of their signal to their limit.

Their modes are right for changes below that alone: beyond it a stabiliser jumps between its limits."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from numpy.polynomial.polynomial import polymul, polyval

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_values import place_of, value_of
from orchestrator.core.options import Option
from orchestrator.systems.coupling.system import ComponentPlan

_LEAST_JUMP = 5e-5
"""Jump of the signal [pu] below which a limit that acts is asked about: 3 mHz of the speed at 60 Hz, by which loads
move it at any time, and little more than the changes that modes are computed with."""

_SWING = 2 * math.pi  # of 1 Hz, at which the gain is told as well [rad/s]
_FAST = 1e9  # as fast as a jump: beyond all time constants [rad/s]
_NO_GAIN = 1e-12  # least gain, with which no limit is reached
_TOLD = 1.5  # least gain of a stage that is told
_PARAMETERS = ("K_S", *(f"T_{k}" for k in range(1, 7)), *(f"A_{k}" for k in range(1, 7)))
_LEADS = (("T_1", "T_2"), ("T_3", "T_4"))
_LIMITS = ("pss.V_STMAX", "pss.V_STMIN")
_SIGNALS = {1: "speed", 2: "frequency", 3: "electrical power", 4: "accelerating power"}
"""What most stabilisers take, by their parameter ``signal``."""


class _Stage(NamedTuple):
    """A factor of a transfer function: its name, and coefficients of rising powers of s."""

    name: str
    above: tuple[float, ...]
    below: tuple[float, ...]

    def gain(self, omega: float) -> float:
        """Return the magnitude at a frequency [rad/s]."""
        return float(abs(polyval(1j * omega, self.above) / polyval(1j * omega, self.below)))


def stabiliser_doubts(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about each stabiliser that reaches its limit at a jump below `_LEAST_JUMP`, and tell what makes its gain."""
    for name, plan in draft.system.components.items():
        stages = _stages(plan)
        if not stages:
            continue
        limit = abs(value_of(plan, _nearest_limit(plan)) or 0.0)
        jump, swing = (
            limit / max(math.prod(stage.gain(omega) for stage in stages), _NO_GAIN)
            for omega in (_FAST, _SWING)
        )
        if 0 < jump < _LEAST_JUMP:
            yield _doubt(draft, name, stages, jump, swing)


def _nearest_limit(plan: ComponentPlan) -> str:
    return min(_LIMITS, key=lambda limit: abs(value_of(plan, limit) or 0.0))


def _stages(plan: ComponentPlan) -> list[_Stage]:
    """Return the factors of PSS1A or IEEEST; none of another stabiliser, or of one that is off."""
    if plan.kind != "machine" or value_of(plan, "pss.A_2") is None or not plan.value("pss.enabled"):
        return []
    K_S, T_1, T_2, T_3, T_4, T_5, T_6, A_1, A_2, A_3, A_4, A_5, A_6 = (
        value_of(plan, f"pss.{name}") or 0.0 for name in _PARAMETERS
    )
    lags = tuple(polymul((1.0, A_1, A_2), (1.0, A_3, A_4)).tolist())
    is_ieeest = "pss.A_6" in plan.description.variables
    return [
        _Stage("K_S", (K_S,), (1.0,)),
        _Stage("leads of the filter", (1.0, A_5, A_6), lags),
        _Stage("T_1/T_2", (1.0, T_1), (1.0, T_2)),
        _Stage("T_3/T_4", (1.0, T_3), (1.0, T_4)),
        _Stage("T_5/T_6", (0.0, T_5), (1.0, T_6 if is_ieeest else T_5)),
        _Stage("T_6", (1.0,), (1.0, 0.0 if is_ieeest else T_6)),
    ]


def _doubt(
    draft: Draft, name: str, stages: Sequence[_Stage], jump: float, swing: float
) -> UnusualValue:
    """Return the question about a stabiliser, whose limit a jump and a swing of 1 Hz reach [pu]."""
    plan = draft.system.components[name]
    gains = {stage.name: stage.gain(_FAST) for stage in stages}
    largest = [f"{of} = {gain:.4g}" for of, gain in gains.items() if gain > _TOLD]
    signal = _SIGNALS.get(int(value_of(plan, "pss.signal") or 0.0), "signal")
    limit = _nearest_limit(plan)
    lead = max(_LEADS, key=lambda of: gains[f"{of[0]}/{of[1]}"])
    first, second = (f"pss.{one} = {value_of(plan, f'pss.{one}'):g} s" for one in lead)
    text = (
        f"the stabiliser multiplies a jump of the {signal} by {math.prod(gains.values()):.0f} ({', '.join(largest)}): "
        f"one of {jump:.2g} pu reaches the limit {limit} = {value_of(plan, limit):g} pu, and a swing of "
        f"1 Hz from {swing:.2g} pu on; the modes are those of smaller changes, and of larger ones lie towards those "
        "with "
        + Option.SET
        + f" {name}.pss.enabled=false; is the lead {first} over {second} right?"
    )
    place = place_of(draft, name, f"pss.{lead[0]}", limit)
    compared = (f"pss.{lead[1]}", "pss.K_S", limit)
    return UnusualValue(
        f"{name}.pss.{lead[0]}", place, text, "a stabiliser that the least change limits", compared
    )
