"""Findings at a cut: as Python has it, as files, and in words."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.markup import escape

from orchestrator.core.late import pd
from orchestrator.core.spelling import spelled
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.output.results.file_writers import save_json
from orchestrator.studies.immittance.margins import Margin
from orchestrator.studies.immittance.retune import Retuned, Study, Tunable, retune
from orchestrator.studies.immittance.sides import short_name
from orchestrator.studies.immittance.study import CutResult

GOAL = 0.3  # distance from −1 that a retuning is to reach: all of L may be off by so much of 1

_MARGINS = (
    ("gain up", "gain_up", "× {:.3f}"),
    ("gain down", "gain_down", "× {:.3f}"),
    ("phase, ±", "phase_deg", "{:.1f}°"),
    ("delay, lag", "delay_s", "{:.2e} s"),
    ("distance from −1", "distance", "{:.3f}"),
    ("disk", "disk", "{:.3f}"),
)

_NAMED = 4  # buses and devices in a line that take part in a mode
_LITTLE = 5e-3  # share of a mode that is too little to be named

Report = Callable[[str], None]


class Nyquist(NoTruth, ask=".verdict"):
    """Findings of `nyquist` at a cut: ``result`` has loop, judgement and scans, ``retuned`` what `retune` found."""

    def __init__(
        self, result: CutResult, study: Study, settings: Callable[[Sequence[str]], list[Tunable]]
    ) -> None:
        self.result, self._study, self._settings = result, study, settings
        self.retuned: list[Retuned] = []
        self.goal = GOAL

    @property
    def verdict(self) -> str:
        """``stable``, ``unstable`` or ``not known``."""
        return str(self.result.verdict)

    @property
    def stable(self) -> bool | None:
        """Return whether it is stable; None where that is not known."""
        return {"stable": True, "unstable": False}.get(self.verdict)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the verdict is not known."""
        return tuple(map(spelled, self.result.judgement.reasons))

    def retune(
        self,
        parameters: Sequence[str] = (),
        *,
        distance: float = GOAL,
        report: Report = lambda text: None,
    ) -> list[Retuned]:
        """Follow the distance from −1 over parameters of the device (names or patterns; all tunable ones by default),
        and find the least change of each that is enough; those that are come first, by the size of the change.

        ``report``: Called with a sentence before each scan."""
        self.goal = distance
        found = [
            retune(self._study, setting, self.result, distance, report)
            for setting in self._settings(parameters)
        ]
        self.retuned = sorted(found, key=lambda one: one.effort)
        return self.retuned

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor fmu nyquist --json`` prints, as JSON's types."""
        if not self.retuned:
            return self.result.as_json()
        found = {
            "distance_wanted": self.goal,
            "parameters": [_one(x, self.goal) for x in self.retuned],
        }
        return self.result.as_json() | {"retune": found}

    def html(self) -> str:
        """A page with a slider of the short-circuit ratio, where one was given."""
        from orchestrator.studies.immittance.ratio_page import ratio_page  # noqa: PLC0415 - only where it is asked for

        return ratio_page(self.result)

    def save_pictures(self, folder: str | Path) -> list[Path]:
        """Write the eigenloci and the matrices as PNG into a folder that exists; returns the paths."""
        from orchestrator.studies.immittance.pictures import draw  # noqa: PLC0415 - a second to import

        return draw(self.result, Path(folder), self.retuned, self.goal)

    def save(self, folder: Path) -> None:
        """Write ``nyquist.json``, the pictures, and scans that were measured in Z-tool's form."""
        from orchestrator.studies.immittance.scan_files import write_ztool  # noqa: PLC0415 - not in Python alone

        save_json(self.as_json(), folder / "nyquist.json")
        self.save_pictures(folder)
        for side, scan in self.result.scans.items():
            if scan.unit == "S":
                write_ztool(scan, folder / f"gfor#Y_AC#{side}-1#.txt")

    def _repr_html_(self) -> str:
        m = self.result.margins
        rows = [] if m is None else [(n, *_cells(getattr(m, k), text)) for n, k, text in _MARGINS]
        table = pd.DataFrame(rows, columns=["margin", "value", "at [Hz]"]) if rows else None
        top = headline(f"{self.verdict}: {self.result.because}", self.stable)
        return page("Nyquist's criterion at the cut", self.reasons, table, verdict=top)

    def __repr__(self) -> str:
        return f"<Nyquist {self.verdict}: {self.result.because}>"


def parts(found: Nyquist) -> Iterator[RenderableType]:
    """Yield the rows of a terminal: verdict, margins, where a side is not passive, how far a scan is off."""
    result = found.result
    yield VerdictSentence(found.stable, str(result.verdict), result.because).markup()
    m = result.margins
    if m is not None:
        rows = [(name, *_cells(getattr(m, key), text)) for name, key, text in _MARGINS]
        yield make_table("Margins", "Margin", "Value", "at [Hz]", rows=rows)
    yield from _by_bus(result)
    if result.scr is not None:
        yield _strength(result)
    for side, bands in result.judgement.active.items():
        said = ", ".join(f"{a:.4g}–{b:.4g} Hz" for a, b in bands) or "nowhere"
        yield escape(f"{side} ({short_name(getattr(result.loop, side).name)}) not passive: {said}")
    far = result.difference
    if far is not None:
        yield (
            f"The device differs from the case's own by {100 * far['largest_relative']:.2g} % at most, at "
            f"{far['frequency_hz']:.4g} Hz"
        )
    if found.retuned:
        yield from retuned_table(found.retuned, found.goal)


def _by_bus(result: CutResult) -> Iterator[RenderableType]:
    """The loop at each bus alone, least distance first, and who takes part where the whole comes near −1."""
    sheets = sorted(result.as_json()["buses"], key=lambda b: b["margins"]["distance"]["value"])
    rows: list[tuple[str, ...]] = []
    for b in sheets:
        m = b["margins"]
        gain = f"× {m['gain']['value']:.3f}" if m["gain"] else "none"
        phase = f"{m['phase_deg']['value']:.1f}°" if m["phase_deg"] else "none"
        left = {True: "UNSTABLE", False: "stable"}[b["growing_modes_without"] > 0]
        scr = "" if b["scr"] is None else f"{b['scr']:.2f}"
        rows.append(
            (
                b["bus"],
                ", ".join(b["devices"]),
                f"{m['distance']['value']:.3f}",
                f"{m['distance']['frequency_hz']:.3f}",
                gain,
                phase,
                left,
                scr,
            )
        )
    if rows:
        ratios = "SCR is" if result.gscr is None else f"SCR, and gSCR of {result.gscr:.3g}, are"
        yield make_table(
            f"At each bus alone ({ratios} no margin: devices and settings differ at one ratio)",
            *("Bus", "Devices", "Distance", "at [Hz]", "Gain", "Phase", "Without it", "SCR"),
            rows=rows,
        )
    for one in result.critical if rows else ():
        buses = _most(one.buses, "{} {:.0%}")
        devices = _most(one.devices, "{} {:+.3f}")
        yield escape(
            f"At {one.frequency_hz:.4g} Hz, {one.distance:.3g} from −1: {buses}; per part by which a device "
            f"grows the distance changes by {devices}"
        )


def _most(found: dict[str, float], text: str) -> str:
    most = [
        item
        for item in sorted(found.items(), key=lambda item: -abs(item[1]))[:_NAMED]
        if abs(item[1]) > _LITTLE
    ]
    return ", ".join(text.format(name, value) for name, value in most)


def _strength(result: CutResult) -> str:
    limit, d = result.scr_limit, result.judgement.margins.distance
    lost = f"; stability is lost below {limit:.3g}" if limit else ""
    said = "; no smaller one loses stability" if limit == 0 else lost
    of_all = "" if result.gscr is None else f", gSCR of all converters {result.gscr:.3g}"
    told = f"what tells how far it is from instability is the distance, {d.value:.3g}"
    return f"Short-circuit ratio {result.scr:.3g}{of_all}{said}. At one ratio devices and settings differ: {told}"


def _cells(margin: Margin | None, text: str) -> tuple[str, str]:
    return (
        ("none", "")
        if margin is None
        else (text.format(margin.value), f"{margin.frequency_hz:.3f}")
    )


def _one(x: Retuned, goal: float) -> dict[str, Any]:
    known = [
        (v, f)
        for v, f in zip(x.values.tolist(), x.figures, strict=True)
        if math.isfinite(f.distance)
    ]
    scans = [{"value": v, "verdict": str(r.verdict)} for v, r in sorted(x.scans.items())]
    checks = [vars(c) for c in x.checks if math.isfinite(c.found + c.predicted)]
    return {
        "name": x.setting.name,
        "unit": x.setting.unit,
        "now": x.setting.now,
        "range": [x.setting.low, x.setting.high],
        "met": x.met(goal) if x.figures else None,
        "needed": x.needed,
        "confirmed": _confirmed(x),
        "remark": x.remark,
        "scans": scans,
        "checks": checks,
        "curve": [
            {
                "value": v,
                "distance": f.distance,
                "damping_percent": _number(f.damping),
                "network_weaker_by": _number(f.weaker),
            }
            for v, f in known
        ],
    }


def _number(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _confirmed(x: Retuned) -> dict[str, Any] | None:
    """Return the prediction at the value that is needed, and what a scan and the coupled system's modes say there."""
    if x.needed is None or x.predicted is None:
        return None
    result, own, cut = (
        x.scans[x.needed],
        x.figures[int(np.searchsorted(x.values, x.needed))],
        x.scans[x.needed].cut,
    )
    own_modes = () if cut is None or cut.modes_stable is None or result.scans else cut.eigenvalues
    near = min(own_modes, key=lambda p: abs(p - own.mode), default=None) if own.mode else None
    return {
        "predicted": x.predicted.distance,
        "verdict": str(result.verdict),
        "distance": own.distance,
        "damping_percent": _number(own.damping),
        "coupled_damping_percent": None if near is None else float(-100 * near.real / abs(near)),
        "modes_stable": None if cut is None or result.scans else cut.modes_stable,
    }


def retuned_table(found: Sequence[Retuned], goal: float) -> Iterator[RenderableType]:
    """The table, and what is to be known of it."""
    columns = (
        "Parameter",
        "Now",
        "Needed",
        "Predicted",
        "Confirmed",
        "Damping [%]",
        "Coupled modes",
    )
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
        judged = ~np.isin(
            x.values, [v for v, result in x.scans.items() if result.judgement.reasons]
        )
        k = int(np.nanargmax(np.where(judged, x.distances, -1.0)))
        best = "not alone; best" if not x.met(goal) else "none; best"
        return (*head, f"{best} {x.distances[k]:.3f} at {x.values[k]:.4g}", "", "", "", "")
    coupled = {True: "stable", False: "UNSTABLE", None: "not asked"}[said["modes_stable"]]
    if said["coupled_damping_percent"] is not None:
        coupled += f", {said['coupled_damping_percent']:.2f} %"
    return (
        *head,
        f"{x.needed:.4g}{unit}",
        f"{said['predicted']:.4f}",
        f"{said['verdict']}, {said['distance']:.4f}",
        f"{said['damping_percent'] or 0:.2f}",
        coupled,
    )
