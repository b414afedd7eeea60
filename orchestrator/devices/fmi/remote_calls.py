"""Calls that every component whose FMU runs in another process passes on alike."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from orchestrator.devices.fmi.component import Derived, RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.messages import texts
from orchestrator.devices.fmi.refused_calls import check_log
from orchestrator.devices.sandbox import answer_forms
from orchestrator.devices.sandbox.mailbox import Mailbox

Form = TypeVar("Form")


class RemoteCalls(Derived, ABC):
    """Calls of FMI that need more than numbers."""

    name: str
    description: FmuDescription
    _box: Mailbox

    @abstractmethod
    def _remote(self, call: str, command: str, *arguments: Any) -> Any:
        """Have something done in the other process."""

    @abstractmethod
    def _typed(self, form: Callable[..., Form], answer: Any, *wanted: Any) -> Form:
        """An answer in the form that was asked for, or an error that says what is there instead."""

    def _texts(self, least: int = 0) -> list[str]:
        return texts(self._box.read_log(), least)

    def setup(self, start_time: float, stop_time: float | None) -> None:
        """Give the times of the experiment [s]."""
        self._remote("fmi2SetupExperiment", "setup", start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        self._remote("fmi2EnterInitializationMode", "enter_initialization_mode")

    def exit_initialization_mode(self) -> None:
        self._remote("fmi2ExitInitializationMode", "exit_initialization_mode")

    def progress_of_step(self) -> tuple[bool, float | None]:
        return self._typed(
            answer_forms.progress, self._remote("fmi2GetBooleanStatus", "progress_of_step")
        )

    def reset(self) -> None:
        self._remote("fmi2Reset", "reset")

    def set(self, values: Mapping[str, float | bool]) -> None:
        if values:
            self._remote(f"setting {', '.join(values)}", "set", dict(values))

    def read(self, batch: RealBatch) -> None:
        self._box.clear_log()
        batch.read()
        check_log(self.name, self._texts, "fmi2GetReal")

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        wanted = list(names)
        return self._typed(answer_forms.table_of, self._remote("reading", "values", wanted), wanted)

    def save_state(self) -> Any:
        return self._typed(answer_forms.number, self._remote("fmi2GetFMUstate", "save_state"))

    def restore_state(self, state: Any) -> None:
        self._remote("fmi2SetFMUstate", "restore_state", state)

    def free_state(self, state: Any) -> None:
        self._remote("fmi2FreeFMUstate", "free_state", state)

    def serialize_state(self, state: Any) -> bytes:
        return self._typed(
            answer_forms.hexadecimal,
            self._remote("fmi2SerializeFMUstate", "serialize_state", state),
        )

    def deserialize_state(self, content: bytes) -> Any:
        return self._typed(
            answer_forms.number,
            self._remote("fmi2DeSerializeFMUstate", "deserialize_state", content.hex()),
        )
