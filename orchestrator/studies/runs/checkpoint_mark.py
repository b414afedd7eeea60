"""Ingredients of a run, item by item: a checkpoint is worth nothing to a run that is made of something else."""

import hashlib
import json
import os
import platform
import sys
import tomllib
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from fmus.toolchain.extras import installed_version
from orchestrator.cases.form.locate import place_in
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import few
from orchestrator.core.file_hashes import remembered_sha256
from orchestrator.output.results.origin import files_named
from orchestrator.studies.points.code import code_hash, library_versions
from orchestrator.studies.points.key import component_content

Keys = tuple[str, ...]

_CASE = "the case"
_EVENTS = "the events"
_KERNEL = "GFOR_COSIM_KERNEL"
_SHOWN = 4  # so many differences are named


def mark_of(prepared: PreparedScenario) -> dict[str, str]:
    """Everything that the values of a run depend on, by name."""
    groups = " | ".join(", ".join(group) for group in prepared.schedule.groups)
    tolerance = (
        ""
        if prepared.schedule.tolerance is None
        else f", tolerance {prepared.schedule.tolerance:g}"
    )
    found = {
        "gfor-cosim": installed_version("gfor-cosim"),
        **library_versions(),
        "the code of gfor-cosim": code_hash(),
        "machine": f"{sys.platform} {platform.machine()}",
        f"the environment variable {_KERNEL}": os.environ.get(_KERNEL, ""),
        _CASE: _digest(prepared.case.text),
        "the communication step": f"{prepared.step_size!r} s",
        "the stop time": f"{prepared.stop_time!r} s",
        "the schedule": f"{prepared.schedule.name}: {groups}{tolerance}",
        _EVENTS: "; ".join(map(str, prepared.events)),
        "the relays": "; ".join(map(str, prepared.relays)),
        "what is recorded": f"every {prepared.record_every} steps, "
        f"{'filtered' if prepared.record_filtered else 'as it is'}: {', '.join(prepared.record)}",
    }
    for name, plan in prepared.system.components.items():
        file, port = component_content(plan.description)
        # the name only: our own lie in a cache
        found[f"the FMU of {name!r} ({plan.description.path.name})"] = file
        found[f"the binding of {name!r}"] = port
        found[f"whether {name!r} runs in a process of its own"] = str(plan.isolated)
        found |= {f"the start value of {name}.{v}": repr(x) for v, x in plan.inputs.items()}
    found |= {
        f"the connection into {target}": str(plan) for target, plan in prepared.system.wires.items()
    }
    return found | {name: repr(value) for name, value in prepared.values.items()}


def computed(prepared: PreparedScenario) -> dict[str, str]:
    """When and from what a run was computed: date, hash of the code, and hashes of the case's text and of all files."""
    case, fmus = (
        prepared.case,
        {plan.description.path for plan in prepared.system.components.values()},
    )
    paths = files_named(case.text, case.directory) | {
        path.name: path for path in sorted(fmus) if path.is_file()
    }
    files = {name: remembered_sha256(path) for name, path in paths.items()}
    inputs = {case.path.name: hashlib.sha256(case.text.encode()).hexdigest(), **files}
    return {
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        "code": code_hash(),
        "inputs": json.dumps(inputs),
    }


@lru_cache(maxsize=4)
def _digest(text: str) -> str:
    return hashlib.sha256(json.dumps(_read(text), default=str).encode()).hexdigest()


def _read(text: str) -> Any:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):  # nothing that was run; a file that somebody damaged
        return text


def _entries(content: Any, keys: Keys = ()) -> Iterator[tuple[Keys, str]]:
    """Every value of a case by its keys, such as events, 0, time."""
    if isinstance(content, dict):
        for key, inner in content.items():
            yield from _entries(inner, (*keys, key))
    elif isinstance(content, list) and any(isinstance(inner, dict | list) for inner in content):
        for index, inner in enumerate(content):
            yield from _entries(inner, (*keys, str(index)))
    else:
        yield keys, json.dumps(content, default=str, ensure_ascii=False)


def differences(
    then: Mapping[str, str],
    now: Mapping[str, str],
    texts: tuple[str, str] | None = None,
    file: Path | None = None,
) -> str:
    """Return what is not as it was, in words; empty where all is."""
    found = sorted(_differences(then, now), key=lambda words: not words.startswith(f"{_CASE} "))
    if texts is not None and _digest(texts[0]) == then.get(_CASE) != now.get(_CASE):
        found = [
            *(_in_the_case(*texts, file) or [f"{_CASE} has its tables in another order"]),
            *found[1:],
        ]
    return few(found, _SHOWN, "; ")


def _in_the_case(was: str, is_now: str, file: Path | None) -> list[str]:
    """Return what differs between two texts of a case; a key that is there now with its line."""
    then, now = (dict(_entries(_read(text))) for text in (was, is_now))
    places = {
        keys: place_in(is_now if keys in now else "", keys) or "its text" for keys in (*then, *now)
    }
    name = _CASE if file is None else f"{_CASE} {file}"
    by_place = ({places[keys]: value for keys, value in entries.items()} for entries in (then, now))
    return [f"in {name}, {words}" for words in _differences(*by_place)]


def _differences(then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    for name in dict.fromkeys([*then, *now]):
        was, is_now = then.get(name), now.get(name)
        if was == is_now:
            continue
        if was is None or is_now is None:
            yield f"{name} {'is new' if was is None else 'is gone'}"
        elif max(len(was), len(is_now)) > 60:
            yield f"{name} {'have' if name == _EVENTS else 'has'} changed"
        else:
            then_verb, now_verb = ("were", "are") if name == _EVENTS else ("was", "is")
            yield f"{name} {then_verb} {was or 'not there'} and {now_verb} {is_now or 'not there'}"
