"""Beside the margin: the short-circuit ratio at a cut, a network that is no more than one, and who takes part where."""

import math
from dataclasses import dataclass, field

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.short_circuit import ShortCircuit
from orchestrator.core.arrays import Complex, Vector
from orchestrator.studies.immittance.cut import Cut
from orchestrator.studies.immittance.judgement import CutJudgement
from orchestrator.studies.immittance.loop import NO_MODES, CutLoop
from orchestrator.studies.immittance.margins import where_distance_counts
from orchestrator.studies.immittance.sides import Known, Side

_MOST = 3  # critical frequencies that are named
_APART = 1.15  # least ratio of two of them
_NEAR = 0.9  # largest distance from −1 of a critical frequency


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
    d = np.where(where_distance_counts(path), path.distance, np.inf)
    inner = np.flatnonzero((d <= np.r_[np.inf, d[:-1]]) & (d <= np.r_[d[1:], np.inf]) & (d < _NEAR))
    found: list[int] = []
    for k in inner[np.argsort(d[inner])].tolist():
        if (
            all(abs(np.log(path.hertz[k] / path.hertz[j])) > np.log(_APART) for j in found)
            and len(found) < _MOST
        ):
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
        ", ".join(unit.devices): float(
            (out[unit.rows] @ unit.side.at(here)[0] @ into[unit.rows]).real
        )
        for unit in cut.units
    }
    buses: dict[str, float] = {}
    for (bus, _), share in zip(cut.ports, shares / shares.sum(), strict=True):
        buses[bus] = buses.get(bus, 0.0) + float(share)
    return Critical(float(s.imag / (2 * np.pi)), float(sigma[-1]), buses, devices)


# relative change of the reactance up to the rated frequency from which on no one impedance is meant
_ALIKE = 0.2


@dataclass(frozen=True)
class SourceBehind(Known):
    """An ideal source behind R + jX, as the impedance that a device sees, in a frame whose q axis leads."""

    name: str
    resistance: float
    reactance: float  # at the rated frequency
    omega: float  # rated frequency [rad/s]
    poles: Complex = field(default_factory=lambda: NO_MODES)

    def at(self, s: Vector) -> Complex:
        along = self.resistance + s * (self.reactance / self.omega)
        cross = np.full(len(s), self.reactance, dtype=complex)
        return np.stack([np.stack([along, -cross], -1), np.stack([cross, along], -1)], -2)


def strengths_of(
    network: Side, hertz: float, base: float | None, prepared: PreparedScenario | None, bus: str
) -> tuple[float | None, dict[str, float], float | None]:
    """Short-circuit power at a cut [MVA], SCR of the converters by bus, and gSCR of all of them; of a case without a
    power flow the first alone, of the network's impedance up to the rated frequency, where it is one."""
    if prepared is not None and prepared.network is not None and prepared.power_flow is not None:
        whole = ShortCircuit.of(prepared)
        found = whole.strengths()
        here = next((b.s_sc_mva for b in found if b.bus == bus.rpartition(".")[2]), None)
        return here, {b.bus: b.scr for b in found if b.scr is not None}, whole.gscr()
    low = network.frequencies[:1] if not network.is_exact else np.array([1e-3])
    Z = network.at(2j * np.pi * np.append(low, max(0.9 * hertz, low[0])))
    if base is None or Z.shape[1] != 2:
        return None, {}, None
    X, R = (Z[:, 1, 0] - Z[:, 0, 1]).real / 2, (Z[0, 0, 0] + Z[0, 1, 1]).real / 2
    one = X[0] > 0 and abs(X[1] - X[0]) < _ALIKE * X[0]
    return (base / math.hypot(R, X[0]) if one else None), {}, None
