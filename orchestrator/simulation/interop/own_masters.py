"""The masters whose choices we know: each was driven with the probe pair and with whole systems
(tests/simulation/interop)."""

import tomllib
from pathlib import Path

from orchestrator.simulation.interop.rules import MasterRules

_TEXT = Path(__file__).with_name("masters.toml").read_text(encoding="utf-8")

MASTERS = {name: MasterRules(name, **rules) for name, rules in tomllib.loads(_TEXT).items()}
