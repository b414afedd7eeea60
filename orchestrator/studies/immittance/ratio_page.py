"""A page with a slider: the eigenloci of a device at an ideal source of any short-circuit ratio."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.output.report.html.elements import document, held_data
from orchestrator.studies.immittance.judgement import CutJudgement, judge_loop
from orchestrator.studies.immittance.margins import where_distance_counts
from orchestrator.studies.immittance.sides import short_name
from orchestrator.studies.immittance.strength import SourceBehind
from orchestrator.studies.immittance.study import CutResult

_COUNT = 25  # ratios that are judged before, equally far apart in ratio
_WIDE = 4.0  # from the ratio that was asked for, divided by this, to as many times it
_DIGITS = 5  # of a number that the page holds
_POINTS = 1200  # of a locus that the page draws, at most


@dataclass(frozen=True)
class JudgedRatio:
    """A short-circuit ratio, and the loop judged at it."""

    ratio: float
    judgement: CutJudgement

    def as_json(self) -> dict[str, Any]:
        margins = None if self.judgement.reasons else self.judgement.margins
        return {
            "ratio": self.ratio,
            "verdict": str(self.judgement.verdict),
            "reasons": list(self.judgement.reasons),
            "distance": None if margins is None else margins.distance.value,
            "at_hz": None if margins is None else margins.distance.frequency_hz,
        }


def ratio_page(result: CutResult) -> str:
    """Write the page of a judgement at a short-circuit ratio.

    The impedance of the source, and with it the loop, is in inverse proportion to the ratio, so that the page draws any
    ratio exactly, from the points of one. Verdicts are those that were computed, at 25 ratios.

    Raises
    ------
    InputError
        If no ratio was given.
    """
    source = result.loop.network
    if result.request.scr is None or not isinstance(source, SourceBehind):
        raise InputError(
            Option.HTML
            + ": the page has a slider of the short-circuit ratio; give "
            + Option.SCR
            + ", the ratio in its middle"
        )
    own = result.request.scr
    turn = np.geomspace(1 / _WIDE, _WIDE, _COUNT)
    judged = [
        JudgedRatio(float(f"{own * k:.4g}"), judge_loop(_behind(result, source, own, own * k)))
        for k in turn
    ]
    path = result.judgement.path
    kept = np.flatnonzero(np.logical_and(path.on_axis, where_distance_counts(path)))
    kept = kept[:: len(kept) // _POINTS + 1]
    L = path.L[kept]
    content = {
        "ratio": own,
        "hertz": _rounded(path.hertz[kept]),
        "loop": _parts(L.reshape(-1, 4)),
        "loci": _parts(path.loci[kept]),
        "judged": [one.as_json() for one in judged],
        "device": short_name(result.loop.device.name),
        "off": _largest_error(result, judged),
    }
    findings = (
        '<div class="findings"><p id="verdict" aria-live="polite"></p><p id="boss"></p></div>'
    )
    script, style = (
        (Path(__file__).parent / f"ratio_page.{kind}").read_text(encoding="utf-8")
        for kind in ("js", "css")
    )
    drawn = (
        f"<style>{style}</style>"
        '<p><label>Short-circuit ratio <input id="ratio" type="range" min="0" max="1000" step="1" '
        'style="width:min(100%,560px)"> <output id="shown"></output></label></p>'
        '<svg id="plane" class="chart" role="img" aria-label="Eigenloci of Z·Y"></svg>'
        '<ul class="legend" id="key"></ul><p class="soft" id="error"></p>'
        "<details><summary>The ratios that were judged</summary>"
        '<div class="scroll"><table id="ratios"></table></div></details>'
    )
    kind = f"eigenloci of Z·Y at a source of any strength, X/R {result.request.x_r:g}"
    return document(
        f"How weak may the grid of {content['device']} be?",
        kind,
        findings,
        [("At which ratio?", f"{drawn}{held_data('held', content)}<script>{script}</script>")],
    )


def _behind(result: CutResult, source: SourceBehind, own: float, ratio: float) -> Any:
    """The same device at a source of another ratio."""
    factor = own / ratio
    network = replace(
        source,
        name=f"a source of SCR {ratio:.4g}",
        resistance=source.resistance * factor,
        reactance=source.reactance * factor,
    )
    return replace(result.loop, network=network)


def _largest_error(result: CutResult, judged: list[JudgedRatio]) -> float:
    """Return how far the distances of the page's points are from those of the judged ratios, at most."""
    path = result.judgement.path
    L = path.L[np.logical_and(path.on_axis, where_distance_counts(path))]
    off = [0.0]
    for one in judged:
        if not one.judgement.reasons:
            scaled = np.eye(L.shape[-1]) + L * (result.request.scr or 1.0) / one.ratio
            least = np.linalg.svd(scaled, compute_uv=False)[:, -1].min()
            off.append(abs(float(least) - one.judgement.margins.distance.value))
    return float(f"{max(off):.1e}")


def _parts(columns: Complex) -> list[list[float]]:
    """Real and imaginary parts of each column, one after the other."""
    return [_rounded(part) for column in columns.T for part in (column.real, column.imag)]


def _rounded(values: Any) -> list[float]:
    return [float(f"{x:.{_DIGITS}g}") for x in np.asarray(values).tolist()]
