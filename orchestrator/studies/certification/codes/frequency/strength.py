"""Stability and margins of a device at a source behind an impedance, over a range of short-circuit ratios."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigvals

from orchestrator.core.arrays import Complex, Matrix
from orchestrator.studies.black_box.fitting import fit
from orchestrator.studies.black_box.frequency_response import FrequencyResponse
from orchestrator.studies.certification.codes.frequency.figures import TOLD
from orchestrator.studies.immittance.judgement import NyquistVerdict, judge_loop
from orchestrator.studies.immittance.loop import CutLoop
from orchestrator.studies.immittance.measured import as_scan
from orchestrator.studies.immittance.placing import sampled
from orchestrator.studies.immittance.strength import SourceBehind

RATIOS = (
    20.0,
    10.0,
    5.0,
    3.0,
    2.0,
    1.5,
    1.25,
)  # short-circuit ratios: those of MISO's steps, and 5
X_R = 6.0  # of the source behind them, as on the bench of the codes
Model = tuple[Matrix | Complex, Matrix | Complex, Matrix | Complex, Matrix | Complex]
"""A, B, C and D from the voltage to the current out of a device [pu, s]."""


@dataclass(frozen=True)
class AtRatio:
    """A device at a source behind an impedance.

    ``verdict``, ``distance``, ``at``: by the generalised Nyquist criterion, with the least singular value of 1 + L and
    its frequency [Hz]; None where they are not known. ``damping``, ``frequency``: of the least damped mode up to 300 Hz
    [%, Hz], by the model that was fitted to the measured admittance; None where there is no such mode."""

    scr: float
    verdict: str
    why: str
    distance: float | None
    at: float | None
    damping: float | None
    frequency: float | None


@dataclass(frozen=True)
class Strengths:
    ratios: tuple[AtRatio, ...]
    # SCR at which the loop is lost, from the margin at the first stable ratio as `gfor fmu nyquist` has it; 0 where it
    # never is, None where no ratio was found stable
    limit: float | None


def strengths(name: str, response: FrequencyResponse, voltage: complex, f_n: float) -> Strengths:
    """The loop and the margins of `gfor fmu nyquist --scr`, over a range of ratios."""
    device, model = sampled(as_scan(name, response, voltage)), _continuous(response)
    found: list[AtRatio] = []
    limit = None
    for scr in RATIOS:
        X = float(1 / (scr * np.hypot(1.0, 1 / X_R)))
        judged = judge_loop(
            CutLoop(device, SourceBehind(f"SCR {scr:g}", X / X_R, X, 2 * np.pi * f_n))
        )
        least = None if judged.reasons else judged.margins.distance
        if limit is None and judged.verdict is NyquistVerdict.STABLE:
            up = judged.margins.gain_up
            limit = 0.0 if up is None else scr / up.value
        damping, frequency = least_damped(closed_loop(model, X / X_R, X, f_n))
        found.append(
            AtRatio(
                scr=scr,
                verdict=str(judged.verdict),
                why="; ".join(judged.reasons),
                distance=None if least is None else least.value,
                at=None if least is None else least.frequency_hz,
                damping=damping,
                frequency=frequency,
            )
        )
    return Strengths(tuple(found), limit)


def _continuous(response: FrequencyResponse) -> Model:
    """The model fitted to a response, without the hold of its inputs, diagonal in A."""
    model = fit(response)
    mu, V = np.linalg.eig(model.A)
    poles = np.log(mu.astype(complex)) / model.step_size
    rise = np.where(np.abs(mu - 1) < 1e-12, 1 / model.step_size, poles / (mu - 1))
    B = rise[:, None] * np.linalg.solve(V, model.B.astype(complex))
    return np.diag(poles), B, model.C @ V, model.D


def closed_loop(model: Model, R: float, X: float, f_n: float) -> Complex:
    """Eigenvalues [1/s] of a device at a source behind R + jX [pu].

    The unknowns are the device's states, its voltage, and its current, whose rate of change the impedance's inductance
    makes part of the voltage."""
    A, B, C, D = model
    states = len(A)
    L = X / (2 * np.pi * f_n)
    Z = np.array([[R, -X], [X, R]])
    none, one = np.zeros((2, 2)), np.eye(2)
    F = np.block(
        [
            [A, B, np.zeros((states, 2))],
            [C, D, -one],
            [np.zeros((2, states)), one, -Z],
        ]
    )
    E = block_diag(np.eye(states), none, L * one)
    found = eigvals(F, E)
    return np.asarray(found[np.isfinite(found)])


def least_damped(values: Complex) -> tuple[float | None, float | None]:
    """Damping [%] and frequency [Hz] of the least damped mode whose frequency is told."""
    hertz = values.imag / (2 * np.pi)
    inside = values[(hertz > 0.1) & (hertz <= TOLD[1])]
    if not len(inside):
        return None, None
    ratios = -inside.real / np.abs(inside)
    k = int(np.argmin(ratios))
    return float(100 * ratios[k]), float(inside[k].imag / (2 * np.pi))
