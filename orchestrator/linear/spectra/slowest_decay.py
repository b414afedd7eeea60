"""The largest real part of a continuous system that decays, found and proved without its whole spectrum.

The eigenvalues of the step map lead there: beside those that decay slowest lie the system's own, which Arnoldi's method
finds. That none is missing is no matter of a search: the turns of the determinant along a line just right of them count
what lies there. If they do not fit, or if anything grows, the whole spectrum is the answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import Search
from orchestrator.linear.spectra.modes import ZERO, index_of_rightmost
from orchestrator.linear.spectra.reduced_network import ReducedNetwork
from orchestrator.linear.spectra.shifted_equations import GROWING, count_growing

LEAST_STATES = 1_000
"""With fewer, all eigenvalues take half a second at most."""

# so many eigenvalues around each point that is looked at
_AROUND = 20
# points to be looked at, at most
_MOST_POINTS = 3
# a mode of the step map that decays by less than this multiple of the slowest may be the system's slowest
_NEAR = 1.25
# the line lies between the slowest decay and 0, by this part of the decay
_MARGIN = 1e-3
# a known eigenvalue nearer to the line than this part of the decay is none to divide out
_CLEAR = 1e-4
# zeros are looked for around this point [rad/s]
_BESIDE_ZERO = 1e-2


@dataclass(frozen=True)
class Decay:
    """No mode of a continuous system grows.

    ``rate``: its largest real part [1/s], zeros left out."""

    rate: float


def decay_of(system: LinearModel, of_map: NDArray[np.complex128]) -> Decay | None:
    """The decay of a large system; None where it is not proved, or where all eigenvalues take no time.

    ``of_map``: all eigenvalues of its step map, or of a system that is much like it [rad/s]."""
    if len(system.names) < LEAST_STATES:
        return None
    network = reduced(system)
    return None if network is None else slowest_decay(system, network, of_map)


def slowest_decay(
    system: LinearModel, network: ReducedNetwork, of_map: NDArray[np.complex128]
) -> Decay | None:
    """The decay of a system whose step map is known; None where it is not proved, and all eigenvalues are needed.

    ``network``: the system's equations, reduced.
    ``of_map``: all eigenvalues of the step map [rad/s]."""
    known = _values_beside(system, of_map)
    rate = float(known.real[np.abs(known) > ZERO].max(initial=-np.inf))
    if not -np.inf < rate < -GROWING:
        return None
    line = (1 - _MARGIN) * rate
    expected = int((known.real > line).sum())
    try:
        found = count_growing(network, network.alone, known, line=line, clear=-_CLEAR * rate)
    except AnalysisError:
        return None
    return Decay(rate) if found == expected else None


def reduced(system: LinearModel) -> ReducedNetwork | None:
    """The equations of a continuous system, reduced; None where this is not worthwhile."""
    try:
        return ReducedNetwork(system)
    except AnalysisError:
        return None


def _values_beside(system: LinearModel, of_map: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Eigenvalues of the system around the slowest of the map, in both half-planes, and its zeros."""
    around_zero = Search(system, complex(_BESIDE_ZERO)).nearest(_AROUND // 2)
    found = [around_zero[np.abs(around_zero) <= ZERO]]
    place = index_of_rightmost(of_map)
    slowest = -np.inf if place is None else of_map[place].real
    waiting = of_map[
        (of_map.real >= _NEAR * slowest) & (of_map.imag >= 0) & (np.abs(of_map) > ZERO)
    ]
    waiting = waiting[np.argsort(-waiting.real)]
    for _ in range(_MOST_POINTS):
        if not len(waiting):
            break
        search = Search(system, complex(waiting[0]))
        values = search.nearest(_AROUND)
        values = values[np.abs(values) > ZERO]
        found += [values[values.imag > 0], values[values.imag > 0].conj(), values[values.imag == 0]]
        waiting = waiting[np.abs(waiting - search.centre) > search.reach]
    return _each_once(np.concatenate(found))


def _each_once(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The values without those that two searches have found."""
    kept: list[complex] = []
    for value in values.tolist():
        if all(abs(value - other) > 1e-6 * max(abs(value), ZERO) for other in kept):
            kept.append(value)
    return np.array(kept, dtype=complex)
