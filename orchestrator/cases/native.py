"""Which components run as native FMUs: `native = true` in a table, or `<component>.native` in a layer."""

import fnmatch

from orchestrator.cases.draft import Draft
from orchestrator.cases.schema import ComponentTable, Value

_KEY = "native"


def sets_native(key: str) -> bool:
    """Whether a key chooses the kind of a component's FMU; ``*.native`` chooses for all."""
    return key.partition(".")[2] == _KEY


def is_native(draft: Draft, name: str, table: ComponentTable) -> bool:
    """The kind of FMU that a component of the catalogue gets; the strongest layer decides."""
    chosen: Value = table.native
    for layer in draft.layers:
        for key, value in layer.values.items():
            if sets_native(key) and fnmatch.fnmatch(name, key.partition(".")[0]):
                if not isinstance(value, bool):
                    draft.note(layer.place(key), f"native = {value!r}; it must be true or false")
                    continue
                chosen = value
    return bool(chosen)
