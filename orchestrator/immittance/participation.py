"""Where and who: which buses take part where the loop comes near −1, and what each device does there."""

from dataclasses import dataclass

import numpy as np

from orchestrator.immittance.cut import Cut
from orchestrator.immittance.judgement import CutJudgement
from orchestrator.immittance.loop import CutLoop
from orchestrator.immittance.margins import told

_MOST, _APART, _NEAR = 3, 1.15, 0.9
"""Critical frequencies that are told, the least ratio of two of them, and the largest distance."""


@dataclass(frozen=True)
class Critical:
    """A frequency at which the loop comes near −1.

    ``buses``: Shares of the eigenvector of the locus nearest to −1, left times right, by bus; they add up to 1.
    ``devices``: Change of the distance per part by which a device's whole admittance grows: where it is negative, more
    of the device brings the loop nearer."""

    frequency_hz: float
    distance: float
    buses: dict[str, float]
    devices: dict[str, float]


def critical(loop: CutLoop, judgement: CutJudgement, cut: Cut) -> list[Critical]:
    """The least distances from −1 and their frequencies, nearest first."""
    path = judgement.path
    d = np.where(told(path), path.distance, np.inf)
    inner = np.flatnonzero((d <= np.r_[np.inf, d[:-1]]) & (d <= np.r_[d[1:], np.inf]) & (d < _NEAR))
    found: list[int] = []
    for k in inner[np.argsort(d[inner])].tolist():
        if all(abs(np.log(path.hertz[k] / path.hertz[j])) > np.log(_APART) for j in found) and len(found) < _MOST:
            found.append(k)
    return [_at(loop, cut, path.s[k], path.L[k]) for k in found]


def _at(loop: CutLoop, cut: Cut, s: complex, L: np.ndarray) -> Critical:
    here = np.array([s])
    values, right = np.linalg.eig(L)
    nearest = int(np.argmin(np.abs(1 + values)))
    shares = np.abs(np.linalg.inv(right)[nearest] * right[:, nearest]).reshape(-1, 2).sum(axis=1)
    u, sigma, vh = np.linalg.svd(np.eye(len(L)) + L)
    out, into = u[:, -1].conj() @ loop.impedance(here)[0], vh[-1].conj()
    devices = {
        ", ".join(unit.devices): float((out[unit.rows] @ unit.side.at(here)[0] @ into[unit.rows]).real)
        for unit in cut.units
    }
    buses: dict[str, float] = {}
    for (bus, _), share in zip(cut.ports, shares / shares.sum(), strict=True):
        buses[bus] = buses.get(bus, 0.0) + float(share)
    return Critical(float(s.imag / (2 * np.pi)), float(sigma[-1]), buses, devices)
