"""Figures of a design that are on the disk as soon as they are computed: the same design continues from there."""

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.points.key import key_of, scenario_content
from orchestrator.points.store import Arrays, PointStore


class KeptFigures:
    def __init__(self, store: PointStore | None = None, content: Mapping[str, Any] | None = None) -> None:
        self._store, self._content = store, dict(content or {})

    def get(self, what: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
        """The arrays of something, computed where they are not there yet."""
        if self._store is None:
            return compute()
        key = key_of({**self._content, **what}, "orchestrator.pod_design.design")
        found = self._store.load(key)
        if found is not None:
            return found[1]
        arrays = compute()
        self._store.save(key, {}, arrays)
        return arrays


def figures_of(prepared: PreparedScenario, store: PointStore | None) -> KeptFigures:
    groups = [list(group) for group in prepared.schedule.groups]
    content = {
        "design": prepared.case.text,
        **scenario_content(prepared),
        "step": prepared.step_size,
        "schedule": [prepared.schedule.name, *groups],
    }
    return KeptFigures(store, content)


def digest(*arrays: Any) -> str:
    """Hash of numbers."""
    hasher = hashlib.sha256()
    for array in arrays:
        hasher.update(array.tobytes())
    return hasher.hexdigest()
