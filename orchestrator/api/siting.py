"""Where a converter helps. `Case.site` makes it."""

from pathlib import Path
from typing import Any

import pandas as pd

from orchestrator.report.notebook import page
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder
from orchestrator.siting import view
from orchestrator.siting.study import SiteResult


class Siting:
    """How far a device at each bus moves the poorly damped modes, best bus first.

    Attributes
    ----------
    result
        All that was computed.
    """

    def __init__(self, result: SiteResult) -> None:
        self.result = result

    @property
    def ranking(self) -> tuple[str, ...]:
        """All buses, best first."""
        return self.result.ranking

    @property
    def answer(self) -> str:
        """The best places in one sentence."""
        return view.answer(self.result)

    @property
    def remarks(self) -> list[str]:
        """What coupled FMUs say of the best places, which modes these do not reach, and what was not judged."""
        return [*view.sureness(self.result), *view.remarks(self.result)]

    @property
    def agrees(self) -> bool:
        """Whether the coupled FMUs confirm every place that was tried."""
        return self.result.agrees

    def table(self) -> pd.DataFrame:
        """One row for each bus and mode; columns as in ``buses.csv``."""
        return pd.DataFrame(view.rows(self.result))

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor site --json`` prints, as JSON's types."""
        return view.as_json(self.result)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``site.json``, ``buses.csv`` and the page ``site.html``, which has a map, into a folder."""
        place = made_folder(Path(folder), "folder")
        with held(place):
            return view.save(self.result, place)

    def __repr__(self) -> str:
        return f"<Siting in {self.result.case.name}: {self.answer}>"

    def _repr_html_(self) -> str:
        return page(f"Siting in {self.result.case.name}", [self.answer, *self.remarks], self.table())
