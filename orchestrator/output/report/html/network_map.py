"""A network as a picture: buses where their connections put them, coloured by a figure."""

from collections.abc import Callable, Mapping, Sequence
from html import escape

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

from orchestrator.core.arrays import Matrix
from orchestrator.core.units import whole_percent

# the size of the map, and the margin in which labels have room [units of the view box]
WIDTH = 720
HEIGHT = 480
_MARGIN = 46
_LABEL = 110  # from the right edge within which a name stands to the left of its bus
_ROUNDS = 300
_LABELS = 60  # so many buses at most have their names beside them; the pointer shows all


def network_map(
    name: str,
    branches: Sequence[tuple[str, str]],
    heat: Mapping[str, float],
    texts: Mapping[str, str],
    flows: Mapping[tuple[str, str], float] = {},
    *,
    labels: Callable[[str], str] = str,
) -> str:
    """The picture as SVG: branches by their two buses; by bus its heat from 0 (pale) to 1 (red), and what the pointer
    shows; by branch what flows along it, from 0 to 1, as an arrow as wide; ``labels``: what stands beside a bus."""
    buses = list(heat)
    at = dict(zip(buses, places(buses, branches).tolist(), strict=True))
    parts = [
        f'<path stroke="#999" d="M{at[a][0]:.1f} {at[a][1]:.1f}L{at[b][0]:.1f} {at[b][1]:.1f}"/>'
        for a, b in branches
    ]
    for (a, b), part in flows.items():
        parts += _arrow(at[a], at[b], part, f"{a} → {b}: {whole_percent(part)}")
    for bus, place in at.items():
        share = min(max(heat[bus], 0.0), 1.0)
        parts.append(_circle(place, share, texts[bus]))
        if len(buses) <= _LABELS:
            parts.append(_label(place, share, labels(bus)))
    height = _MARGIN + max((y for _, y in at.values()), default=HEIGHT - _MARGIN)
    return (
        f'<svg class="chart" viewBox="0 0 {WIDTH} {height:.0f}" role="img" aria-label="{escape(name)}">'
        f"{''.join(parts)}</svg>"
    )


def _arrow(begin: Sequence[float], end: Sequence[float], part: float, text: str) -> tuple[str, str]:
    """A line as wide as what flows along it, and its head in the middle."""
    (xa, ya), (xb, yb) = begin, end
    mid = np.array([xa + xb, ya + yb]) / 2
    along = np.array([xb - xa, yb - ya]) / (np.hypot(xb - xa, yb - ya) or 1)
    size, across = 5 + 7 * part, np.array([-along[1], along[0]])
    corners = (
        mid + size * along,
        mid - size * (along - 0.6 * across),
        mid - size * (along + 0.6 * across),
    )
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
    return (
        f'<path stroke="#c33" stroke-width="{1 + 5 * part:.1f}" d="M{xa:.1f} {ya:.1f}L{xb:.1f} {yb:.1f}"/>',
        f'<polygon class="tip" points="{points}" fill="#c33" data-tip="{escape(text)}"/>',
    )


def _circle(place: Sequence[float], share: float, text: str) -> str:
    """A bus, larger and redder with its share of the largest heat."""
    x, y = place
    colour = f"rgb({255 - 40 * share:.0f},{240 - 190 * share:.0f},{220 - 180 * share:.0f})"
    return (
        f'<circle class="tip" cx="{x:.1f}" cy="{y:.1f}" r="{6 + 7 * share:.1f}" fill="{colour}" stroke="#555" '
        f'data-tip="{escape(text)}"/>'
    )


def _label(place: Sequence[float], share: float, text: str) -> str:
    """A bus's name on the side where it has room."""
    x, y = place
    side = -1 if x > WIDTH - _LABEL else 1
    anchor = ' text-anchor="end"' if side < 0 else ""
    return (
        f'<text x="{x + side * (8 + 6 * share):.1f}" y="{y - 6:.1f}"{anchor}>{escape(text)}</text>'
    )


def places(buses: Sequence[str], branches: Sequence[tuple[str, str]]) -> Matrix:
    """Points whose distances are like the numbers of branches between buses, by stress majorisation from a circle."""
    n, row = len(buses), {bus: k for k, bus in enumerate(buses)}
    ends = np.array([[row[a], row[b]] for a, b in branches], dtype=int).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
    wanted = shortest_path(links, directed=False, unweighted=True)
    finite = wanted[np.isfinite(wanted)].max(initial=1.0)
    wanted = np.where(np.isfinite(wanted), wanted, finite + 1)
    weight = 1 / np.maximum(wanted, 1.0) ** 2 - np.eye(n)
    inverse = np.linalg.pinv(np.diag(weight.sum(axis=1)) - weight)
    turn = 2 * np.pi * np.arange(n) / max(n, 1)
    points = np.stack([1.6 * np.cos(turn), np.sin(turn)], axis=1) * finite / 2
    for _ in range(_ROUNDS if n > 1 else 0):
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        pull = -weight * wanted / np.maximum(apart, 1e-9)
        np.fill_diagonal(pull, 0.0)
        np.fill_diagonal(pull, -pull.sum(axis=1))
        points = inverse @ (pull @ points)
    main = np.linalg.svd(points - points.mean(axis=0))[2] if n > 1 else np.eye(2)
    points = (points - points.mean(axis=0)) @ main.T
    span = np.maximum(np.ptp(points, axis=0), 1e-9)
    room = np.array([WIDTH - 2 * _MARGIN, HEIGHT - 2 * _MARGIN])
    return np.asarray(_MARGIN + room * (points - points.min(axis=0)) / span)
