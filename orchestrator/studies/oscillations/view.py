"""The oscillations of a record as Python has them, and as tables."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from orchestrator.cases.form.given import Time, part_of_record
from orchestrator.core.errors import CosimError
from orchestrator.core.late import pd, xr
from orchestrator.output.report.notebook import page
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.studies.oscillations.detection import SpectralLine
from orchestrator.studies.oscillations.measurements import Measurements
from orchestrator.studies.oscillations.reading import measurements_of
from orchestrator.studies.oscillations.signs import (
    other_angles,
    other_powers,
    other_units,
    turned_signs,
)
from orchestrator.studies.oscillations.verdict import Located, locate

if TYPE_CHECKING:
    from orchestrator.cases.scenario.prepare import PreparedScenario

_SHOWN = 5


class Sources:
    """The oscillations of a record, the strongest first. `source` makes it.

    Attributes
    ----------
    label
        Name of the record.
    oscillations
        Frequency, kind, evidence, what each method says, what drives it, and whether alone.
    remarks
        What was done to the record before.
    places
        Names of the places whose power and voltage were used.
    """

    def __init__(
        self,
        measured: Measurements,
        oscillations: Sequence[Located],
        prepared: PreparedScenario | None = None,
    ) -> None:
        self.label, self.remarks, self.oscillations = (
            measured.label,
            measured.remarks,
            list(oscillations),
        )
        self.places, self._measured = [place.name for place in measured.places], measured
        self._about = prepared.about if prepared else {"questions": []}

    def __iter__(self) -> Iterator[Located]:
        return iter(self.oscillations)

    def __len__(self) -> int:
        return len(self.oscillations)

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor signal source --json`` prints, as JSON's types."""
        said = {"record": self.label, "places": self.places, "remarks": list(self.remarks)}
        return self._about | said | {"oscillations": [one.as_json() for one in self.oscillations]}

    def table(self) -> pd.DataFrame:
        """One row for each oscillation: frequency [Hz], kind, source, what drives, begin [s] and the reason."""
        keys = ["frequency_hz", "kind", "source", "drives", "begin", "begin_within", "reason"]
        return pd.DataFrame([one.as_json() for one in self.oscillations], columns=keys)

    def html(self) -> str:
        """A page with the map of the energy flows, the amplitudes over the time, and the spectrum."""
        from orchestrator.studies.oscillations.page import source_page  # noqa: PLC0415 - only where it is asked for

        return source_page(self._measured, self.oscillations)

    def __repr__(self) -> str:
        return f"<Sources in {self.label}: {len(self)} oscillations>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), list(self.remarks), self.table())


def sources_of(
    dataset: xr.Dataset,
    label: str,
    start: Time | None,
    stop: Time | None,
    prepared: PreparedScenario | None = None,
) -> Sources:
    """The oscillations of a part of a record, beside the units' models in a scenario or in its own built-in case."""
    begin, end = part_of_record(dataset["time"].values, start, stop, label)
    measured, models = measurements_of(dataset.sel(time=slice(begin, end)), label), None
    if prepared is not None or "case_file" in dataset.attrs:
        from orchestrator.studies.oscillations import unit_models as own  # noqa: PLC0415 - only where there is a case

        try:
            prepared = prepared or own.recorded_case(dataset.attrs)
            models = own.unit_models(prepared) if prepared else None
        except CosimError as error:
            remark = f"the record is compared with no models of the units: {error}"
            measured = replace(measured, remarks=(*measured.remarks, remark))
    if prepared is None and "case_file" in dataset.attrs:
        case = next(
            iter(json.loads(dataset.attrs.get("inputs", "{}"))), f"{dataset.attrs['case']}.toml"
        )
        given = f"--case {case} --scenario {dataset.attrs['scenario']}"
        remark = f"without its own case the run is judged by its signals alone; the units' models decide: give {given}"
        measured = replace(measured, remarks=(remark, *measured.remarks))
    differ = own.unlike(dataset.attrs, prepared) if models and prepared else ""
    if differ:
        remark = f"the models that judge it are not of the recorded system; what differs: {differ}"
        measured = replace(measured, remarks=(*measured.remarks, remark))
    units = {name.casefold() for name in models.units} if models else set()
    if models and units.isdisjoint(p.name.casefold() for p in measured.places if p.kind == "unit"):
        remark = f"the case's models judge nothing: no signal is named after its units, {', '.join(models.units)}"
        measured = replace(measured, remarks=(remark, *measured.remarks))
    turned = turned_signs(measured, prepared) if prepared else {}
    if prepared:
        turned |= other_units(measured, prepared)
    elsewhere = other_powers(measured, models, turned) if models else []
    if prepared and "places" not in dataset.attrs:
        elsewhere += other_angles(measured, prepared)
    measured = replace(measured, remarks=(*turned.values(), *elsewhere, *measured.remarks))
    located = locate(measured, models)
    if models and prepared:
        from orchestrator.studies.oscillations.levers import with_levers  # noqa: PLC0415 - only where there is a case

        located = [with_levers(prepared, x) for x in located]
    return Sources(measured, located, prepared)


def sources_table(found: Sequence[Sources]) -> PlainTable:
    columns = ("Record", "f [Hz]", "Kind", "Source", "Begins [s]", "Multiples")
    table = make_table("", *columns, rows=[row for one in found for row in _rows(one)])
    table.columns[2].justify = table.columns[3].justify = "left"
    return table


def begin_text(line: SpectralLine) -> str:
    """The best begin, and the interval that holds it [s]."""
    if line.onset is None:
        return f"in the first {1.5 / line.frequency:.1f}"  # half of the window that sees it begin
    return f"{line.onset.at:.1f} ({line.onset.earliest:.1f} to {line.onset.latest:.1f})"


def _rows(one: Sources) -> Iterator[Sequence[str]]:
    for x in one:
        multiples = ", ".join(str(order) for order in x.found.harmonics)
        source = x.source or (f"{x.drives}, perhaps others" if x.drives else "not known")
        yield (
            one.label,
            f"{x.found.frequency:.4f}",
            str(x.evidence.kind),
            source,
            begin_text(x.found),
            multiples,
        )
    if not len(one):
        yield one.label, "–", "no oscillation", "–", "–", ""
