"""Screenings: operating points times outages."""

from pathlib import Path
from typing import Any

import pandas as pd

from orchestrator.api.executors import PointStudy
from orchestrator.report.notebook import page
from orchestrator.safe_files import made_folder
from orchestrator.screening.study import ScreeningResult, run_screening
from orchestrator.screening.summary import ModeAt, Summary, as_json
from orchestrator.screening.words import verdict_sentence, what_was_counted


class Screening:
    """Critical modes of operating points and outages. `Case.screen` makes it.

    Attributes
    ----------
    result
        All items.
    summary
        What they come to.
    """

    def __init__(self, result: ScreeningResult) -> None:
        self.result = result
        self.summary = Summary(result)

    @property
    def stable(self) -> bool | None:
        """Whether nothing grows anywhere; None where an item has no verdict and none grows."""
        return self.summary.stable

    @property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return verdict_sentence(self.summary)

    def items(self) -> pd.DataFrame:
        """One row for each operating point with each outage: status, verdict and least damping [%]."""
        rows = []
        for item in self.result.items:
            record = item.record
            least = ModeAt(item, record.critical[0]).damping if record.critical else float("nan")
            rows.append({"point": item.point.name, "outage": item.outage.name, "hours": item.point.hours,
                         "status": str(record.status), "stable": record.stable, "least_damping_percent": least,
                         "why": record.text})  # fmt: skip
        return pd.DataFrame(rows)

    def modes(self) -> pd.DataFrame:
        """One row for each mode: where it is damped least, and how much there."""
        rows = [
            {"mode": mode.name, "point": mode.worst.item.point.name, "outage": mode.worst.item.outage.name,
             "frequency_hz": mode.worst.frequency, "damping_percent": mode.worst.damping, "items": len(mode.at)}
            for mode in self.summary.modes
        ]  # fmt: skip
        return pd.DataFrame(rows, columns=["mode", "point", "outage", "frequency_hz", "damping_percent", "items"])

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor screen --json`` prints, as JSON's types."""
        return as_json(self.summary)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``items.csv``, ``modes.csv``, ``screening.json`` and the page ``screening.html`` into a folder."""
        from orchestrator.screening.files import save  # noqa: PLC0415 - imports Matplotlib, a second

        return save(self.summary, made_folder(Path(folder)))

    def __repr__(self) -> str:
        return f"<Screening of {self.result.plan.case.name}: {self.verdict}>"

    def _repr_html_(self) -> str:
        lines = [self.verdict, what_was_counted(self.summary)]
        return page(f"Screening of {self.result.plan.case.name}", lines, self.modes())


STUDY = PointStudy(run_screening, Screening, "orchestrator.screening.worker")
