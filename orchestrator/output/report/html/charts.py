"""Charts for the page: SVG with the figures in it, so that a few lines of script can show them under the pointer."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from zlib import crc32

import numpy as np

from orchestrator.core.arrays import Numbers

# the size of a chart, and the margins around its axes [units of the view box: pixels at full width]
_WIDTH = 720
_HEIGHT = 300
_LEFT = 64
_RIGHT = 14
_TOP = 12
_BOTTOM = 42
_POINTS = 500  # A curve is drawn with about so many points: more than the page has pixels to show


@dataclass(frozen=True)
class ChartCurve:
    label: str
    colour: str
    x: Numbers
    y: Numbers
    dashed: bool = False


@dataclass(frozen=True)
class Mark:
    """A point with a text that appears under the pointer: a cross, or somebody else's figure as a circle."""

    x: float
    y: float
    colour: str
    text: str
    shape: str = "cross"
    large: bool = False


@dataclass
class Frame:
    """Axes: ranges, labels, and the way from values to the picture; ``x_names`` stand at 0, 1, … for numbers."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    x_label: str
    y_label: str
    height: int = _HEIGHT
    x_names: Sequence[str] = ()
    parts: list[str] = field(default_factory=list)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Place of a point on the page [px]."""
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        across, up = (x - x0) / (x1 - x0), (y - y0) / (y1 - y0)
        return _LEFT + across * (_WIDTH - _LEFT - _RIGHT), self.height - _BOTTOM - up * (
            self.height - _TOP - _BOTTOM
        )

    def svg(self, name: str, extra: str = "") -> str:
        right, bottom = _WIDTH - _RIGHT, self.height - _BOTTOM
        grid: list[str] = []
        named = [(float(k), escape(text)) for k, text in enumerate(self.x_names)]
        for value, text in named or _ticks(self.x_range):
            x, _ = self.at(value, self.y_range[0])
            if not named:
                grid.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{bottom}"/>')
            grid.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{text}</text>')
        for value, text in _ticks(self.y_range):
            _, y = self.at(self.x_range[0], value)
            grid.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>')
            grid.append(f'<text x="{_LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
        middle = (_TOP + bottom) / 2
        labels = (
            f'<text class="label" x="{(_LEFT + right) / 2}" y="{self.height - 6}" text-anchor="middle">'
            f"{escape(self.x_label)}</text>"
            f'<text class="label" transform="translate(13 {middle}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y_label)}</text>"
        )
        clip = f"clip-{crc32(f'{name} {self.y_label}'.encode())}"
        window = f'<rect x="{_LEFT}" y="{_TOP}" width="{right - _LEFT}" height="{bottom - _TOP}"/>'
        return (
            f'<svg class="chart" viewBox="0 0 {_WIDTH} {self.height}" role="img" aria-label="{escape(name)}"{extra}>'
            f'<clipPath id="{clip}">{window}</clipPath>{"".join(grid)}'
            f'<g clip-path="url(#{clip})">{"".join(self.parts)}</g>{labels}</svg>'
        )


def line_chart(
    name: str,
    x_label: str,
    y_label: str,
    curves: Sequence[ChartCurve],
    height: int = 210,
    *,
    bands: Sequence[tuple[float, float, str]] = (),
) -> str:
    """Curves over one axis; ``bands``: stretches of it that are shaded, with what stands beside each."""
    x_all = np.concatenate([c.x for c in curves])
    y_all = np.concatenate([c.y for c in curves])
    frame = Frame(_span(x_all, 0.0), _span(y_all, 0.06), x_label, y_label, height)
    for begin, end, text in bands:
        (left, bottom), (right, top) = (
            frame.at(begin, frame.y_range[0]),
            frame.at(end, frame.y_range[1]),
        )
        frame.parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{max(right - left, 1.0):.1f}" height="{bottom - top:.1f}" '
            'fill="currentColor" opacity="0.1"/>'
        )
        frame.parts.append(
            f'<text class="faint" x="{right + 4:.1f}" y="{top + 12:.1f}">{escape(text)}</text>'
        )
    for curve in curves:
        x, y = thinned(curve.x, curve.y)
        points = " ".join(
            f"{px:.1f},{py:.1f}" for px, py in (frame.at(a, b) for a, b in zip(x, y, strict=True))
        )
        dash = ' stroke-dasharray="5 4" class="curve dashed"' if curve.dashed else ' class="curve"'
        values = " ".join(f"{v:.5g}" for v in y)
        abscissa = " ".join(f"{v:.5g}" for v in x)
        frame.parts.append(
            f'<polyline points="{points}" fill="none" stroke="{curve.colour}"{dash} '
            f'data-label="{escape(curve.label)}" data-x="{abscissa}" data-y="{values}"/>'
        )
    x0, x1 = frame.x_range
    across = f' data-kind="lines" data-x0="{x0:.8g}" data-x1="{x1:.8g}" data-left="{_LEFT}"'
    bounds = f' data-right="{_WIDTH - _RIGHT}" data-top="{_TOP}" data-bottom="{height - _BOTTOM}"'
    return frame.svg(name, across + bounds)


def complex_plane(
    name: str,
    marks: Sequence[Mark],
    trajectories: Sequence[ChartCurve] = (),
    highest_hz: float | None = None,
) -> str:
    """Eigenvalues as real part [1/s] against frequency [Hz], with rays of equal damping.

    ``marks``: eigenvalues: x [1/s], y [Hz].
    ``trajectories``: lines in the same units, beneath the marks.
    ``highest_hz``: the axis ends a little above this frequency [Hz]; above the highest mark or line where None."""
    xs = [m.x for m in marks] + [v for t in trajectories for v in t.x.tolist()]
    ys = [m.y for m in marks] + [v for t in trajectories for v in t.y.tolist()]
    top = 1.08 * (highest_hz or max(ys, default=1.0))
    left = min([-0.5, *xs]) * 1.06
    frame = Frame(
        (left, max(0.15, 1.3 * max(xs, default=0.0))),
        (0.0, top),
        "Real part [1/s]",
        "Frequency [Hz]",
        430,
    )
    for percent in (5, 10, 15, 20, 30):
        slope = percent / 100 / math.sqrt(1 - (percent / 100) ** 2) * 2 * math.pi
        end = min(top, -left / slope)
        (x0, y0), (x1, y1) = frame.at(0, 0), frame.at(-slope * end, end)
        frame.parts.append(f'<path class="ray" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>')
        frame.parts.append(
            f'<text class="faint" x="{x1 + 4:.1f}" y="{y1 + 12:.1f}">{percent} %</text>'
        )
    (x0, y0), (_, y1) = frame.at(0, 0), frame.at(0, top)
    frame.parts.append(f'<path class="axis" d="M{x0:.1f} {y0:.1f}V{y1:.1f}"/>')
    for t in trajectories:
        points = " ".join(
            f"{a:.1f},{b:.1f}" for a, b in (frame.at(*v) for v in zip(t.x, t.y, strict=True))
        )
        frame.parts.append(
            f'<polyline points="{points}" fill="none" stroke="{t.colour}" class="curve thin"/>'
        )
    frame.parts += [_mark(m, *frame.at(m.x, m.y)) for m in marks]
    return frame.svg(name)


def bar_chart(
    name: str,
    groups: Sequence[str],
    bars: Sequence[tuple[str, str, Sequence[float]]],
    unit: str = "Participation [%]",
) -> str:
    """Groups of bars: each entry of ``bars`` is a label, a colour and one height a group."""
    top = max((h for *_, heights in bars for h in heights), default=0.0) or 1.0
    frame = Frame((-0.5, len(groups) - 0.5), (0.0, 1.08 * top), "", unit, 220, groups)
    width = 0.8 / max(1, len(bars))
    for k, (label, colour, heights) in enumerate(bars):
        for i, height in enumerate(heights):
            left = i - 0.4 + k * width
            (x0, y0), (x1, y1) = frame.at(left, height), frame.at(left + width, 0)
            text = f"{groups[i]}, {label}: {height:.3g}{' %' * unit.endswith('[%]')}"
            frame.parts.append(
                f'<rect class="tip" x="{x0:.1f}" y="{y0:.1f}" width="{x1 - x0:.1f}" height="{max(0.0, y1 - y0):.1f}" '
                f'fill="{colour}" data-tip="{escape(text)}"/>'
            )
    return frame.svg(name, ' data-kind="bars"')


def thinned(x: Numbers, y: Numbers) -> tuple[Numbers, Numbers]:
    """Fewer points with the same outline: of each stretch, its first, lowest and highest."""
    if len(x) <= _POINTS:
        return x, y
    keep: list[int] = []
    for stretch in np.array_split(np.arange(len(x)), _POINTS // 3):
        keep += sorted(
            {
                int(stretch[0]),
                int(stretch[np.argmin(y[stretch])]),
                int(stretch[np.argmax(y[stretch])]),
            }
        )
    keep.append(len(x) - 1)
    chosen = np.unique(keep)
    return x[chosen], y[chosen]


def legend(entries: Iterable[tuple[str, str]], circles: str = "") -> str:
    """Name the colours; ``circles``: whose figures the circles are, if there are any."""
    items = "".join(
        f'<li><i style="background:{colour}"></i>{escape(label)}</li>' for label, colour in entries
    )
    if circles:
        items += f'<li><i class="ring"></i>{escape(circles)}</li>'
    return f'<ul class="legend">{items}</ul>'


def _mark(mark: Mark, x: float, y: float) -> str:
    tip = f'data-tip="{escape(mark.text)}"'
    if mark.shape == "circle":
        return f'<circle class="tip" cx="{x:.1f}" cy="{y:.1f}" r="8" fill="#fff0" stroke="{mark.colour}" {tip}/>'
    if mark.shape == "dot":
        return f'<circle class="tip" cx="{x:.1f}" cy="{y:.1f}" r="2.2" fill="{mark.colour}" {tip}/>'
    r = 5 if mark.large else 3.4
    cross = f"M{x - r:.1f} {y - r:.1f}l{2 * r} {2 * r}m0 {-2 * r}l{-2 * r} {2 * r}"
    weight = 2.4 if mark.large else 1.2
    return (
        f'<g class="tip" {tip}><path d="{cross}" stroke="{mark.colour}" stroke-width="{weight}"/>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="8" fill="#fff0"/></g>'
    )


def _span(values: Numbers, margin: float) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    if high - low < 1e-12 * max(1.0, abs(high)):
        return low - 0.5 * max(1e-6, abs(low)), high + 0.5 * max(1e-6, abs(high))
    return low - margin * (high - low), high + margin * (high - low)


def _ticks(limits: tuple[float, float]) -> list[tuple[float, str]]:
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415 - half a second to import

    low, high = limits
    values = [
        v
        for v in MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
        if low <= v <= high
    ]
    step = abs(values[1] - values[0]) if len(values) > 1 else abs(high - low) or 1.0
    digits = max(
        0, -math.floor(math.log10(step) + 1e-9) + (1 if f"{step:e}".startswith("2.5") else 0)
    )
    return [(float(v), f"{v + 0.0:.{digits}f}".replace("-", "−")) for v in values]
