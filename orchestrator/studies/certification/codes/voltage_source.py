"""Voltage source behaviour of a device from its admittance: impedance, stiffness, passivity, strength, inertia.

The verdict follows from one number that codes give, MISO's 0.2 pu against a jump of 10° at SCR 3, as it comes to a
spring at the terminals (`asked_stiffness`). No public document at hand gives a limit in frequency; all else is told as
figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag, eigvals

from orchestrator.core.arrays import Complex, Matrix, Numbers, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.output.report.plot_style import STYLE, colour, save_figure
from orchestrator.output.results.storage import save_json, save_table
from orchestrator.studies.black_box.fitting import bands_of, fit, passivity, require_fitting
from orchestrator.studies.black_box.frequency_response import Excitation, FrequencyResponse, measure
from orchestrator.studies.black_box.port import bench_at
from orchestrator.studies.certification.codes.bench_point import STEP
from orchestrator.studies.certification.codes.frequency_domain import (
    AskedStiffness,
    Stiffness,
    asked_stiffness,
    stiffness,
)
from orchestrator.studies.certification.codes.programme import RATING_MVA
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.immittance.judgement import NyquistVerdict, judge_loop
from orchestrator.studies.immittance.loop import CutLoop
from orchestrator.studies.immittance.measured import as_scan
from orchestrator.studies.immittance.placing import sampled
from orchestrator.studies.immittance.strength import SourceBehind

KEY = "frequency"
FIGURES_JSON = "frequency.json"
IMPEDANCE_CSV = "impedance.csv"
PICTURE = "impedance.png"

# at the first operating point, from 0.05 Hz on, where inertia shows
WHOLE = Excitation()
FAST = Excitation(lowest_hz=1.0, lines=90)  # at the others
TOLD = (1.0, 300.0)  # frequencies of impedances and passivity [Hz]
NAMED = (
    1.0,
    5.0,
    10.0,
    25.0,
    50.0,
    100.0,
    300.0,
)  # frequencies at which impedances are printed [Hz]
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
SLOW = 0.5  # highest frequency from which inertia and damping are read [Hz]


Model = tuple[Matrix | Complex, Matrix | Complex, Matrix | Complex, Matrix | Complex]
"""A, B, C and D from the voltage to the current out of a device [pu, s]."""


@dataclass(frozen=True)
class ScannedPoint:
    active: float  # power fed in [pu of the rating]
    reactive: float  # the same
    voltage: float  # at the terminals [pu]

    def __str__(self) -> str:
        return f"P {self.active:g}, Q {self.reactive:g}, V {self.voltage:g} pu"


POINTS = (
    ScannedPoint(0.5, 0.0, 1.0),
    ScannedPoint(0.05, 0.0, 1.0),
    ScannedPoint(0.9, 0.3, 1.0),
    ScannedPoint(0.9, -0.3, 1.0),
    ScannedPoint(0.5, 0.0, 0.95),
)
"""At which a device is measured: half, hardly any and almost full power, reactive power either way, a low voltage."""


@dataclass(frozen=True)
class Impedances:
    """Matrix from the current into a device to its voltage, over frequencies of the rotating frame [Hz].

    ``dq``: d along the voltage, shape (f, 2, 2) [pu of the rating]; ``sequences``: the same by sequences, the positive
    one at the frequency plus the rated one, the mirrored one at the frequency minus it."""

    frequencies: Numbers
    dq: Complex
    sequences: Complex
    f_n: float

    @property
    def reactance(self) -> Numbers:
        """The positive sequence's reactance, brought to the rated frequency [pu]."""
        return np.asarray(
            self.sequences[:, 0, 0].imag * self.f_n / (self.frequencies + self.f_n), dtype=float
        )

    def rows(self) -> list[dict[str, float]]:
        """A row for each frequency: magnitudes [pu] and phases [°]."""
        columns = {"frequency [Hz]": self.frequencies}
        for name, values in (
            ("Z_dd", self.dq[:, 0, 0]),
            ("Z_qq", self.dq[:, 1, 1]),
            ("Z_dq", self.dq[:, 0, 1]),
            ("Z_qd", self.dq[:, 1, 0]),
            ("Z_positive", self.sequences[:, 0, 0]),
            ("Z_mirrored", self.sequences[:, 1, 1]),
        ):
            columns |= {
                f"|{name}| [pu]": np.abs(values),
                f"phase {name} [°]": np.rad2deg(np.angle(values)),
            }
        rows = np.array(list(columns.values())).T.tolist()
        return [dict(zip(columns, row, strict=True)) for row in rows]


def impedances(f: Numbers, admittance: Vector, angle: float, f_n: float) -> Impedances:
    """Impedances of a device.

    ``admittance``: from the voltage to the current out of the device, in the network's frame, shape (f, 2, 2) [pu];
    ``angle``: of its voltage there [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    dq = np.linalg.inv(-(turn @ admittance @ turn.T))
    by_sequences = np.array([[1, 1j], [1, -1j]]) / np.sqrt(2)
    inside = (f >= TOLD[0]) & (f <= TOLD[1])
    dq = dq[inside]
    return Impedances(f[inside], dq, by_sequences @ dq @ by_sequences.conj().T, f_n)


@dataclass(frozen=True)
class Least:
    value: float  # [pu/rad] or [pu/pu]
    at: float  # [Hz]


@dataclass(frozen=True)
class Springs:
    """The parts of a device's powers that oppose a change of its voltage as springs do, where they are least in a band.

    ``angle``: of the active power against the angle [pu/rad]; ``magnitude``: of the reactive power against the relative
    magnitude [pu/pu]. A source behind an impedance has both. A mass, which a control makes of the frequency's rate of
    change, opposes the angle's acceleration: its part is negative at the same size, or positive behind a slow
    measurement, and nothing holds the magnitude."""

    angle: Least
    magnitude: Least
    asked: AskedStiffness

    @property
    def least(self) -> float:
        return min(self.angle.value, self.magnitude.value)

    @property
    def met(self) -> bool:
        return self.least >= self.asked.value


def springs(found: Stiffness, f_n: float) -> Springs:
    """Springs in the band of the criterion of phase jumps.

    What this asks of the angle follows from an impedance, and the same impedance gives the reactive power."""
    asked = asked_stiffness(found, f_n)
    inside = np.flatnonzero(
        (found.frequencies >= asked.band[0]) & (found.frequencies <= asked.band[1])
    )

    def least(name: str) -> Least:
        values = -found.powers[name][inside].real
        k = int(np.argmin(values))
        return Least(float(values[k]), float(found.frequencies[inside[k]]))

    return Springs(least("P/theta"), least("Q/V"), asked)


@dataclass(frozen=True)
class TerminalSwing:
    """Inertia and damping seen from the terminals: −P/ω = D + 2·H·s, fitted up to `SLOW`."""

    inertia: float  # H [s, of the rating]
    damping: float  # D [pu/pu]
    misses: float  # root mean square of what the two do not explain, of that of P/ω


def swing(found: Stiffness) -> TerminalSwing:
    slow = found.frequencies <= SLOW
    values = -found.powers["P/omega"][slow]
    omega = 2 * np.pi * found.frequencies[slow]
    damping = float(values.real.mean())
    inertia = float((values.imag @ omega) / (omega @ omega) / 2)
    rest = values - damping - 2j * omega * inertia
    size = float(np.sqrt((np.abs(values) ** 2).mean()))
    return TerminalSwing(
        inertia, damping, float(np.sqrt((np.abs(rest) ** 2).mean())) / size if size else 0.0
    )


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


@dataclass(frozen=True)
class AtPoint:
    """A device at one operating point. ``swing`` is measured at the first one; ``failure``: why nothing is known."""

    point: ScannedPoint
    failure: str = ""
    springs: Springs | None = None
    impedances: Impedances | None = None
    active_hz: tuple[tuple[float, float], ...] = ()  # where it can feed an oscillation
    strengths: Strengths | None = None
    swing: TerminalSwing | None = None

    def figures(self) -> dict[str, Any]:
        """Figures as JSON's types."""
        given: dict[str, Any] = {
            "P": self.point.active,
            "Q": self.point.reactive,
            "V": self.point.voltage,
            "failure": self.failure,
        }
        if self.springs is None or self.impedances is None or self.strengths is None:
            return given
        z, of = self.impedances, self.springs
        reactances = np.interp(NAMED, z.frequencies, z.reactance).tolist()
        ratios = [vars(one) for one in self.strengths.ratios]
        return given | {
            "met": of.met,
            "springs": {
                "angle": vars(of.angle),
                "magnitude": vars(of.magnitude),
                "asked": of.asked.value,
                "band_hz": list(of.asked.band),
            },
            "reactance": dict(zip(map("{:g}".format, NAMED), reactances, strict=True)),
            "active_hz": [list(band) for band in self.active_hz],
            "strength": {
                "scr_limit": self.strengths.limit,
                "ratios": ratios,
            },
            "swing": None if self.swing is None else vars(self.swing),
        }


SOURCES = (
    "limit: MISO BPM-015 r32 appendix H, 0.2 pu against a jump of 10° at SCR 3, by this program's derivation for the "
    "impedance of a source, seen in P over the angle and in Q over the magnitude; no code says so in frequency",
    "ESIG (September 2025), arXiv 2605.02131, NERC's and AEMO's specifications: their limits in frequency, if "
    "they have any, were not at hand; impedance, passivity, strength, inertia and damping are figures without verdict",
)


def verdict_of(points: Sequence[AtPoint]) -> bool | None:
    """Tell if it is a voltage source at each point; None where one was not measured, or stands in no network.

    A stiff answer alone is no proof: a derivative of a phase-locked loop opposes the angle too, above the loop's own
    bandwidth. Such a device was found stable at no short-circuit ratio."""
    if any(one.springs is not None and not one.springs.met for one in points):
        return False
    return None if any(map(_open_reason, points)) else True


def _open_reason(one: AtPoint) -> str:
    """Say why a point leaves the verdict open; "" if it does not."""
    if one.springs is None:
        return f"it was not measured: {one.failure}"
    if one.strengths is None or one.strengths.limit is not None:
        return ""
    ratios = one.strengths.ratios
    why = next((ratio.why for ratio in ratios if ratio.why), "")
    reason = f" ({why})" if why else ""
    return (
        f"its loop with a network was found stable at no short-circuit ratio from {ratios[0].scr:g} to "
        f"{ratios[-1].scr:g}{reason}, so what it opposes the angle with is no proof"
    )


def sentence_of(points: Sequence[AtPoint]) -> str:
    found = verdict_of(points)
    if found is None:
        point, reason = next((x.point, _open_reason(x)) for x in points if _open_reason(x))
        return f"not judged: at {point} {reason}"
    worst, at = min(
        ((one.springs, one.point) for one in points if one.springs is not None),
        key=lambda pair: pair[0].least,
    )
    low, high = worst.asked.band
    is_one = "it behaves as a voltage source" if found else "it does not behave as a voltage source"
    return (
        f"{is_one} at {len(points)} operating points: from {low:.3g} to {high:.3g} Hz its powers oppose the angle by "
        f"{worst.angle.value:.3g} pu/rad and the magnitude by {worst.magnitude.value:.3g} pu/pu at least ({at}); asked "
        f"{worst.asked.value:.3g} of both"
    )


def measure_points(
    request: CertificationRequest,
    f_n: float,
    report: Callable[[str], None],
    points: Sequence[ScannedPoint] = (),
) -> list[AtPoint]:
    """Measure a device at an ideal bus, at each operating point; at `POINTS` where none is given.

    Raises a `MissingLibraryError` without what fits a model to the admittance."""
    require_fitting()
    found, wanted = [], points or POINTS
    for number, point in enumerate(wanted):
        report(f"Operating point {number + 1} of {len(wanted)}: {point}")
        try:
            found.append(_measured(request, f_n, report, point, number == 0))
        except AnalysisError as error:
            found.append(AtPoint(point, failure=str(error)))
    return found


def _measured(
    request: CertificationRequest,
    f_n: float,
    report: Callable[[str], None],
    point: ScannedPoint,
    slowly: bool,
) -> AtPoint:
    description = bound_fmu(request.fmu, request.binding)
    given: Mapping[str, Any] = {
        "S_n": RATING_MVA,
        "P_0": point.active,
        "Q_0": point.reactive,
        "v_0": point.voltage,
        "theta_0": 0.0,
        "f_n": f_n,
    }
    known = {name: value for name, value in given.items() if name in description.variables}
    bench = bench_at(description, dict(request.values) | known, STEP)
    response = measure(bench, WHOLE if slowly else FAST, report)
    return at_point(point, request.fmu.name, response, complex(*bench.rest), f_n=f_n)


def at_point(
    point: ScannedPoint, name: str, response: FrequencyResponse, voltage: complex, *, f_n: float
) -> AtPoint:
    """Figures of a measured response."""
    stiff = stiffness(response, voltage, f_n)
    passive = passivity(response)
    told = (passive.frequencies >= TOLD[0]) & (passive.frequencies <= TOLD[1])
    active = bands_of(passive.frequencies[told], (passive.index < -passive.bounds)[told])
    f, Y = response.frequencies, response.continuous()
    return AtPoint(
        point,
        springs=springs(stiff, f_n),
        impedances=impedances(f, Y, float(np.angle(voltage)), f_n),
        active_hz=tuple(active),
        strengths=strengths(name, response, voltage, f_n),
        swing=swing(stiff) if f[0] < SLOW else None,
    )


def figures_of(points: Sequence[AtPoint], model: str, f_n: float) -> dict[str, Any]:
    """The result as JSON's types."""
    return {
        "code": KEY,
        "model": model,
        "rated_hz": f_n,
        "verdict": verdict_of(points),
        "sentence": sentence_of(points),
        "sources": list(SOURCES),
        "points": [one.figures() for one in points],
    }


def save(points: Sequence[AtPoint], figures: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write figures, impedances and their picture; returns the files."""
    files = [folder / FIGURES_JSON]
    save_json(dict(figures), files[0])
    measured = [one for one in points if one.impedances is not None]
    rows = [
        {"P": one.point.active, "Q": one.point.reactive, "V": one.point.voltage} | row
        for one in measured
        for row in _rows_of(one)
    ]
    if rows:
        files += [folder / IMPEDANCE_CSV, folder / PICTURE]
        save_table(rows, files[1])
        _plot(measured, files[2])
    return files


def _rows_of(one: AtPoint) -> list[dict[str, float]]:
    return [] if one.impedances is None else one.impedances.rows()


def _plot(points: Sequence[AtPoint], path: Path) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - a second to import
    from matplotlib.figure import Figure  # noqa: PLC0415 - as above

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        size, phase = figure.subplots(2, 1, sharex=True)
        for k, one in enumerate(points):
            assert one.impedances is not None
            f, Z = one.impedances.frequencies, one.impedances.sequences[:, 0, 0]
            size.plot(f, np.abs(Z), ".-", ms=3, color=colour(k), label=str(one.point))
            phase.plot(f, np.rad2deg(np.angle(Z)), ".-", ms=3, color=colour(k))
        size.set(xscale="log", yscale="log", ylabel="|Z| of the positive sequence [pu]")
        size.set_title("Impedance of the device", loc="left")
        size.legend()
        phase.set(ylabel="Phase [°]", xlabel="Frequency in the rotating frame [Hz]")
        save_figure(figure, path)
