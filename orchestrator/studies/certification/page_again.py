"""The page of a certificate, made anew and compared as a document: what it hides or adds is seen."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.cases.case import load_case
from orchestrator.core.foreign_files import read_text
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.details import details_of
from orchestrator.studies.certification.environment import CODE, environment
from orchestrator.studies.certification.files import HTML, JSON, PDF, figures_hash
from orchestrator.studies.certification.form import NORM
from orchestrator.studies.certification.kinds import rebuilt
from orchestrator.studies.certification.report import page

if TYPE_CHECKING:
    import xarray as xr

_VIEW = "a view, not proved"
_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class PageSeen:
    """A page: what is wrong with it, or why it proves nothing; both empty where it is what comes out."""

    fault: str = ""
    unproved: str = ""


def look_at_page(folder: Path, content: dict[str, Any], data: xr.Dataset) -> PageSeen:
    """Make the page anew from the record, and compare it to the last character.

    Another version of this program has other words, and another machine rounds otherwise: then it is a view."""
    if content["format"] == NORM:
        return PageSeen(
            unproved=f"{HTML}: {_VIEW}: it shows shapes of modes, which the record does not keep"
        )
    stated = dict(content.get("environment") or {})
    if stated.get(CODE) != environment()[CODE] or "details" not in content:
        return PageSeen(unproved=f"{HTML}: {_VIEW}: {_other_program(stated)}")
    there = read_text(folder / HTML, errors="replace")
    again = _made_anew(folder, content, data)
    if there == again:
        return PageSeen()
    same_words = _NUMBER.sub("#", there) == _NUMBER.sub("#", again)
    if same_words and stated != environment():
        return PageSeen(
            unproved=f"{HTML}: {_VIEW}: made on another machine, and digits differ from what comes out here"
        )
    apart = (k for k, pair in enumerate(zip(there, again, strict=False)) if pair[0] != pair[1])
    place = next(apart, min(len(there), len(again)))
    shown = " ".join(there[max(place - 20, 0) : place + 40].split())
    return PageSeen(f"{HTML}: it is not the page that comes out of {JSON}; first at {shown!r}")


def _other_program(stated: Mapping[str, str]) -> str:
    """Say which program wrote a page, and why it is not the page that comes out here."""
    wrote, here = (_program(one) for one in (stated, environment()))
    return f"{wrote} wrote it, and {here} has other code, whose words and pictures may differ"


def _program(stated: Mapping[str, str]) -> str:
    version, commit = (str(stated.get(key, "")) for key in ("gfor-cosim", "Commit"))
    at = f" at commit {commit[:8]}" if re.match(r"[0-9a-f]{40}", commit) else ""
    return f"gfor-cosim {version}{at}" if version else "a version that it does not name"


def views_beside(content: Mapping[str, Any]) -> list[str]:
    """Name what shows the certificate and cannot be made anew."""
    return [f"{PDF}: {_VIEW}: print {HTML} to have it anew"] if PDF in content["files"] else []


def _made_anew(folder: Path, content: dict[str, Any], data: xr.Dataset) -> str:
    again = rebuilt(folder, content, data)
    again.values = load_case(again.case).prepare()[0].values
    again.details = details_of(content["details"])
    again.computed_on = content["environment"]
    again.names = {FMU: content["file"], BINDING: content["binding"] or ""}
    hashes = {name: of for name, of in content["files"].items() if name not in (HTML, PDF)}
    hashes[f"{JSON}, its figures"] = figures_hash(content)
    return page(again, hashes, datetime.fromisoformat(content["made"]))
