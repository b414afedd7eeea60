"""A file of PSS/E's power flow data, whichever of its two forms it has: lines (RAW) or JSON (RAWX)."""

from pathlib import Path

from orchestrator.cases.networks.psse.older_revisions import with_later_records
from orchestrator.cases.networks.psse.raw_records import RawFile, read_records, text_of
from orchestrator.cases.networks.psse.rawx import read_rawx


def read_file(path: Path) -> RawFile:
    """The records of a RAW or a RAWX file, told apart by what stands in it."""
    text = text_of(path)
    is_json = text.lstrip().startswith("{")
    return read_rawx(path, text) if is_json else with_later_records(read_records(path))
