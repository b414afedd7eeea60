"""How far a certificate's criteria are from their limits: the same figure for the norm and for every code."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from orchestrator.studies.certification.codes.row import RowFinding

MOST = 10.0  # largest margin that is shown in parts of its limit


@dataclass(frozen=True, slots=True)
class CriterionMargin:
    place: str
    criterion: str
    # how far the figure is on the good side of its limit, in parts of the limit (negative: on the bad side); None where
    # the criterion has no figure, as with a loss of synchronism.
    margin: float | None
    accepted: bool
    text: str


Margin = TypeVar("Margin", CriterionMargin, RowFinding)


def narrowest(margins: Sequence[Margin]) -> Margin | None:
    known = [m for m in margins if m.margin is not None]
    return min(known, key=lambda m: m.margin or 0.0, default=None)


def margin_of(finding: RowFinding) -> str:
    """A criterion's margin in words."""
    return margin_text(finding.margin, finding.limit, finding.value, finding.unit)


def margin_text(
    margin: float | None, limit: float | None = None, value: float | None = None, unit: str = ""
) -> str:
    """A margin in percent of its limit; a dash where there is none.

    Beyond `MOST` the limit is next to nothing, and the distance from it says more: in the quantity's own unit where
    that is given."""
    if margin is None:
        return "–"
    if abs(margin) > MOST:
        known = limit is not None and value is not None
        good = "+" if margin > 0 else "−"
        away = f"{abs((value or 0.0) - (limit or 0.0)):.3g} {unit or 'in its unit'}"
        return good + (away if known else f"> {MOST:.0f} times")
    return f"{100 * margin:+.3g} %".replace("-", "−")
