"""Calls that every component whose FMU runs in another process passes on alike."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any


class RemoteCalls(ABC):
    """Calls of FMI that change an instance and return nothing; it holds no data."""

    @abstractmethod
    def _remote(self, call: str, command: str, *arguments: Any) -> Any:
        """Have something done in the other process."""

    def setup(self, start_time: float, stop_time: float | None) -> None:
        """Give the times of the experiment [s]."""
        self._remote("fmi2SetupExperiment", "setup", start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        self._remote("fmi2EnterInitializationMode", "enter_initialization_mode")

    def exit_initialization_mode(self) -> None:
        self._remote("fmi2ExitInitializationMode", "exit_initialization_mode")

    def reset(self) -> None:
        self._remote("fmi2Reset", "reset")

    def set(self, values: Mapping[str, float | bool]) -> None:
        if values:
            self._remote(f"setting {', '.join(values)}", "set", dict(values))
