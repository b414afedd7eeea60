"""Comparison of what a certificate says with what comes out again."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.signatures.checking import SignatureSeen, State
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.request import CertificationRequest

TOLERANCE = 1e-5
"""Largest difference of a recomputed eigenvalue relative to its size, and of a signal relative to its range. Different
processors round differently."""

TOLERANCE_IDENTIFIED = 1e-3
"""Largest relative difference of an eigenvalue if the system contains an identified model, whose fit amplifies
rounding."""

THIS = version("gfor-cosim")
Content = Mapping[str, Any]
# faults, or otherwise sentences on what agrees, one of both empty
Compared = Iterator[tuple[str, str]]


@dataclass(repr=False)
class Verification(NoTruth, ask=".holds"):
    """The findings on a certificate. `verify` makes it.

    Attributes
    ----------
    faults
        Sentences on what does not agree.
    agreed
        Sentences on what agrees.
    views
        Sentences on pages that show the certificate and could not be made anew here, so that they prove nothing.
    unproved
        Sentences on all that lies there and that nothing vouches for: those pages, and files that it does not cover.
    signatures
        The signature of each certificate by its folder's name, with ``state`` (``good``, ``unsigned``, ``changed`` or
        ``unknown signer``), ``signer`` (None where nobody known signed), ``sentence``, and ``signatures``, the same of
        each of several keys.
    """

    faults: list[str] = field(default_factory=list)
    agreed: list[str] = field(default_factory=list)
    views: list[str] = field(default_factory=list)
    unproved: list[str] = field(default_factory=list)
    signatures: dict[str, SignatureSeen] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        return not self.faults

    @property
    def signature(self) -> SignatureSeen:
        """The signature; of several certificates in an FMU that of the least worth."""
        return min(self.signatures.values(), key=lambda one: _LEAST_WORTH.index(one.state))

    def _repr_html_(self) -> str:
        signed = [str(one.sentence) for one in self.signatures.values()]
        lines = [*self.faults, *self.unproved, *signed, *self.agreed]
        return page("Verification", lines, verdict=headline(self._verdict, self.holds))

    def __repr__(self) -> str:
        return f"<Verification: {self._verdict}>"

    @property
    def _verdict(self) -> str:
        what = "; ".join(self.faults) if self.faults else f"{len(self.agreed)} things agree"
        return f"{'holds' if self.holds else 'does not hold'}: {what}"


_LEAST_WORTH = (State.CHANGED, State.UNSIGNED, State.UNKNOWN, State.GOOD)


def issued_by(content: Content) -> str:
    """The version of this program that wrote a record; empty where it does not say."""
    return str(dict(content.get("environment") or {}).get("gfor-cosim", ""))


def request_of(folder: Path, content: Content, **of_the_norm: Any) -> CertificationRequest:
    binding = folder / BINDING if content["binding"] else None
    return CertificationRequest(folder / FMU, binding, content["values"], **of_the_norm)


def differ_signal(kept: Numbers, again: Numbers) -> tuple[str, str]:
    if kept.shape != again.shape:
        return f"{len(again)} instants come out and {len(kept)} were certified", ""
    span = float(np.ptp(kept)) or 1.0
    worst = float(np.abs(kept - again).max(initial=0.0)) / span
    if not worst <= TOLERANCE:
        return f"it differs by up to {worst:.1e} of its range; {TOLERANCE:g} is allowed", ""
    return "", said_of(worst, TOLERANCE)


def said_of(difference: float, tolerance: float) -> str:
    if difference == 0.0:
        return "the same to the last digit"
    return f"the digits differ, by {difference:.1e} at most; {tolerance:g} is allowed"


WRITTEN_LAST = ("made", "files", "seal")

# another version has others
WORDS = frozenset(("norm", "title", "clause", "source", "date", "readings"))
TAKEN = frozenset(
    ("tool", "environment", "details", "parameters", "file", "binding", "again", "reason")
)
"""Entries that cannot be had anew; beside those that are written last."""

_SAME = 1e-9  # largest relative difference of a figure that is computed again
_SAME_IN_SIGNAL = 1e-5  # the same of a mode that is found in a signal

_NOTHING = "no such entry"
_SHOWN = 200  # characters of a value that are shown


def faults_of(stated: Mapping[str, Any], again: Mapping[str, Any]) -> Iterator[str]:
    """Sentences on what is stated and does not come out; rows are compared by their names."""
    taken = TAKEN if of_one_program(stated, again) else TAKEN | WORDS
    rows = "points" if "points" in again else "rows"
    whole = [
        {k: v for k, v in c.items() if k not in (rows, *WRITTEN_LAST)} for c in (stated, again)
    ]
    for place, text in differences(whole[0], whole[1], taken):
        yield f"{place!r} {text}"
    named = [{_name(row): row for row in content[rows]} for content in (stated, again)]
    listed = [_name(row) for row in stated[rows]]
    lost = [name for name in listed if name not in named[1]]
    fresh = [name for name in named[1] if name not in named[0]]
    double = [name for k, name in enumerate(listed) if name in listed[:k]]
    compared = (
        ("rows of the record that do not come out anew", lost),
        ("rows that come out anew that the record has not", fresh),
        ("rows that the record has twice", double),
    )
    yield from (f"{what}: {', '.join(dict.fromkeys(names))}" for what, names in compared if names)
    for name in (name for name in named[0] if name in named[1]):
        for place, text in differences(named[0][name], named[1][name], taken):
            yield f"{name}: its response and figures come to other findings: {place!r} {text}"


def _name(row: Mapping[str, Any]) -> str:
    return f"row {row['row']}" if "row" in row else f"X_L = {row['X_L']:g} pu"


def of_one_program(*records: Content) -> bool:
    one, other = (
        [(r.get("environment") or {}).get(key) for key in ("gfor-cosim", "Commit")] for r in records
    )
    return one == other and None not in one


def differences(
    stated: Any, again: Any, taken: frozenset[str], tolerance: float = _SAME
) -> Iterator[tuple[str, str]]:
    if isinstance(stated, dict) and isinstance(again, dict):
        keys = [k for k in (*again, *stated) if not (k in taken and k in again)]
        pairs = {k: (stated.get(k, _NOTHING), again.get(k, _NOTHING)) for k in keys}
    elif isinstance(stated, list) and isinstance(again, list) and len(stated) == len(again):
        pairs = {str(k): pair for k, pair in enumerate(zip(stated, again, strict=True))}
    else:
        if not _same(stated, again, tolerance):
            yield "", f"is {_text(stated)}, and {_text(again)} comes out"
        return
    for key, pair in pairs.items():
        for place, text in differences(
            *pair, taken, _SAME_IN_SIGNAL if key == "modal" else tolerance
        ):
            yield f"{key}.{place}" if place else key, text


def _same(stated: Any, again: Any, tolerance: float) -> bool:
    if {type(stated), type(again)} <= {int, float}:
        return math.isclose(stated, again, rel_tol=tolerance, abs_tol=1e-12)
    return bool(stated == again) and type(stated) is type(again)


def _text(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
