"""The checks of a controller DLL by name, with the source of each rule; nothing that computes is imported here."""

import tomllib
from pathlib import Path
from typing import Any

_RULES: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("rules.toml").read_text(encoding="utf-8")
)
DLL_QUESTIONS: dict[str, str] = {name: row["question"] for name, row in _RULES["checks"].items()}
SOURCES: dict[str, str] = {name: row["source"] for name, row in _RULES["checks"].items()}
REMEDIES: dict[str, str] = _RULES["remedies"]
