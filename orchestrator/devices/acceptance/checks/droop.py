"""The droop from reactive power to voltage of a converter, found from what it settles to at a stiff bus."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.devices.acceptance.checks.subject import OperatingAt

POINT = OperatingAt(1.0, 0.0, 0.7, 0.1)
"""With much active power, so that Q follows P at constant voltage and the internal voltage shows in Q."""

ABSORBING = OperatingAt(1.0, 3.0, 0.7, -0.3)
"""As `POINT`, while it takes reactive power, also behind an impedance of 0.25 pu; angles turn beyond half a turn."""

VOLTAGE = 0.02
# changes [pu], up and down; half the difference of both answers has no terms of second order
FREQUENCY = 0.001
CHARGING = OperatingAt(1.0, 0.0, -0.6, 0.1)  # while it takes active power
_FURTHER = (
    OperatingAt(1.0, 0.0, 0.2, 0.02),
    OperatingAt(1.0, 0.0, 0.2, 0.3),
    OperatingAt(1.0, 0.0, -0.5, 0.1),
)
_FURTHER_ABSORBING = (
    OperatingAt(1.0, 0.0, 0.2, -0.25),
    OperatingAt(1.0, 0.0, 0.2, -0.4),
    OperatingAt(1.0, 0.0, -0.5, -0.3),
)

SETTLED = 1e-3  # power [pu, S_n] by which an answer may still move
_BETTER = 0.8  # error of a phasor model, in parts of the law's, up to which it explains the answers as well
_GOOD = 0.2  # largest error of the law, in parts of what the droop does where the frequency changes


def further(point: OperatingAt) -> tuple[OperatingAt, ...]:
    """Points with other powers at which a law is looked for, all with reactive power of the same sign."""
    return tuple(replace(p, v=point.v) for p in (_FURTHER if point.Q >= 0 else _FURTHER_ABSORBING))


@dataclass(frozen=True)
class Way:
    power: complex  # change of the power in the end [pu, S_n]
    moving: float  # how much P and Q still move in the end [pu, S_n]
    far: float  # how far they go away at most [pu, S_n]
    # omega, omega_moving: its frequency in the end, and how much that still moves [pu]; None for an FMU that does not
    # say it
    omega: float | None
    omega_moving: float
    # how far P or Q swings about its course in the middle and in the end, from crest to trough [pu, S_n], and how often
    # that changes its sign in the end
    ringing: tuple[float, float, int]


@dataclass(frozen=True)
class DroopAnswer:
    """Half the difference of what a change up and the same one down bring [pu, S_n], early and settled."""

    i: complex
    early_power: complex
    power: complex
    moving: float
    far: float
    ways: tuple[Way, Way]


def droop(found: Sequence[tuple[OperatingAt, DroopAnswer, DroopAnswer]]) -> float | None:
    """Fall of the voltage behind an impedance per reactive power [pu, S_n]; None where no such law is seen.

    Notes
    -----
    With E = v + (R + jX)·i, the law ΔE = −n·ΔQ holds for changes of the voltage and of the frequency, at all
    operating points, with the same R, X and n. A controller of the voltage at the port, or a machine, does not follow
    it. Q may be measured at the port or behind the impedance.
    """
    if any(answer.moving > SETTLED for _, *answers in found for answer in answers):
        return None
    from scipy.optimize import least_squares  # noqa: PLC0415 - half a second to import

    fits = []
    for inside in (False, True):
        best = least_squares(
            _errors, (0.02, 0.2, 0.0), args=(found, inside), x_scale=(0.01, 0.1, 0.05)
        )
        fits.append((float(np.abs(best.fun).max()), *map(float, best.x)))
    error, resistance, reactance, slope = min(fits)
    moved = min(abs(frequency.power.imag) for _, _, frequency in found[:1])
    if reactance < 0.02 or abs(resistance) > reactance or error > _GOOD * abs(slope) * moved:
        return None
    return None if slope < 0 and _rises_by_its_lag(found, error) else slope


def _rises_by_its_lag(
    found: Sequence[tuple[OperatingAt, DroopAnswer, DroopAnswer]], error: float
) -> bool:
    """Return whether a phasor model, whose current lags and whose reactance is fixed, explains the answers as well.

    ``error``: what the law leaves of the answers [pu]."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - half a second to import

    for inside in (False, True):
        best = least_squares(
            _errors, (0.02, 0.2, 0.0, 0.0), args=(found, inside), x_scale=(0.01, 0.1, 0.05, 1.0)
        )
        if best.x[2] > 0 and float(np.abs(best.fun).max()) < _BETTER * error:
            return True
    return False


def _errors(
    x: NDArray[np.float64],
    found: Sequence[tuple[OperatingAt, DroopAnswer, DroopAnswer]],
    inside: bool,
) -> NDArray[np.float64]:
    """ΔE + n·ΔQ for every answer.

    ``x``: resistance, reactance, droop n [pu]; where a phasor model is meant, also the angle [rad] by which its current
    lags with 1 pu of frequency, and then its reactance is that of rated frequency."""
    resistance, reactance, slope = x[:3]
    errors = []
    for point, *answers in found:
        i_0 = complex(point.P, -point.Q) / point.v
        e_0 = point.v + (resistance + 1j * reactance) * i_0
        for answer, fall, slower in zip(answers, (VOLTAGE, 0.0), (0.0, FREQUENCY), strict=True):
            v, i = point.v * (1 - fall), i_0 + answer.i
            e = v + (resistance + 1j * reactance * (1 - slower)) * i
            if len(x) == 4:
                e = v + (resistance + 1j * reactance) * (1 - 1j * x[3] * slower) * i
            q_0, q = (
                ((e_0 if inside else point.v) * i_0.conjugate()).imag,
                ((e if inside else v) * i.conjugate()).imag,
            )
            errors.append(abs(e) - abs(e_0) + slope * (q - q_0))
    return np.array(errors)
