"""What was found at a cut: as Python has it, as files, and in words."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.immittance.margins import Margin
from orchestrator.immittance.study import CutResult
from orchestrator.report.tables import make_table
from orchestrator.report.verdict import VerdictSentence
from orchestrator.results.storage import save_json

_MARGINS = (
    ("gain up", "gain_up", "× {:.3f}"), ("gain down", "gain_down", "× {:.3f}"), ("phase", "phase_deg", "{:.1f}°"),
    ("delay", "delay_s", "{:.2e} s"), ("distance from −1", "distance", "{:.3f}"), ("disk", "disk", "{:.3f}"),
)  # fmt: skip


class Nyquist:
    """What was found at a cut. `nyquist` makes it.

    Attributes
    ----------
    result
        Loop, judgement and scans.
    """

    def __init__(self, result: CutResult) -> None:
        self.result = result

    @property
    def verdict(self) -> str:
        """``stable``, ``unstable`` or ``not known``."""
        return str(self.result.verdict)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the verdict is not known."""
        return self.result.judgement.reasons

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor fmu nyquist --json`` prints, as JSON's types."""
        return self.result.as_json()

    def save_pictures(self, folder: str | Path) -> list[Path]:
        """Write the eigenloci and the matrices as PNG into a folder that exists; returns the paths."""
        from orchestrator.immittance.pictures import draw  # noqa: PLC0415 - a second to import

        return draw(self.result, Path(folder))

    def save(self, folder: Path) -> None:
        """Write ``nyquist.json``, the pictures, and scans that were measured in Z-tool's form."""
        from orchestrator.immittance.ztool import write_ztool  # noqa: PLC0415 - not in Python alone

        save_json(self.as_json(), folder / "nyquist.json")
        self.save_pictures(folder)
        for side, scan in self.result.scans.items():
            if scan.unit == "S":
                write_ztool(scan, folder / f"gfor#Y_AC#{side}-1#.txt")

    def __repr__(self) -> str:
        return f"<Nyquist {self.verdict}: {self.result.because}>"


def parts(result: CutResult) -> Iterator[RenderableType]:
    """What a terminal shows: verdict, margins, where a side is not passive, how far a scan is from the case's own."""
    good = {"stable": True, "unstable": False}.get(str(result.verdict))
    yield VerdictSentence(good, str(result.verdict), result.because).markup()
    rows = [(name, *_cells(getattr(result.judgement.margins, key), text)) for name, key, text in _MARGINS]
    yield make_table("Margins", "Margin", "Value", "at [Hz]", rows=rows)
    for side, bands in result.judgement.active.items():
        said = ", ".join(f"{a:.4g}–{b:.4g} Hz" for a, b in bands) or "nowhere"
        yield escape(f"{side} ({getattr(result.loop, side).name}) not passive: {said}")
    if (far := result.difference) is not None:
        yield (f"The device differs from the case's own by {100 * far['largest_relative']:.2g} % at most, at "
               f"{far['frequency_hz']:.4g} Hz")  # fmt: skip


def _cells(margin: Margin | None, text: str) -> tuple[str, str]:
    return ("none", "") if margin is None else (text.format(margin.value), f"{margin.frequency_hz:.3f}")
