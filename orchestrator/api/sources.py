"""The oscillations of a record, as Python has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.api.values import Time, moment
from orchestrator.late import Late
from orchestrator.oscillations.measurements import Measurements
from orchestrator.oscillations.reading import contest_cases, measurements_of, read_contest
from orchestrator.oscillations.verdict import Located, locate
from orchestrator.report.notebook import page

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
else:
    pd = Late("pandas")


class Sources:
    """The oscillations of a record, the strongest first. `source` makes it.

    Attributes
    ----------
    label
        Name of the record.
    oscillations
        Frequency, kind, evidence, what each method says, and the source or None.
    remarks
        What was done to the record before.
    places
        Names of the places whose power and voltage were used.
    """

    def __init__(self, measured: Measurements, oscillations: Sequence[Located]) -> None:
        self.label, self.remarks, self.oscillations = measured.label, measured.remarks, list(oscillations)
        self.places = [place.name for place in measured.places]

    def __iter__(self) -> Iterator[Located]:
        return iter(self.oscillations)

    def __len__(self) -> int:
        return len(self.oscillations)

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor source --json`` prints, as JSON's types."""
        found = [one.as_json() for one in self.oscillations]
        return {"record": self.label, "places": self.places, "remarks": list(self.remarks), "oscillations": found}

    def table(self) -> pd.DataFrame:
        """One row for each oscillation: frequency [Hz], kind, source, begin [s] and the reason."""
        keys = ["frequency_hz", "kind", "source", "begin", "reason"]
        return pd.DataFrame([one.as_json() for one in self.oscillations], columns=keys)

    def __repr__(self) -> str:
        return f"<Sources in {self.label}: {len(self)} oscillations>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), list(self.remarks), self.table())


def sources_of(dataset: xr.Dataset, label: str, start: Time | None, stop: Time | None) -> Sources:
    """The oscillations of a part of a record.

    Parameters
    ----------
    dataset
        Signals over the time.
    label
        Name of the record.
    start, stop
        The part [s]; None for its own begin and end.
    """
    begin, end = (None if t is None else moment(t, name) for t, name in ((start, "start"), (stop, "stop")))
    measured = measurements_of(dataset.sel(time=slice(begin, end)), label)
    return Sources(measured, locate(measured))


def contest_sources(folder: Path) -> list[Sources]:
    """`source` of each case of a folder in the form of the 2021 IEEE-NASPI contest.

    Parameters
    ----------
    folder
        A case's folder, or one with the folders of several.
    """
    measured = [read_contest(path) for path in contest_cases(folder)]
    return [Sources(one, locate(one)) for one in measured]
