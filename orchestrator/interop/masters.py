"""Masters whose schedules are known: each was driven with the probe pair and with whole systems (tests/interop)."""

import tomllib
from pathlib import Path

from orchestrator.errors import InputError
from orchestrator.interop.rules import MasterRules

MASTERS = {
    name: MasterRules(name, **rules)
    for name, rules in tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")).items()
}


def master_rules(name: str) -> MasterRules:
    if name not in MASTERS:
        raise InputError(f"there is no master {name!r} to run like; known are: {', '.join(MASTERS)}")
    return MASTERS[name]
