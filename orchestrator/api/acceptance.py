"""Acceptance tests of an FMU."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from orchestrator.acceptance.checks.subject import Use
from orchestrator.acceptance.runner import AcceptanceReport, check_fmu, question_of
from orchestrator.api.show import page
from orchestrator.api.values import Time, in_seconds


class Acceptance:
    """What the acceptance tests of an FMU found. `check` makes it.

    Attributes
    ----------
    report
        Every result with evidence, remedy and figures.
    """

    def __init__(self, report: AcceptanceReport) -> None:
        self.report = report

    @property
    def trusted(self) -> bool:
        """Whether it was checked, and nothing failed."""
        return self.report.trusted

    @property
    def faults(self) -> list[str]:
        """Names of what is wrong, each once."""
        return self.report.faults

    def table(self) -> pd.DataFrame:
        """One row a check: its question, verdict, evidence and remedy."""
        rows = {r.check: (str(r.verdict), question_of(r.check), r.evidence, r.remedy) for r in self.report.results}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["verdict", "question", "evidence", "remedy"])

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor check --json`` prints, as JSON's types."""
        return self.report.as_dict()

    def _verdict(self) -> str:
        if self.trusted:
            return "no check failed"
        if not self.report.failures:
            return f"not supported here: {', '.join(self.report.not_supported)}"
        return f"do not use it as it is: {', '.join(self.faults)}"

    def __repr__(self) -> str:
        return f"<Acceptance of {self.report.fmu.name}: {self._verdict()}>"

    def _repr_html_(self) -> str:
        return page(f"{self.report.fmu.name}: {self._verdict()}", table=self.table())


def check(
    path: str | Path,
    binding: str | Path | None = None,
    *,
    step: Time | None = None,
    only: Sequence[str] = (),
) -> Acceptance:
    """Run the acceptance tests of an FMU: can it be trusted in a co-simulation?

    Parameters
    ----------
    path
        Of the FMU.
    binding
        File that says what its variables mean at our port (``gfor bind`` drafts one).
    step
        Communication step of use [s]; what the file declares by default.
    only
        Names of checks; all of them where empty.

    Raises
    ------
    InputError
        If there is no such file or no such check, or the binding cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> report = gfor.check(gfor.build("infinite_bus"), only=["runs"])
    >>> report.trusted
    True
    >>> report.table()["verdict"].to_dict()
    {'archive': 'pass', 'runs': 'pass'}
    """
    use = Use(in_seconds(step, "step"))
    return Acceptance(check_fmu(Path(path), Path(binding) if binding else None, only=tuple(only), use=use))
