"""Critical modes of one operating point, from scratch or from those of another, with a check that none is missed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.doubts.common_speed import is_common_speed
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import DENSE, find_critical_modes, nearest_pairs
from orchestrator.linear.spectra.growth_search import SLOWEST, find_growing_modes
from orchestrator.linear.spectra.mode_refinement import RefinedModes, misses_modes, refine
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import (
    LOCAL_HZ,
    ZERO,
    Mode,
    damping_ratio,
    eigenvalues,
    find_spectrum,
    make_mode,
)
from orchestrator.linear.spectra.shifted_equations import GROWING, ShiftedEquations, count_growing
from orchestrator.linear.spectra.stability import grows
from orchestrator.studies.modes.modes import is_swing
from orchestrator.studies.modes.naming import matching

_BEYOND = 1.3
"""Modes are followed a little beyond the range and the damping that are asked for, so that those which enter are known
already."""

MOST_COUNTED = 4000
"""Up to this number of states, all eigenvalues are computed where growth is counted (5 s of processor time with 3,049
states), and where modes are found anew (7 s, and a search for the critical ones takes 17 s)."""

_BESIDE_ZERO = 1e-2
"""Place [rad/s] beside 0 whose nearest eigenvalues are sought: those that are zero or grow slowly are among them."""

_NEAREST = 6
"""Eigenvalues that are sought there."""

_ONE = 1e-5  # two eigenvalues that differ by less than this part are one, computed in two ways

MOST_REFINED = 64
"""Modes of a neighbour of a large system, above which a search anew is cheaper.

A round of refinement factorises at each group of them and solves for each from both sides: 285 modes of 11,330 states
had not settled after 109 s, and a search takes 39 s."""

_MOST = 0.9
MOST_DAMPING = 0.6  # damping ratio up to which modes are looked for
UNSTABLE = 1e-6  # A real part above this [1/s] is growth and not rounding


@dataclass(frozen=True)
class CriticalRegion:
    """Which modes are looked for: frequencies [Hz], and the damping ratio below which a mode is critical."""

    lowest_hz: float
    highest_hz: float
    damping: float

    def holds(self, value: complex) -> bool:
        hertz = value.imag / (2 * np.pi)
        return self.lowest_hz <= hertz <= self.highest_hz and damping_ratio(value) <= self.damping

    @property
    def wider(self) -> "CriticalRegion":
        damping = min(_MOST, _BEYOND * self.damping)
        return CriticalRegion(self.lowest_hz / _BEYOND, self.highest_hz * _BEYOND, damping)


@dataclass(frozen=True)
class FoundModes:
    modes: ModeSet
    searched: bool  # whether they come from a search of their own rather than from a neighbour's
    # number of growing eigenvalues that are none of these modes; None where they were not counted
    growing_elsewhere: int | None
    # the one of them with the largest real part [rad/s]; None where there is none, or they were only counted
    fastest: complex | None = None
    # number of eigenvalues that are zero, where growth was counted: one may be the free angle
    zeros: int = 0
    # Growth [1/s] from which it was counted at all frequencies; slower growth was sought in the range and near 0 only.
    # 0 where all eigenvalues are known.
    slowest: float = 0.0
    # whether swings of machines were looked for above the range, up to `LOCAL_HZ`, and the least damped one
    looked_above: bool = False
    above: Mode | None = None
    # whether the fastest of those that grow elsewhere is the drift of the common speed
    drifts: bool = False

    def critical(self, wanted: CriticalRegion) -> list[int]:
        held = [k for k, value in enumerate(self.modes.eigenvalues.tolist()) if wanted.holds(value)]
        return sorted(held, key=lambda k: damping_ratio(complex(self.modes.eigenvalues[k])))

    @property
    def grows(self) -> bool:
        return bool((self.modes.eigenvalues.real > UNSTABLE).any()) or bool(self.growing_elsewhere)


def find_modes_here(
    model: LinearModel,
    alone: Vector,
    wanted: CriticalRegion,
    neighbour: ModeSet | None,
    *,
    count: bool,
    speeds: Sequence[str] = (),
) -> FoundModes:
    """The modes of an operating point.

    ``alone``: eigenvalues of the components alone [rad/s], as `count_growing` takes them.
    ``neighbour``: modes of a similar operating point; None searches from scratch.
    ``speeds``: patterns of the states that swing with machines, for what lies above the range of a small system, and
    for the drift of the common speed.
    ``count``: whether all growing eigenvalues are counted, at any frequency. Small systems always are.
    Raises an `AnalysisError` if neither the search nor the growth that is counted comes to an end, and the system is
    too large for all of its eigenvalues."""
    if len(model.names) <= DENSE:
        return _whole(model, wanted, speeds, looks_above=True)
    equations = ShiftedEquations(model)
    found = None if neighbour is None else _from_neighbour(model, equations, wanted, neighbour)
    searched = found is None
    if found is None:
        if len(model.names) <= MOST_COUNTED:
            return _whole(model, wanted, speeds)
        found = _from_search(model, equations, wanted)
    if not count:
        return FoundModes(found, searched, None)
    if len(model.names) <= MOST_COUNTED:
        return _with_drift(model, _counted_among_all(model, found, searched=searched), speeds)
    if model.is_searched_in_blocks:
        return _with_drift(model, _counted_by_search(model, found, searched=searched), speeds)
    zeros, slow = _near_zero(model, found)
    return FoundModes(
        found, searched, _elsewhere(equations, alone, found) + slow, None, zeros, GROWING
    )


def _from_search(
    model: LinearModel, equations: ShiftedEquations, wanted: CriticalRegion
) -> ModeSet:
    """The modes from a search over the region, or from all eigenvalues where it has missed some."""
    wide = wanted.wider
    found = ModeSet.of(
        find_critical_modes(model, wide.lowest_hz, wide.highest_hz, wide.damping), model.names
    )
    missed = misses_modes(equations, _columns(found), *_radians(wanted), wanted.damping)
    if not missed:
        return found
    if model.is_searched_in_blocks:
        raise AnalysisError(
            f"the search for critical modes missed some, the first near {missed[0]:.4g} rad/s, and the system is too "
            "large for all of its eigenvalues; look at fewer with a narrower range of frequencies or less damping"
        )
    return _whole(model, wanted).modes


def _from_neighbour(
    model: LinearModel, equations: ShiftedEquations, wanted: CriticalRegion, neighbour: ModeSet
) -> ModeSet | None:
    """The neighbour's modes as they are here; None where these do not settle, are not all, or are too many."""
    count = len(neighbour.eigenvalues)
    if not count or (model.is_searched_in_blocks and count > MOST_REFINED):
        return None
    start = _columns(_with_names(neighbour, model.names))
    try:
        refined = refine(model, equations, start.values, start.left, start.right)
        if not refined.settled or misses_modes(
            equations, refined, *_radians(wanted), wanted.damping
        ):
            return None
    except (AnalysisError, np.linalg.LinAlgError):
        return None
    return _modes_within(
        ModeSet(refined.values, refined.left.T, refined.right.T, model.names), wanted
    )


def _with_names(modes: ModeSet, names: tuple[str, ...]) -> ModeSet:
    """The same modes with the states of another model; a state that they lack is at rest."""
    if modes.names == names:
        return modes
    place = {name: k for k, name in enumerate(modes.names)}
    to = [k for k, name in enumerate(names) if name in place]
    of = [place[names[k]] for k in to]
    left, right = (np.zeros((len(modes.eigenvalues), len(names)), dtype=complex) for _ in range(2))
    left[:, to], right[:, to] = modes.left[:, of], modes.right[:, of]
    return ModeSet(modes.eigenvalues, left, right, names)


def _modes_within(modes: ModeSet, wanted: CriticalRegion) -> ModeSet:
    wider = wanted.wider
    held = [k for k, value in enumerate(modes.eigenvalues.tolist()) if wider.holds(value)]
    held.sort(key=lambda k: damping_ratio(complex(modes.eigenvalues[k])))
    return replace(
        modes, eigenvalues=modes.eigenvalues[held], left=modes.left[held], right=modes.right[held]
    )


def _whole(
    model: LinearModel,
    wanted: CriticalRegion,
    speeds: Sequence[str] = (),
    *,
    looks_above: bool = False,
) -> FoundModes:
    """The modes among all eigenvalues.

    ``looks_above``: whether swings of machines are looked for above the range as well."""
    highest = wanted.wider.highest_hz
    spectrum = find_spectrum(
        model, wanted.wider.lowest_hz, max(highest, LOCAL_HZ) if looks_above else highest
    )
    swinging = [mode for mode in spectrum.modes if mode.is_oscillation]
    modes = _modes_within(ModeSet.of(swinging, model.names), wanted)
    found = _among(spectrum.eigenvalues, model, modes, searched=True)
    rightmost = spectrum.rightmost
    drifts = (
        rightmost is not None
        and rightmost.eigenvalue == found.fastest
        and is_common_speed(rightmost, matching(model.names, speeds))
    )
    found = replace(found, drifts=drifts)
    if not looks_above:
        return found
    return replace(found, looked_above=True, above=_swing_above(swinging, wanted, speeds))


def _swing_above(
    swinging: Sequence[Mode], wanted: CriticalRegion, speeds: Sequence[str]
) -> Mode | None:
    """The least damped swing of machines above the range, up to `LOCAL_HZ`."""
    higher = [
        mode
        for mode in swinging
        if wanted.highest_hz < mode.frequency_hz <= LOCAL_HZ and is_swing(mode, speeds)
    ]
    return min(higher, key=lambda mode: mode.damping_percent, default=None)


def _with_drift(model: LinearModel, found: FoundModes, speeds: Sequence[str]) -> FoundModes:
    """The same, told whether what grows fastest beside the modes is the drift of the common speed."""
    if found.fastest is None or found.fastest.imag or not speeds:
        return found
    # at an eigenvalue itself nothing can be solved
    beside = complex(found.fastest.real + _BESIDE_ZERO)
    ((value, left, right),) = nearest_pairs(model.coupled, beside, 1)
    mode = make_mode(complex(value.real), left, right, model.names)
    return replace(found, drifts=is_common_speed(mode, matching(model.names, speeds)))


def _counted_among_all(model: LinearModel, modes: ModeSet, *, searched: bool) -> FoundModes:
    """The modes with what grows beside them among all eigenvalues, which take less than a count along the axis."""
    with one_thread():
        return _among(eigenvalues(model), model, modes, searched=searched)


def _among(values: Vector, model: LinearModel, modes: ModeSet, *, searched: bool) -> FoundModes:
    """The modes with what grows beside them among all eigenvalues of the model."""
    zeros = int((np.abs(values) <= ZERO).sum()) - len(model.unmoved)
    return FoundModes(modes, searched, *_others(values[grows(values)], modes), zeros)


def _counted_by_search(model: LinearModel, modes: ModeSet, *, searched: bool) -> FoundModes:
    """The modes with what grows beside them by a search of the right half-plane.

    With many vectors at once it takes seconds where a count along the axis factorises a hub at thousands of points."""
    growing = np.array(find_growing_modes(model).eigenvalues, dtype=complex)
    number, fastest = _others(growing, modes)
    zeros, slow = _near_zero(model, modes, SLOWEST)
    return FoundModes(modes, searched, number + slow, fastest, zeros, SLOWEST)


def _others(growing: Vector, modes: ModeSet) -> tuple[int, complex | None]:
    """How many growing eigenvalues are none of the modes, where a pair counts twice, and the fastest of them."""
    known = [
        np.abs(modes.eigenvalues - one).min(initial=np.inf) <= _ONE * abs(one) for one in growing
    ]
    others = growing[~np.array(known, dtype=bool)]
    fastest = complex(others[np.argmax(others.real)]) if len(others) else None
    return int((1 + (others.imag > 0)).sum()), fastest


def _elsewhere(equations: ShiftedEquations, alone: Vector, found: ModeSet) -> int:
    known = 2 * int((found.eigenvalues.real > GROWING).sum())
    return max(0, count_growing(equations, alone, found.eigenvalues) - known)


def _near_zero(
    model: LinearModel, found: ModeSet, searched_from: float | None = None
) -> tuple[int, int]:
    """How many eigenvalues are zero, and how many others near 0 grow too slowly to be counted; a pair counts twice.

    ``searched_from``: size [rad/s] from which eigenvalues were searched, where they were not counted along the axis."""
    # Arnoldi's method finds one copy of a zero that many have, and the nearest six would be clocks where there are six.
    values = np.array(
        [value for value, _, _ in nearest_pairs(model.coupled, complex(_BESIDE_ZERO), _NEAREST)]
    )
    zeros = np.abs(values) <= ZERO
    left_out = values.real <= GROWING if searched_from is None else np.abs(values) < searched_from
    slow = values[~zeros & (values.real > UNSTABLE) & left_out]
    known = [
        value for value in slow if np.abs(found.eigenvalues - value).min(initial=np.inf) < ZERO
    ]
    # Arnoldi's method gives a real one an imaginary part of rounding, of either sign.
    upper = [value for value in slow.tolist() if value.imag > -ZERO and value not in known]
    return int(zeros.sum()), sum(1 + (value.imag > ZERO) for value in upper)


def _columns(modes: ModeSet) -> RefinedModes:
    return RefinedModes(modes.eigenvalues, modes.left.T, modes.right.T, settled=True)


def _radians(wanted: CriticalRegion) -> tuple[float, float]:
    return 2 * np.pi * wanted.lowest_hz, 2 * np.pi * wanted.highest_hz


def residue(modes: ModeSet, entry: Vector, exit: Vector) -> NDArray[np.complex128]:
    """Residue of each mode in the transfer from an entry to an exit, shape (m,) [rad/s, by the units of both].

    ``entry`` and ``exit``: column of B and row of C for the whole system, shape (n,)."""
    norms = np.einsum("ij,ij->i", modes.left.conj(), modes.right)
    return np.asarray((modes.left.conj() @ entry) * (modes.right @ exit) / norms, dtype=complex)
