"""Loads with the laws and the dependence on the frequency of their records of dynamics data."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.draft import Draft
from orchestrator.cases.networks.load_models import is_open
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.frequency_records import recorded_frequency, with_frequency
from orchestrator.cases.networks.psse.load_records import recorded_laws, with_recorded_laws


def take_laws(draft: Draft, records: Sequence[DynamicRecord]) -> frozenset[tuple[str, int]]:
    """Give the loads the laws of their records, where the case leaves them open; return the places of those records."""
    data = draft.data
    if data is None or not is_open(draft.given.case.network):
        return frozenset()
    recorded = recorded_laws(records, data.file_loads)
    draft.data = replace(
        data,
        loads=tuple(
            with_recorded_laws(load, recorded.laws[load.name])
            if load.name in recorded.laws and load.p_mw >= 0
            else load
            for load in data.loads
        ),
        recorded_loads=data.recorded_loads | frozenset(recorded.laws),
    )
    draft.found.questions += recorded.remarks
    return recorded.places


def take_frequency(draft: Draft, records: Sequence[DynamicRecord]) -> frozenset[tuple[str, int]]:
    """Give the loads the frequency's factors of their records; return the places of those records.

    Loads of whose law nothing is known but that they are constant impedances have none."""
    if draft.data is None:
        return frozenset()
    recorded = recorded_frequency(records, draft.data.file_loads, draft.data.loads)
    loads = tuple(with_frequency(draft.data.loads, recorded))
    draft.data = replace(draft.data, loads=loads)
    draft.found.questions += recorded.remarks
    return recorded.places
