"""Places of a device, best first, as users have them: buses or machines, each with rows, JSON, files and a page."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from orchestrator.cases.case import Case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.late import pd
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.output.results.lock import hold_folder
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.siting.confirmation import Confirmation


class RankedPlaces(Protocol):
    """The result of a search for places, as far as buses and machines have it in common."""

    @property
    def case(self) -> Case: ...

    @property
    def prepared(self) -> PreparedScenario: ...

    @property
    def ranking(self) -> tuple[str, ...]: ...

    @property
    def agrees(self) -> bool: ...

    @property
    def breaking(self) -> Sequence[Confirmation]: ...

    @property
    def confirmations(self) -> Sequence[Confirmation]: ...


Ranked = TypeVar("Ranked", bound=RankedPlaces)


class PlaceRanking(ABC, Generic[Ranked]):
    """Places of a device, best first.

    A kind of places gives the names of its files, its title, sentences, rows, and page.

    Attributes
    ----------
    result
        All that was computed.
    """

    json_name: ClassVar[str]
    table_name: ClassVar[str]
    page_name: ClassVar[str]

    def __init__(self, result: Ranked) -> None:
        self.result = result

    @property
    def ranking(self) -> tuple[str, ...]:
        """All places, best first."""
        return self.result.ranking

    @property
    @abstractmethod
    def answer(self) -> str:
        """The best places in one sentence."""

    @property
    def answer_lines(self) -> list[str]:
        """The answer as a terminal shows it: the verdict in its first line, and what belongs to it behind."""
        return [self.answer]

    @property
    @abstractmethod
    def remarks(self) -> list[str]:
        """Return what coupled FMUs say of the best places, and what was not judged."""

    @property
    def agrees(self) -> bool:
        """Return whether the coupled FMUs confirm every place that was tried."""
        return self.result.agrees

    @property
    @abstractmethod
    def without_device(self) -> ModesResult:
        """The modes of the system as it is."""

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor site --json`` prints, as JSON's types."""

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """One row for each place and mode, best place first, as the CSV file has them."""

    @abstractmethod
    def best_table(self) -> ShownTable:
        """The best places, for a terminal."""

    @abstractmethod
    def page_title(self) -> str:
        """Return the heading in a notebook."""

    @abstractmethod
    def page_text(self) -> str:
        """Return the page for a browser."""

    def table(self) -> pd.DataFrame:
        """One row for each place and mode; columns as in the CSV file that `save` writes."""
        return pd.DataFrame(self.rows())

    def save(self, folder: str | Path) -> list[Path]:
        """Write figures as JSON and CSV, and the page, into a folder; returns their paths."""
        place = made_folder(folder, "folder")
        with hold_folder(place), staged(place, new_run_id()) as staging:
            save_json(self.as_json(), staging / self.json_name)
            save_table(self.rows(), staging / self.table_name)
            write_text(staging / self.page_name, self.page_text())
        return [place / name for name in (self.json_name, self.table_name, self.page_name)]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} in {self.result.case.name}: {self.answer}>"

    def _repr_html_(self) -> str:
        top = headline(self.answer, self._good)
        return page(self.page_title(), self.remarks, self.table(), verdict=top)

    @property
    def _good(self) -> bool | None:
        """Return whether coupled FMUs bear the answer out; None without any, or where it stays unstable."""
        found = self.result.confirmations
        if not self.agrees or self.result.breaking:
            return False
        return True if found and found[0].stable else None
