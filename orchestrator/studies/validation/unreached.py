"""Limits beside one that is a cause, which the model does not reach with it: no recording of this event tells them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestrator.studies.validation.cause_bench import CauseBench
from orchestrator.studies.validation.cause_limits import likely_limits
from orchestrator.studies.validation.causes import Explanation
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent
from orchestrator.studies.validation.hidden import HiddenPart
from orchestrator.studies.validation.residuals import Report

_LOWER = 0.98  # times a limit: a model that comes within a fiftieth of it answers otherwise then
_SAME = 1e-9  # power [pu of the rating] by which two answers of a model may differ that nothing tells apart


def unreached_limits(
    device: PlayedDevice, events: Sequence[RecordedEvent], cause: Explanation, report: Report
) -> tuple[str, ...]:
    """Name the limits of the cause's part that may be off as well with nothing to see; none where it is no limit.

    ``device``: with its own values, and held in step if the cause was found so."""
    nothing_hidden = HiddenPart.of([], [], 0.0)
    bench = CauseBench(device.rough, events, report, nothing_hidden)
    likely = [info.name for info in likely_limits(bench)]
    part = cause.name.rpartition(".")[0]
    others = [
        name for name in likely if name.rpartition(".")[0] == part and name not in cause.values
    ]
    answers = bench.responses(cause.values) if cause.name in likely and others else None
    if answers is None:
        return ()
    found = []
    for name in others:
        report(f"looking whether {name} is reached")
        lower = bench.responses({**cause.values, name: _LOWER * bench.device.value(name)})
        pairs = [] if lower is None else zip(answers, lower, strict=True)
        if lower is not None and all(np.abs(one - low).max() <= _SAME for one, low in pairs):
            found.append(name)
    return tuple(found)
