"""A study of several scenarios that ended before its last one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class EarlyEnd:
    """Where a study ended before its time, and what is not there because of that."""

    scenario: str
    interrupted: bool
    kept: bool = True
    not_begun: Mapping[str, str] = field(default_factory=dict)

    @property
    def word(self) -> str:
        return "interrupted" if self.interrupted else "failed"

    @property
    def place(self) -> str:
        """Where it ended, and what never began."""
        rest = f"; never begun: {', '.join(self.not_begun.values())}" if self.not_begun else ""
        return f"in {self.scenario}{'' if self.kept else ', of which nothing is kept'}{rest}"

    def as_json(self) -> dict[str, Any]:
        return {"word": self.word, "place": self.place, "not_begun": list(self.not_begun)}
