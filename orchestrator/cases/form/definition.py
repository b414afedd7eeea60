"""The contents of a case file, checked against its form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.cases.form.locate import place_in
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import CaseTable, ComponentTable, ScenarioTable
from orchestrator.core.errors import Problem
from orchestrator.core.given_files import ShownFile

if TYPE_CHECKING:
    from orchestrator.cases.flow.sharing import SharingRule


@dataclass(frozen=True)
class CaseDefinition:
    """A case file, or the equivalent of an SSP."""

    # contents of the file. Entries of a wrong form are left out here and listed in ``problems``; the meaning of the
    # rest can still be checked.
    table: CaseTable
    text: str
    path: Path
    problems: tuple[Problem, ...]
    # folder to which paths in the tables are relative; it holds wherever the program works later
    directory: Path
    # whether ``text`` is the user's own file, whose line numbers help in errors
    numbered: bool = True
    # whether the user said that its FMUs may run in gfor's own process, where the file wants that.
    trust_fmus: bool = False
    # folder of the file itself; that of an SSP is another one than ``directory``.
    home: Path = field(default_factory=Path.cwd)
    # the parameter files that its scenarios name, as they were read with the case; text says why one cannot be read.
    parameter_files: Mapping[str, ParameterFile | str] = field(default_factory=dict)
    # devices that take the place of the file's own, by component. Of parameter files, scenarios and the command line no
    # value reaches them: those were meant for the device that was there.
    exchanged: Mapping[str, ComponentTable] = field(default_factory=dict)
    # how units share what given values take out of service, such as ``sg5.connected = false``; as the file says where
    # None.
    sharing: SharingRule | None = None
    # whether a component may be a scan: only for what needs neither its states nor a run
    scans: bool = False
    # what is unusual in the file, found when it was read, for the user to answer
    questions: tuple[Problem, ...] = ()
    events_given: tuple[str, ...] = ()  # in words, by the caller, in the place of the file's
    # whether the grid takes a current besides at every bus; see `Network.injections`
    injections: bool = False
    faulted: frozenset[str] = frozenset()  # buses with a fault besides those of the file's events
    # lines whose ends switch one by one, besides those of the file's events
    line_ends: frozenset[str] = frozenset()
    # variables, by ``component.variable``, that a study varies: their values are meant, whatever is usual
    varied: frozenset[str] = frozenset()

    @property
    def source(self) -> str:
        """The file as errors name it, or ``case`` for tables that Python gave."""
        return str(ShownFile.of(self.path))

    @property
    def content(self) -> bytes:
        """``text`` with the line ends of its file, as long as that says the same."""
        there, text = (
            self.path.read_bytes() if self.path.is_file() else b"",
            self.text.encode("utf-8"),
        )
        return there if there.replace(b"\r\n", b"\n") == text else text

    @property
    def name(self) -> str:
        return self.table.name

    @property
    def scenarios(self) -> dict[str, ScenarioTable]:
        """Scenarios by name. A case without scenarios has one, with the name of the case."""
        return self.table.scenarios or {self.table.name: ScenarioTable()}

    def place(self, *path: str | int) -> str:
        """A key path as text, with its line in the file."""
        return place_in(self.text if self.numbered else "", path)
