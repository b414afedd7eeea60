"""Every fault that a check can find, by name, and what to do about it."""

import tomllib
from pathlib import Path

from orchestrator.binding import misfits

_OWN: dict[str, str] = tomllib.loads(Path(__file__).with_name("remedies.toml").read_text(encoding="utf-8"))

REMEDIES = _OWN | misfits.REMEDIES
