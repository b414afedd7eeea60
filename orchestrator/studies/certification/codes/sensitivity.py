"""How one parameter of the converter moves the margin of one criterion, from a run on either side of its value."""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestrator.studies.certification.codes.change_point import ChangedCriterion, ChangeResult
from orchestrator.studies.sensitivities.parameters import SHARE, Parameter

APART = 0.2
"""Upwards and downwards agree within this part of the larger slope. Those of a smooth margin ∝ 1/p differ by twice the
change."""

_ROUNDING = 1e-9  # margins that differ by less are the same
MOST = 0.5  # largest change that is tried to meet a criterion, in parts of the parameter
RESERVE = 1.1  # the straight line is followed this much further than to the limit


@dataclass(frozen=True)
class MarginSensitivity:
    parameter: Parameter
    margin: float | None
    # below, above: with the parameter lower and higher by the change; None where there is none.
    below: float | None = None
    above: float | None = None
    # d(margin)/d(parameter) for a relative change of 1 (of 1 unit where the parameter is 0); None without a figure on
    # either side.
    slope: float | None = None
    # whether the criterion is met below and above; None where it was not run.
    met: tuple[bool | None, bool | None] = (None, None)
    doubts: tuple[str, ...] = ()  # why the slope may not be followed; empty if it is trusted
    reason: str = ""
    idle: bool = False
    values: tuple[float, float] = (float("nan"), float("nan"))

    @property
    def values_that_meet(self) -> list[float]:
        return [value for value, met in zip(self.values, self.met, strict=True) if met]

    @property
    def per_percent(self) -> float | None:
        """Change of the margin for one percent of the parameter, of a hundredth of its unit where it is 0."""
        return None if self.slope is None else SHARE * self.slope

    @property
    def effect(self) -> float:
        return abs(self.slope or 0.0)

    def change_to_meet(self) -> float | None:
        """Where the straight line meets the limit, and `RESERVE` further, as a relative change of at most `MOST`.

        None where there is no trusted slope, or the declared bounds leave no room. It is a change to be tried: a
        straight line through two runs near each other promises nothing."""
        if self.margin is None or not self.slope or self.doubts:
            return None
        wanted = max(-MOST, min(MOST, -RESERVE * self.margin / self.slope))
        while not self.parameter.allows(wanted * self.parameter.scale):
            wanted /= 2
            if abs(wanted) < SHARE:
                return None
        return wanted


def sensitivity_of(
    parameter: Parameter,
    criterion: ChangedCriterion,
    mark: str,
    sides: Mapping[int, ChangeResult],
    change: float,
) -> MarginSensitivity:
    """The effect of one parameter, from the row as it is and as it is on either side.

    ``sides``: The changed rows by −1 and +1; a side that the declared bounds do not allow is missing.
    ``change``: Relative to `Parameter.scale`."""
    if not sides:
        return MarginSensitivity(
            parameter, criterion.margin, reason="its declared bounds leave no room on either side"
        )
    doubts, margins, met = [], {}, {}
    for sign, word in ((-1, "below"), (1, "above")):
        result = sides.get(sign)
        if result is None:
            doubts.append(f"{word}, its declared bound leaves no room")
        elif result.failure is not None:
            doubts.append(f"{word}, it is refused: {result.failure}")
        elif (
            again := next((c for c in result.criteria if c.criterion == criterion.criterion), None)
        ) is None:
            why = next((c.text for c in result.criteria if not c.accepted), "nothing was judged")
            doubts.append(f"{word}, {why}")
        else:
            met[sign] = again.accepted
            if again.margin is None and not again.accepted:
                doubts.append(f"{word}, {again.text}")
            elif again.margin is not None:
                margins[sign] = again.margin
            else:
                doubts.append(f"{word}, it is met without a figure")
    values = parameter.value - change * parameter.scale, parameter.value + change * parameter.scale
    sides_met = (met.get(-1), met.get(1))
    idle = len(sides) == 2 and all(result.mark == mark for result in sides.values())
    if criterion.margin is None or not margins:
        reason = "the criterion has no figure" if criterion.margin is None else "; ".join(doubts)
        return MarginSensitivity(
            parameter, criterion.margin, met=sides_met, reason=reason, idle=idle, values=values
        )
    slopes = {sign: sign * (margin - criterion.margin) / change for sign, margin in margins.items()}
    doubts += _of_slopes(slopes, _ROUNDING / change)
    if not any(slopes.values()):
        doubts.append(
            "no effect: the response is the same to the last bit"
            if idle
            else "no effect on this margin; the response does change"
        )
    slope = sum(slopes.values()) / len(slopes)
    below, above = margins.get(-1), margins.get(1)
    return MarginSensitivity(
        parameter,
        criterion.margin,
        below=below,
        above=above,
        slope=slope,
        met=sides_met,
        doubts=tuple(doubts),
        reason="",
        idle=idle,
        values=values,
    )


def _of_slopes(slopes: Mapping[int, float], rounding: float) -> list[str]:
    if len(slopes) < 2:
        return []
    down, up = slopes[-1], slopes[1]
    if abs(up - down) <= APART * max(abs(up), abs(down)) + rounding:
        return []
    shown = f"{100 * SHARE * up:+.3g} points per % upwards, {100 * SHARE * down:+.3g} downwards"
    return [f"not smooth: {shown}"]
