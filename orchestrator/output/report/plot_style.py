"""The look that all plots share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.core.safe_files import write_bytes
from orchestrator.output.report.colours import GRID_LINES

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "grid.color": GRID_LINES,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "font.size": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
_DPI = 150
_LEGEND_WIDTH = 96  # characters that fit in a line of a legend, marks included


def add_legend(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Below the axes, in as many columns as the longest label leaves room for."""
    columns = max(1, min(3, _LEGEND_WIDTH // (6 + max(map(len, labels), default=1))))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def save_figure(figure: Figure, path: Path) -> None:
    _to_the_letter(figure)
    picture = BytesIO()
    figure.savefig(picture, dpi=_DPI, format=path.suffix.removeprefix("."))
    write_bytes(path, picture.getvalue())


def _to_the_letter(figure: Figure) -> None:
    """Titles, labels and legends are foreign text: two dollar signs in it begin no formula. Ticks keep theirs."""
    from matplotlib.text import Text  # noqa: PLC0415 - a second to import

    for artist in _apart_from_ticks(figure):
        if isinstance(artist, Text):
            artist.set_parse_math(False)


def _apart_from_ticks(artist: Artist) -> Iterator[Artist]:
    """Yield all that an artist holds; of an axis its label alone, as whoever asks for ticks makes them."""
    from matplotlib.axis import Axis  # noqa: PLC0415 - a second to import

    for child in [artist.label] if isinstance(artist, Axis) else artist.get_children():
        yield child
        yield from _apart_from_ticks(child)
