"""Where results come from: what a file or a folder says of itself, and of the command that made it."""

import json
import shlex
from collections.abc import Mapping
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from orchestrator.output.results.manifest import MANIFEST

_OUTPUTS = {"--out", "--html"}


def origin_of(source: Path) -> dict[str, Any]:
    """Return what a result says of itself; empty where that was of another run into the same folder."""
    folder = source if source.is_dir() else source.parent
    own = _content(source) if source.suffix == ".json" else {}
    match own.get("made"):
        case dict(said):
            return said
        case str(date):  # a certificate's
            made_by = own.get("environment", {})
            return {
                "date": date,
                "made_by": made_by,
                "sealed": own.get("files", {}),
                "code": made_by.get("Commit", ""),
                "command": f"gfor verify {folder}",
            }
    content = _content(folder / MANIFEST)
    listed = content.get("files", {}).get(source.name)
    return {} if listed and listed["run"] != content["run"] else content


def _content(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def given_in(origin: Mapping[str, Any]) -> str:
    """Return what a command was given: case, scenario, values, files; without where its results went."""
    words = shlex.split(origin.get("command", ""))
    shown = (word for before, word in pairwise(words) if before not in _OUTPUTS)
    kept = (word for word in shown if word.partition("=")[0] not in {*_OUTPUTS, "--json"})
    return shlex.join(["gfor", *kept]) if words else ""


def made_of(source: Path, origin: Mapping[str, Any]) -> list[str]:
    listed = origin.get("inputs", origin.get("sealed", {}))
    versions = origin.get("made_by", {}).get("gfor-cosim")
    inputs = ", ".join(f"{name} {str(of)[:8]}" for name, of in listed.items() if of)
    if "inputs" in origin and not inputs:
        inputs = "none: the case is built in"
    date = (
        origin.get("date")
        or f"{datetime.fromtimestamp(source.stat().st_mtime, UTC):%Y-%m-%d %H:%M} (the file's)"
    )
    figures = f"gfor-cosim {versions}" if versions else "", str(origin.get("code", ""))[:12], inputs
    return [
        str(source),
        date,
        *(text or "not recorded" for text in (*figures, origin.get("command"))),
    ]
