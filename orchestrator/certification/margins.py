"""How far a certificate's criteria are from their limits: the same figure for the norm and for every code."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from orchestrator.analysis.modes import damping_ratio
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row import RowFinding
from orchestrator.certification.criteria import LEAST_DAMPING
from orchestrator.certification.judgement import PointVerdict, TimeVerdict
from orchestrator.certification.study import Certification
from orchestrator.certification.swings import LARGEST_RATIO

MOST = 10.0
"""Largest margin that is shown in parts of its limit."""


@dataclass(frozen=True, slots=True)
class CriterionMargin:
    """A criterion at one place of a test.

    Attributes
    ----------
    place
        The row, or the reactance.
    margin
        How far the figure is on the good side of its limit, in parts of the limit (negative: on the bad side); None
        where the criterion has no figure, as with a loss of synchronism.
    """

    place: str
    criterion: str
    margin: float | None
    accepted: bool
    text: str


Margin = TypeVar("Margin", CriterionMargin, RowFinding)


def margins_of(certificate: Certification | CodeCertificate) -> list[CriterionMargin]:
    """All criteria that count towards the verdict."""
    if isinstance(certificate, CodeCertificate):
        return [
            CriterionMargin(v.row.name, f.criterion, f.margin, f.accepted, f.text)
            for v in certificate.verdicts if v.judged for f in v.findings if f.accepted is not None
        ]  # fmt: skip
    return [margin for v in certificate.verdicts if v.judged for margin in _of_point(v)]


def narrowest(margins: Sequence[Margin]) -> Margin | None:
    """The criterion with the least margin; None where none has a figure."""
    known = [m for m in margins if m.margin is not None]
    return min(known, key=lambda m: m.margin or 0.0, default=None)


def _of_point(v: PointVerdict) -> Iterator[CriterionMargin]:
    """Every mode that the norm asks 5 % of, the response, and whatever else the point is not accepted for."""
    place = f"X_L = {v.X_L:g} pu"
    explained = False
    for mode in v.modes:
        margin = damping_ratio(mode.eigenvalue) / LEAST_DAMPING - 1
        explained |= not mode.accepted
        if margin >= 0 or not mode.accepted:  # below 5 % and accepted: it was below without the converter
            yield CriterionMargin(place, f"damping at {mode.frequency_hz:.3f} Hz", margin, mode.accepted, mode.reason)
    if v.time is not None:
        explained |= not v.time.accepted
        reasons = f"{v.time.swings.reason}; {v.time.modal.reason}"
        yield CriterionMargin(place, "response", _of_response(v.time), v.time.accepted, reasons)
    if v.faults and not explained:
        yield CriterionMargin(place, "stable", None, False, "; ".join(v.faults))


def _of_response(time: TimeVerdict) -> float | None:
    """The better of the two ways, since either is enough; None where the better one has no figure."""
    ways: list[tuple[bool, float | None]] = []
    ratio = time.swings.ratio
    ways.append((time.swings.accepted, None if ratio is None else 1 - abs(ratio) / LARGEST_RATIO))
    least = min((m.damping_percent for m in time.modal.modes), default=None)
    ways.append((time.modal.accepted, None if least is None else least / (100 * LEAST_DAMPING) - 1))
    if any(accepted and margin is None for accepted, margin in ways):
        return None
    return max((margin for accepted, margin in ways if margin is not None and accepted == time.accepted), default=None)


def margin_of(finding: RowFinding) -> str:
    """A criterion's margin in words; its text begins with the value and the unit of both."""
    unit = re.match(r"[-+.\de]+ (pu|Hz|s)\b", finding.text)
    return margin_text(finding.margin, finding.limit, finding.value, unit[1] if unit else "")


def margin_text(margin: float | None, limit: float | None = None, value: float | None = None, unit: str = "") -> str:
    """A margin in percent of its limit; a dash where there is none.

    Beyond `MOST` the limit is next to nothing, and the distance from it says more: in the quantity's own unit where
    that is given.
    """
    if margin is None:
        return "–"
    if abs(margin) > MOST:
        known = limit is not None and value is not None
        good = "+" if margin > 0 else "−"
        away = f"{abs((value or 0.0) - (limit or 0.0)):.3g} {unit or 'in its unit'}"
        return good + (away if known else f"> {MOST:.0f} times")
    return f"{100 * margin:+.3g} %".replace("-", "−")
