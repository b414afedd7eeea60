"""What a retuning found, as JSON and as a table."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.markup import escape

from orchestrator.immittance.family import LoopFigures
from orchestrator.immittance.retune import Retuned
from orchestrator.report.tables import make_table


def retuned_json(found: Sequence[Retuned], goal: float) -> dict[str, Any]:
    return {"distance_wanted": goal, "parameters": [_one(x, goal) for x in found]}


def _one(x: Retuned, goal: float) -> dict[str, Any]:
    figures = {f"{v:.12g}": _figures(f) for v, f in zip(x.values.tolist(), x.figures, strict=True)}
    return {
        "name": x.setting.name, "unit": x.setting.unit, "now": x.setting.now, "range": [x.setting.low, x.setting.high],
        "needed": x.needed, "predicted": None if x.predicted is None else _figures(x.predicted),
        "confirmed": _confirmed(x), "meets_within": x.kept(goal), "remark": x.remark,
        "scans": [{"value": v, "verdict": str(r.verdict)} for v, r in sorted(x.scans.items())],
        "checks": [{k: _number(v) for k, v in vars(c).items()} for c in x.checks], "figures": figures,
    }  # fmt: skip


def _figures(f: LoopFigures) -> dict[str, Any]:
    """None for what is not known or not there."""
    mode = None if f.mode is None else {"real": f.mode.real, "imag": f.mode.imag}
    return {"distance": _number(f.distance), "frequency_hz": f.frequency_hz, "damping_percent": _number(f.damping),
            "least_damped": mode, "network_weaker_by": _number(f.weaker)}  # fmt: skip


def _number(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _confirmed(x: Retuned) -> dict[str, Any] | None:
    """What a scan and the modes of the coupled system say at the value that is needed."""
    if x.confirmed is None or x.needed is None:
        return None
    own = x.figures[int(np.searchsorted(x.values, x.needed))]
    near = x.coupled_mode(own.mode)
    return {"verdict": str(x.confirmed.verdict), "distance": own.distance, "damping_percent": _number(own.damping),
            "coupled_damping_percent": None if near is None else -100 * near.real / abs(near),
            "modes_stable": x.confirmed.cut and x.confirmed.cut.modes_stable}  # fmt: skip


def retuned_table(found: Sequence[Retuned], goal: float) -> Iterator[RenderableType]:
    """The table, and what is to be known of it."""
    columns = ("Parameter", "Now", "Needed", "Predicted", "Confirmed", "Damping [%]", "Coupled modes")
    rows = [_row(x, goal) for x in found if x.figures]
    yield make_table(f"What to retune for a distance of {goal:g} from −1", *columns, rows=rows)
    errors = [x.error for x in found if not math.isnan(x.error)]
    if errors:
        yield f"Last scans of each lay up to {max(errors):.1g} from what was predicted for them"
    for remark in dict.fromkeys(x.remark for x in found if x.remark):
        yield escape(f"{', '.join(x.setting.name for x in found if x.remark == remark)}: {remark}")


def _row(x: Retuned, goal: float) -> tuple[str, ...]:
    unit = "" if x.setting.unit == "1" else f" {x.setting.unit}"
    now = f"{x.setting.now:.4g}{unit}"
    if (kept := x.kept(goal)) is not None:
        return x.setting.name, now, f"enough from {kept[0]:.3g} to {kept[1]:.3g}", "", "", "", ""
    said = _confirmed(x)
    if said is None or x.predicted is None:
        k = x.best()
        best = f"not alone; best {x.distances[k]:.3f} at {x.values[k]:.4g}"
        return x.setting.name, now, best, "", "", "", ""
    coupled = {True: "stable", False: "UNSTABLE", None: "not asked"}[said["modes_stable"]]
    if said["coupled_damping_percent"] is not None:
        coupled += f", {said['coupled_damping_percent']:.2f} %"
    return (x.setting.name, now, f"{x.needed:.4g}{unit}", f"{x.predicted.distance:.4f}",
            f"{said['verdict']}, {said['distance']:.4f}", f"{x.predicted.damping:.2f}", coupled)  # fmt: skip
