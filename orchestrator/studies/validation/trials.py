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
    of_reading: bool = False  # of the recording, and no value of the device

    @property
    def matters(self) -> bool:
        """Return whether a search may have missed something by it.

        A reading of which the device does not take the operating point is refuted by that."""
        return self.kind is not ErrorKind.INPUT and not self.of_reading

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
    def trial(self, tried: str, *, of_reading: bool = False) -> Iterator[None]:
        """Go on behind ``with`` if the device does not run inside, and note why.

        A file that cannot be used ends every trial, and so does whoever interrupts; neither is passed over."""
        try:
            yield
        except (FmuFileError, RunInterruptedError):
            raise
        except CosimError as error:
            self.note(tried, error, of_reading=of_reading)

    def note(self, tried: str, error: CosimError, *, of_reading: bool = False) -> None:
        """Note what did not run; of several of one name the first."""
        self._by_name.setdefault(tried, RefusedTrial(tried, error.kind, str(error), of_reading))
