"""Whether there is room on the disk for what a run is about to record."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.errors import InputError

if TYPE_CHECKING:
    from orchestrator.cases.prepare import PreparedScenario

_NUMBER, _CSV_NUMBER = 8, 13
"""Bytes of a recorded value: compressed parts and the joined file together, and its digits in the table."""


def recorded_size(prepared: PreparedScenario, *, csv: bool) -> float:
    """About what the recording of a scenario takes on the disk at most [bytes]."""
    rows = prepared.stop_time / prepared.step_size / prepared.record_every + 1
    return rows * (len(prepared.record) + 1) * (_NUMBER + (_CSV_NUMBER if csv else 0))


def require_room(scenarios: Sequence[PreparedScenario], folder: Path, *, csv: bool) -> None:
    """Compare the size of all recordings with what is free."""
    needed, free = sum(recorded_size(prepared, csv=csv) for prepared in scenarios), shutil.disk_usage(folder).free
    if needed <= free:
        return
    longest = max(scenarios, key=lambda prepared: recorded_size(prepared, csv=csv))
    interval = longest.step_size * longest.record_every
    raise InputError(
        f"{folder}: the recordings would take about {_in_words(needed)} there, and {_in_words(free)} are free: "
        f"{len(longest.record)} signals every {interval:g} s until t = {longest.stop_time:g} s"
        + (f", in {len(scenarios)} scenarios" if len(scenarios) > 1 else "")
        + "; make solver.record_interval longer, name fewer signals in solver.record, end the run earlier (--stop), "
        + ("leave the table out (--no-csv), " if csv else "")
        + "or choose another disk (--out)"
    )


def _in_words(size: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:,.4g} TB"
