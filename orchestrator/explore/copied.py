"""What stands in the page, as text that makes it again: a command, a scenario of a case file, and Python."""

import shlex
import tomllib
from collections.abc import Mapping
from typing import Any

import tomli_w

from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.schema import Value
from orchestrator.cases.values import flatten

EXPLORED = "explored"
"""Name of the scenario that a state of the page becomes."""


def copied(
    file: CaseFile, word: str, scenario: str, values: Mapping[str, Value], frequencies: tuple[float, float]
) -> dict[str, str]:
    """``command``, ``toml`` and ``python``; ``word`` is the case as it was given."""
    low, high = frequencies
    sets = [
        text
        for name, value in values.items()
        for text in ("--set", f"{name}={str(value).lower() if isinstance(value, bool) else value}")
    ]
    words = ["gfor", "modes", word, "--scenario", scenario, *sets, "--range", f"{low!r}:{high!r}"]
    lines = [
        "import orchestrator as gfor", "", f"scenario = gfor.load({word!r}).scenario({scenario!r}, {dict(values)!r})",
        f"modes = scenario.modes(({low!r}, {high!r}))", "print(modes.stability.sentence())", "print(modes.table())",
    ]  # fmt: skip
    return {"command": shlex.join(words), "toml": as_scenario(file, scenario, values), "python": "\n".join(lines)}


def as_scenario(file: CaseFile, scenario: str, values: Mapping[str, Value]) -> str:
    """A scenario of the case with further values, to be put at the end of its file."""
    try:
        table: dict[str, Any] = dict(tomllib.loads(file.text)["scenarios"][scenario])
    except (tomllib.TOMLDecodeError, KeyError):  # of an SSP: what it comes to
        table = file.scenarios[scenario].model_dump(mode="json", exclude_unset=True)
    kept = {".".join(path): value for path, value in flatten(table.get("set", {})) if ".".join(path) not in values}
    table["set"] = {**kept, **values}
    table["title"] = f"{table.get('title') or scenario}, explored"
    return tomli_w.dumps({"scenarios": {EXPLORED: table}})
