"""The swings of a model from those of a similar one, with a check that none is missed.

All eigenvalues of a large system take several times as long. What is searched are the modes from 0.1 to 2 Hz that are
damped less than `LITTLE`; those a little beyond are followed as well, so that what enters is known already."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.mode_refinement import RefinedModes, misses_modes, refine
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, Mode, damping_ratio
from orchestrator.linear.spectra.shifted_equations import ShiftedEquations

LITTLE = 0.2  # damping ratio below which no swing is missed
_BEYOND = 1.3  # factor by which frequencies and damping of what is followed exceed those that count


def search_swings(model: LinearModel) -> RefinedModes:
    """The swings of a model from scratch.

    Raises an `AnalysisError` where the search does not converge."""
    low, high = ELECTROMECHANICAL_HZ
    found = find_critical_modes(model, low / _BEYOND, high * _BEYOND, _BEYOND * LITTLE)
    return swings_among(found, model)


def swings_among(modes: Sequence[Mode], model: LinearModel) -> RefinedModes:
    """Those of known modes that are swings, with the states of a model; a state that they lack is at rest."""
    low, high = ELECTROMECHANICAL_HZ
    wide = [
        mode
        for mode in modes
        if low / _BEYOND <= mode.frequency_hz <= high * _BEYOND
        if mode.damping_ratio <= _BEYOND * LITTLE
    ]
    left, right = (np.zeros((len(model.names), len(wide)), dtype=complex) for _ in range(2))
    for k, mode in enumerate(wide):
        left[:, k] = [mode.left.get(name, 0.0) for name in model.names]
        right[:, k] = [mode.shape.get(name, 0.0) for name in model.names]
    values = np.array([mode.eigenvalue for mode in wide], dtype=complex)
    return RefinedModes(values, left, right, settled=True)


def least_damped_swings(swings: RefinedModes, count: int) -> tuple[RefinedModes, float]:
    """So many of the swings, and the damping ratio below which none is missed where they are followed."""
    dampings = np.array([damping_ratio(value) for value in swings.values.tolist()])
    if len(dampings) <= count:
        return swings, LITTLE
    first = np.argsort(dampings, kind="stable")[:count]
    some = replace(
        swings,
        values=swings.values[first],
        left=swings.left[:, first],
        right=swings.right[:, first],
    )
    return some, float(dampings[first[-1]]) / _BEYOND


def follow_swings(
    model: LinearModel, before: RefinedModes, little: float = LITTLE
) -> RefinedModes | None:
    """The swings of a model from those of a similar one; None where these do not settle, or are not all that have less
    than a damping ratio ``little``."""
    if not len(before.values):
        return None
    low, high = (2 * np.pi * hertz for hertz in ELECTROMECHANICAL_HZ)
    try:
        with one_thread():
            equations = ShiftedEquations(model)
            found = refine(model, equations, before.values, before.left, before.right)
            if not found.settled or misses_modes(equations, found, low, high, little):
                return None
    except (AnalysisError, np.linalg.LinAlgError):
        return None
    return found


def weakest_swing(swings: RefinedModes, little: float = LITTLE) -> complex | None:
    """The least damped one from 0.1 to 2 Hz [rad/s]; None if none of these is damped less than ``little``."""
    low, high = (2 * np.pi * hertz for hertz in ELECTROMECHANICAL_HZ)
    held = [
        value
        for value in swings.values.tolist()
        if low <= value.imag <= high and damping_ratio(value) < little
    ]
    return min(held, key=damping_ratio, default=None)
