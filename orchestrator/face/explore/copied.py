"""Text that makes again what stands in the page: a command, a scenario of a case file, and Python."""

import shlex
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.form.values import flatten
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.output.results.staging import new_run_id

EXPLORED = "explored"  # name of the scenario that a state of the page becomes


def copied(
    file: CaseFile,
    word: str,
    scenario: str,
    values: Mapping[str, Value],
    frequencies: tuple[float, float],
    events: Sequence[Mapping[str, Any]] | None = None,
    places: Mapping[str, Sequence[float]] | None = None,
    step: float | None = None,
) -> dict[str, str]:
    """``command``, ``toml`` and ``python``; ``word`` is the case as it was given.

    ``events``: instead of the scenario's; they do not move the modes, and a command has none. ``places``: of buses in
    the diagram. ``step``: communication step [s]; None for the case's."""
    low, high = frequencies
    sets = [
        text
        for name, value in values.items()
        for text in ("--set", f"{name}={str(value).lower() if isinstance(value, bool) else value}")
    ]
    words = ["gfor", "modes", word, "--scenario", scenario, *sets, "--range", f"{low!r}:{high!r}"]
    words += [] if step is None else ["--step", f"{step!r} s"]
    case = f"gfor.load({word!r})"
    if events is not None:
        case += f".with_(scenarios={ {scenario: {'events': list(events)}}!r})"
    last = "" if step is None else f", step={step!r}"
    lines = [
        "import orchestrator as gfor",
        "",
        f"scenario = {case}.scenario({scenario!r}, {dict(values)!r}{last})",
        f"modes = scenario.modes(({low!r}, {high!r}))",
        "print(modes.stability.sentence())",
        "print(modes.table())",
    ]
    return {
        "command": shlex.join(words),
        "toml": ("" if step is None else f"# with --step '{step!r} s'\n")
        + tomli_w.dumps(explored(file, scenario, values, places)),
        "python": "\n".join(lines),
    }


def events_of(file: CaseFile, scenario: str) -> list[dict[str, Any]]:
    own = _as_written(file, scenario).get("events")
    return list(own if own is not None else _tables(file).get("events", []))


def saved(file: CaseFile, added: Mapping[str, Any], folder: Path) -> Path:
    """Write a copy of the case file with one scenario more, as `explored` gives it; the file as it is stays."""
    tables = _tables(file)
    if "name" not in tables:
        raise InputError(f"{file.path}: it is no TOML file, so that no scenario can be added")
    scenarios, places = (
        tables.setdefault("scenarios", {}),
        tables.get("diagram", {}).get("positions", {}),
    )
    if EXPLORED in scenarios:
        raise InputError(
            f"{file.path}: it has a scenario {EXPLORED!r} already; rename that one, then save again"
        )
    scenarios |= added["scenarios"]
    if "diagram" in added:
        tables["diagram"] = {"positions": places | added["diagram"]["positions"]}
    place = made_folder(folder) / f"{file.name}_{new_run_id()}.toml"
    write_text(place, tomli_w.dumps({**tables, "directory": str(file.directory.resolve())}))
    return place


def explored(
    file: CaseFile,
    scenario: str,
    values: Mapping[str, Value],
    places: Mapping[str, Sequence[float]] | None = None,
) -> dict[str, Any]:
    """Tables for a case file: a scenario of the case with further values, and places of buses."""
    table = _as_written(file, scenario)
    kept = {
        ".".join(path): value
        for path, value in flatten(table.get("set", {}))
        if ".".join(path) not in values
    }
    table["set"] = {**kept, **values}
    table["title"] = f"{table.get('title') or scenario}, explored"
    diagram = (
        {"diagram": {"positions": {bus: list(xy) for bus, xy in places.items()}}} if places else {}
    )
    return {"scenarios": {EXPLORED: table}, **diagram}


def _tables(file: CaseFile) -> dict[str, Any]:
    """Return the tables of a case file; of an SSP none but the events that it comes to."""
    try:
        return tomllib.loads(file.text)
    except tomllib.TOMLDecodeError:
        return {
            "events": [
                event.model_dump(mode="json", exclude_unset=True) for event in file.table.events
            ]
        }


def _as_written(file: CaseFile, scenario: str) -> dict[str, Any]:
    """A scenario's table; of an SSP what it comes to."""
    found = _tables(file).get("scenarios", {}).get(scenario)
    return (
        dict(found)
        if found is not None
        else file.scenarios[scenario].model_dump(mode="json", exclude_unset=True)
    )
