"""Trials with a device that do not run, such as another value of a parameter: each is noted with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from orchestrator.core.errors import CosimError, ErrorKind, FmuFileError, RunInterruptedError


@dataclass(frozen=True)
class RefusedTrial:
    """One that did not run; ``reason``: what the device, or the reader of the recording, said."""

    tried: str
    kind: ErrorKind
    reason: str

    @property
    def began(self) -> bool:
        """Return whether the device began at all: an operating point that it does not take is no trial of it."""
        return self.kind is not ErrorKind.INPUT

    def as_json(self) -> dict[str, Any]:
        return {"tried": self.tried, "kind": str(self.kind), "reason": self.reason}


@dataclass
class TrialLog:
    """The trials with a device that did not run, each once, in their order."""

    _by_name: dict[str, RefusedTrial] = field(default_factory=dict)

    @property
    def refused(self) -> tuple[RefusedTrial, ...]:
        return tuple(self._by_name.values())

    @contextmanager
    def trial(self, tried: str) -> Iterator[None]:
        """Go on behind ``with`` if the device does not run inside, and note why.

        A file that cannot be used ends every trial, and so does whoever interrupts; neither is passed over."""
        try:
            yield
        except (FmuFileError, RunInterruptedError):
            raise
        except CosimError as error:
            self.note(tried, error)

    def note(self, tried: str, error: CosimError) -> None:
        """Note what did not run; of several of one name the first."""
        self._by_name.setdefault(tried, RefusedTrial(tried, error.kind, str(error)))
