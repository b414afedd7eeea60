"""What a case file says, checked against its form."""

from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.locate import place_in
from orchestrator.cases.schema import CaseTable, ScenarioTable
from orchestrator.errors import Problem


@dataclass(frozen=True)
class CaseDefinition:
    """A case file, or what an SSP comes to as one.

    Attributes
    ----------
    table
        Its contents. Where the form was wrong, the wrong entries are left out and stand in
        ``problems``, so that what the rest means can be checked as well.
    text
        Of the case file.
    path
        The file itself.
    directory
        Where relative paths in the tables start.
    numbered
        Whether the text is the file's own, so that its lines mean something to the user.
    """

    table: CaseTable
    text: str
    path: Path
    problems: tuple[Problem, ...]
    directory: Path
    numbered: bool = True

    @property
    def name(self) -> str:
        """The case's name."""
        return self.table.name

    @property
    def scenarios(self) -> dict[str, ScenarioTable]:
        """By name; a case without scenarios has one, named as the case."""
        return self.table.scenarios or {self.table.name: ScenarioTable()}

    def place(self, *path: str | int) -> str:
        """A key path as text, with its line in the file."""
        return place_in(self.text if self.numbered else "", path)
