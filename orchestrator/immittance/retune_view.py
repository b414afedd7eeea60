"""What a retuning found, as JSON and as a table."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.markup import escape

from orchestrator.immittance.retune import Retuned
from orchestrator.report.tables import make_table


def retuned_json(found: Sequence[Retuned], goal: float) -> dict[str, Any]:
    return {"distance_wanted": goal, "parameters": [_one(x, goal) for x in found]}


def _one(x: Retuned, goal: float) -> dict[str, Any]:
    known = [(v, f) for v, f in zip(x.values.tolist(), x.figures, strict=True) if math.isfinite(f.distance)]
    return {
        "name": x.setting.name, "unit": x.setting.unit, "now": x.setting.now, "range": [x.setting.low, x.setting.high],
        "met": x.met(goal) if x.figures else None, "needed": x.needed, "confirmed": _confirmed(x), "remark": x.remark,
        "scans": [{"value": v, "verdict": str(r.verdict)} for v, r in sorted(x.scans.items())],
        "checks": [vars(c) for c in x.checks if math.isfinite(c.found + c.predicted)],
        "curve": [{"value": v, "distance": f.distance, "damping_percent": _number(f.damping),
                   "network_weaker_by": _number(f.weaker)} for v, f in known],
    }  # fmt: skip


def _number(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _confirmed(x: Retuned) -> dict[str, Any] | None:
    """What was predicted at the value that is needed, and what a scan and the coupled system's modes say there."""
    if x.needed is None or x.predicted is None:
        return None
    result, own, cut = x.scans[x.needed], x.figures[int(np.searchsorted(x.values, x.needed))], x.scans[x.needed].cut
    own_modes = () if cut is None or cut.modes_stable is None or result.request.device else cut.eigenvalues
    near = min(own_modes, key=lambda p: abs(p - own.mode), default=None) if own.mode else None
    return {"predicted": x.predicted.distance, "verdict": str(result.verdict), "distance": own.distance,
            "damping_percent": _number(own.damping),
            "coupled_damping_percent": None if near is None else float(-100 * near.real / abs(near)),
            "modes_stable": None if cut is None or result.request.device else cut.modes_stable}  # fmt: skip


def retuned_table(found: Sequence[Retuned], goal: float) -> Iterator[RenderableType]:
    """The table, and what is to be known of it."""
    columns = ("Parameter", "Now", "Needed", "Predicted", "Confirmed", "Damping [%]", "Coupled modes")
    rows = [_row(x, goal) for x in found if x.figures]
    yield make_table(f"What to retune for a distance of {goal:g} from −1", *columns, rows=rows)
    if rows:
        error = max(x.error for x in found if x.figures)
        yield f"Distances of the last scans lay up to {error:.1g} from what was predicted for them"
    for remark in dict.fromkeys(x.remark for x in found if x.remark):
        yield escape(f"{', '.join(x.setting.name for x in found if x.remark == remark)}: {remark}")


def _row(x: Retuned, goal: float) -> tuple[str, ...]:
    unit = "" if x.setting.unit == "1" else f" {x.setting.unit}"
    head, said = (x.setting.name, f"{x.setting.now:.4g}{unit}"), _confirmed(x)
    if said is None:
        k = int(np.nanargmax(x.distances))
        best = "not alone; best" if not x.met(goal) else "none; best"
        return (*head, f"{best} {x.distances[k]:.3f} at {x.values[k]:.4g}", "", "", "", "")
    coupled = {True: "stable", False: "UNSTABLE", None: "not asked"}[said["modes_stable"]]
    if said["coupled_damping_percent"] is not None:
        coupled += f", {said['coupled_damping_percent']:.2f} %"
    return (*head, f"{x.needed:.4g}{unit}", f"{said['predicted']:.4f}",
            f"{said['verdict']}, {said['distance']:.4f}", f"{said['damping_percent'] or 0:.2f}", coupled)  # fmt: skip
