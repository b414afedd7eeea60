"""Libraries that few tests need are imported by these tests, and not by each worker that collects all."""

from typing import Any

from orchestrator.core.late import Late


class LateLibrary(Late):
    """As its base, but for names with an underscore, for which pytest asks all that stands in a file of tests."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return super().__getattr__(name)
