"""The verdict at a cut by the generalised Nyquist criterion, and every reason for which it is not known."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, Vector
from orchestrator.core.options import Option
from orchestrator.studies.black_box.fitting import bands_of
from orchestrator.studies.immittance.loop import NO_MODES, CutLoop, LoopPath, common_range, nodes_of
from orchestrator.studies.immittance.margins import (
    Crossing,
    NyquistMargins,
    crossings_of,
    margins_of,
)
from orchestrator.studies.immittance.scan import block_rotation
from orchestrator.studies.immittance.sides import NEAR_ZERO, Sampled, Side

EXACT_RANGE = (NEAR_ZERO / (2 * np.pi), 20e3)
"""In which two linear models are followed at least [Hz]; beyond, so far as `_BEYOND` times the size of their poles."""

_BEYOND = 30.0
# at the end of the range, from the highest frequency divided by this on, both sides must be passive
_END = 1.5
# or the loci must be smaller than this there: they cannot reach −1
_SMALL = 0.95

# most that det(1 + L) at the lowest frequency is off the real axis, where it begins
_BEGIN = np.deg2rad(60.0)
# what a scan has to hold at least [Hz]: swings, and what filters and delays do
_RANGE = (2.0, 400.0)
# growth of det(1 + L) over the last half of the range of models from which on it does not end there
_SETTLED = 1.5
# part of a matrix that a turn of the frame may change if the scan is the same in all frames
_INVARIANT = 1e-3
_FRAMES = 16  # frames that are tried, over half a turn


class NyquistVerdict(StrEnum):
    STABLE = "stable"
    UNSTABLE = "unstable"
    NOT_KNOWN = "not known"


@dataclass(frozen=True)
class BusJudgement:
    """The same closed system, judged at one bus of several: its devices against all else.

    ``encirclements``, ``by_loci``: As of `CutJudgement`.
    ``without``: Growing modes that are left with these devices away."""

    port: int
    encirclements: int
    by_loci: int
    without: int
    crossings: tuple[Crossing, ...]
    margins: NyquistMargins


@dataclass(frozen=True)
class CutJudgement:
    verdict: NyquistVerdict
    reasons: tuple[str, ...]  # why it is not known
    # number of growing modes, a pair counting twice; None where it is not known
    growing: int | None
    # encirclements, by_loci: of −1 clockwise, by the determinant and by the eigenloci's crossings.
    encirclements: int
    by_loci: int
    open_loop: tuple[complex, ...]  # unstable poles of the two sides [rad/s]
    crossings: tuple[Crossing, ...]
    margins: NyquistMargins
    path: LoopPath
    range_hz: tuple[float, float]
    # bands in which the device, the network and neither side can feed an oscillation [Hz].
    active: dict[str, list[tuple[float, float]]]
    small_gain: list[tuple[float, float]]
    buses: tuple[BusJudgement, ...] = ()  # of an exact cut at several


def judge_loop(
    loop: CutLoop,
    *,
    frames_known: bool = True,
    range_hz: tuple[float, float] | None = None,
    modes: Complex = NO_MODES,
) -> CutJudgement:
    """Count the encirclements, and ask all that could make the count wrong.

    ``modes``: Where the closed system's are known [rad/s], points lie dense around them, too."""
    low, high = range_hz or common_range(loop.device, loop.network, EXACT_RANGE)
    if loop.is_exact and range_hz is None:
        high = max(high, _BEYOND * loop.fastest / (2 * np.pi))
    nodes = nodes_of(loop.device, loop.network, low, high, modes)
    path = loop.path(nodes)
    crossings = crossings_of(path)
    count, by_loci = encirclements(path, exact=loop.is_exact)
    reasons = [*_open_loop(loop), *_resolution(loop, path), *_ends(loop, path)]
    if count != by_loci:
        reasons.append(
            f"the determinant goes round {count} times and the eigenloci {by_loci} times: some loci were not followed "
            "rightly; more frequencies are needed"
        )
    poles = (*loop.device.unstable, *loop.network.unstable)
    growing = count + len(poles)
    if growing < 0:
        reasons.append(
            f"the loop goes round −1 {-count} times against the clock, and its sides show {len(poles)} unstable poles: "
            "one side is unstable by itself, or a scan is not of this system"
        )
    buses = _at_buses(loop, path, growing) if loop.is_exact and path.buses > 1 else ()
    reasons += [reason for bus in buses if (reason := _doubt(loop, bus))]
    if not frames_known and not reasons:
        reasons += _frames(loop, nodes, count)
    verdict = NyquistVerdict.UNSTABLE if growing else NyquistVerdict.STABLE
    verdict = NyquistVerdict.NOT_KNOWN if reasons else verdict
    margins = margins_of(path, crossings)
    active = {
        "device": bands_of(*_active(loop.device)),
        "network": bands_of(*_active(loop.network)),
    }
    small = bands_of(path.hertz, np.linalg.norm(path.L, ord=2, axis=(1, 2)) < 1)
    return CutJudgement(
        verdict,
        tuple(reasons),
        growing=None if reasons else growing,
        encirclements=count,
        by_loci=by_loci,
        open_loop=poles,
        crossings=tuple(crossings),
        margins=margins,
        path=path,
        range_hz=(low, high),
        active=active,
        small_gain=small,
        buses=buses,
    )


def _at_buses(loop: CutLoop, path: LoopPath, growing: int) -> tuple[BusJudgement, ...]:
    """The loop at each bus, of which det(1 + L) of the whole is a factor: what is left over are the growing modes
    without the bus."""
    found = []
    for k in range(path.buses):
        here = path.at_bus(k)
        count, by_loci = encirclements(here, exact=True)
        own = sum(
            len(unit.side.unstable)
            for unit in loop.units
            if set(unit.rows.tolist()) == {2 * k, 2 * k + 1}
        )
        crossings = crossings_of(here)
        found.append(
            BusJudgement(
                k,
                count,
                by_loci,
                growing - count - own,
                tuple(crossings),
                margins_of(here, crossings),
            )
        )
    return tuple(found)


def _doubt(loop: CutLoop, bus: BusJudgement) -> str:
    if bus.encirclements != bus.by_loci:
        return (
            f"at port {bus.port + 1} the determinant goes round {bus.encirclements} times and the eigenloci "
            f"{bus.by_loci} times"
        )
    return (
        f"at port {bus.port + 1} fewer than no modes would grow without its devices"
        if bus.without < 0
        else ""
    )


def _principal(path: LoopPath, k: int) -> float:
    return float(np.angle(1 + path.loci[k]).sum())


def encirclements(path: LoopPath, *, exact: bool) -> tuple[int, int]:
    """Count the clockwise turns around −1 of determinant and eigenloci; ``exact`` if the path goes to infinity."""
    return _count(path, path.turns, exact), _count(path, path.loci_turns, exact)


def _count(path: LoopPath, turns: Numbers, exact: bool) -> int:
    """Clockwise encirclements of the whole axis, of which the path is the upper half, from all turns on it."""
    first, last = _principal(path, 0), _principal(path, -1)
    begin = np.pi * round((first - path.lead) / np.pi)
    end = np.pi * round(last / np.pi) if exact else 0.0
    return -round(float(first - begin + turns.sum() - (last - end)) / np.pi)


def _open_loop(loop: CutLoop) -> list[str]:
    return [
        f"{side.name} shows an unstable pole of its own at {p.real:.3g} ± j{p.imag:.3g} rad/s "
        f"({p.imag / (2 * np.pi):.3g} Hz); a scan of what is stable by itself shows none: scan it again"
        for side in (loop.device, loop.network)
        if not side.is_exact
        for p in side.unstable[:2]
    ]


def _resolution(loop: CutLoop, path: LoopPath) -> list[str]:
    """Return whether what is not known between the points could put an eigenvalue on −1."""
    if loop.is_exact:
        return []
    Y, Z = loop.device.at(path.s), loop.impedance(path.s)
    closed = np.linalg.inv(np.eye(path.L.shape[-1]) + path.L)
    by_y, by_z = (np.linalg.norm(M, ord=2, axis=(1, 2)) for M in (closed @ Z, Y @ closed))
    share = by_y * loop.device.error(path.s) + by_z * loop.network.error(path.s)
    if share.max() < 1:
        return []
    at = path.hertz[int(np.argmax(share))]
    touched = path.hertz[share >= 1]
    return [
        f"from {touched.min():.4g} to {touched.max():.4g} Hz, most at {at:.4g} Hz, the scans do not tell on which side "
        f"of −1 the loop passes: the values between their frequencies are uncertain by {share.max():.2g} times the "
        "distance; scan more frequencies there"
    ]


def _ends(loop: CutLoop, path: LoopPath) -> list[str]:
    """Return whether an encirclement may lie below the lowest or beyond the highest frequency."""
    reasons = []
    first = _principal(path, 0) - path.lead
    if abs(first - np.pi * round(first / np.pi)) > _BEGIN or path.hertz[0] > _RANGE[0]:
        lower = min(_RANGE[0], float(path.hertz[0]) / 2)
        reasons.append(
            f"at {path.hertz[0]:g} Hz the loop is not yet where it begins: scan lower ones, from {lower:.2g} Hz"
        )
    if loop.is_exact:
        last, half = _principal(path, -1), int(np.argmax(path.hertz >= path.hertz[-1] / 2))
        if (
            abs(last - np.pi * round(last / np.pi)) > _BEGIN
            or abs(path.det[-1] / path.det[half]) > _SETTLED
        ):
            reasons.append(f"at {path.hertz[-1]:g} Hz the loop is not yet where it ends")
        return reasons
    top = path.hertz >= path.hertz[-1] / _END
    size = np.abs(path.loci[top]).max(axis=1)
    small = size.max() < _SMALL and size[-1] <= size[0] * 1.01
    passive = not any(
        (_active(side)[1] & (_active(side)[0] >= path.hertz[-1] / _END)).any()
        for side in (loop.device, loop.network)
    )
    early = path.hertz[-1] < _RANGE[1]
    if early or not (small or passive):
        why = (
            "loci may grow again" if early else "neither are both sides passive nor the loci small"
        )
        reasons.append(
            f"beyond {path.hertz[-1]:g} Hz an encirclement may follow: {why} ({size[-1]:.2g}); scan higher "
            f"frequencies, {_RANGE[1]:g} Hz at least"
        )
    return reasons


def _active(side: Side) -> tuple[Numbers, Numbers]:
    """Frequencies [Hz], and whether the side may deliver power there."""
    f = side.frequencies if isinstance(side, Sampled) else np.geomspace(0.01, 1e4, 400)
    M = side.at(2j * np.pi * f)
    least = (
        np.linalg.eigvalsh((M + M.conj().transpose(0, 2, 1)) / 2)[:, 0]
        if M.shape[1] == M.shape[2]
        else np.zeros(1)
    )
    slack = 1e-6 * np.linalg.norm(M, ord=2, axis=(1, 2)) + (
        side.bounds if isinstance(side, Sampled) else 0.0
    )
    return f, np.asarray(least < -slack)


def _frames(loop: CutLoop, nodes: Numbers, count: int) -> list[str]:
    """Return whether the verdict depends on the angle between the two frames, which is not known."""
    device = loop.device
    if not isinstance(device, Sampled) or any(
        _turns_alike(s.at(2j * np.pi * nodes)) for s in (device, loop.network)
    ):
        return []
    for angle in np.linspace(0, np.pi, _FRAMES, endpoint=False)[1:]:  # half a turn changes nothing
        T = block_rotation([angle] * (device.values.shape[-1] // 2))
        turned = replace(loop, device=replace(device, values=T @ device.values @ T.T))
        if encirclements(turned.path(nodes), exact=loop.is_exact)[0] != count:
            return [
                "the verdict depends on the angle between the frames of the two scans, which neither states: give "
                "it by "
                + Option.ANGLE
                + f", or the files _angles.txt (turned by {np.rad2deg(angle):.0f}° it would be another)"
            ]
    return []


def _turns_alike(values: Vector) -> bool:
    J = block_rotation([np.pi / 2] * (values.shape[-1] // 2))
    size = np.linalg.norm(values, ord=2, axis=(1, 2))
    return bool(
        (np.linalg.norm(J @ values @ J.T - values, ord=2, axis=(1, 2)) < _INVARIANT * size).all()
    )
