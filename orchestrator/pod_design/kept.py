"""Figures of a design that are on the disk as soon as they are computed: the same design continues from there."""

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.points.key import key_of
from orchestrator.points.store import Arrays, PointStore
from orchestrator.points.task import StudyCase


class KeptFigures:
    def __init__(self, store: PointStore | None = None, mark: str = "") -> None:
        self._store, self._mark = store, mark

    def get(self, what: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
        if self._store is None:
            return compute()
        key = key_of({"design": self._mark, **what}, "orchestrator.pod_design.design")
        found = self._store.load(key)
        if found is not None:
            return found[1]
        arrays = compute()
        self._store.save(key, {}, arrays)
        return arrays


def figures_of(prepared: PreparedScenario, store: PointStore | None) -> KeptFigures:
    schedule = [prepared.schedule.name, *map(list, prepared.schedule.groups)]
    return KeptFigures(store, StudyCase.of(prepared, step_size=prepared.step_size, schedule=schedule).mark)


def digest(*arrays: Any) -> str:
    hasher = hashlib.sha256()
    for array in arrays:
        hasher.update(array.tobytes())
    return hasher.hexdigest()
