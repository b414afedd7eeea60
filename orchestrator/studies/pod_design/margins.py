"""Robustness of a POD setting: margins of its loop, and the effect of small errors in its values on the target.

Phase and delay margin follow from the linear models with two values of the gain K, where the loop is broken. A state
matrix with K in one place is A(K) = A_0 + K·U·Vᵀ, so two models give U·Vᵀ, with a column for each place; what goes
around the loop is L(s) = −K·Vᵀ·(sI − A_0)⁻¹·U, and its eigenvalues turn the closed loop unstable where one of them is
−1."""

import math
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.core.late import optimize
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.modes import ZERO, damping_ratio
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.guard import extremes, weakest_and_growing
from orchestrator.studies.pod_design.lead_lag import LeadLag
from orchestrator.studies.pod_design.one_form import OneForm
from orchestrator.studies.points.store import Arrays

_FREQUENCIES = (0.01, 500.0)  # range of frequencies in which the loop is examined [Hz]
_POINTS_PER_DECADE = 150
_NEGLIGIBLE = 1e-8
"""Singular values of A(K₂) − A(K₁) below this, relative to the largest, are rounding of the linearisation."""


@dataclass(frozen=True)
class LoopMargins:
    """Least changes of a loop that make it unstable, and its largest sensitivity."""

    # least phase shift [°], to either side, that makes the loop unstable; None if the gain around the loop is 1 at no
    # frequency
    phase_deg: float | None
    phase_hz: float | None  # frequency of the oscillation that this phase shift sustains [Hz]
    delay: float | None  # least delay that makes the loop unstable [s]; None as for ``phase_deg``
    delay_hz: float | None  # frequency of the oscillation that this delay sustains [Hz]
    # largest sensitivity 1/|1 + L|: 1 without feedback, above 2 is commonly held to be little
    # robust
    peak: float
    peak_hz: float  # its frequency [Hz]


def loop_margins(half: LinearModel, full: LinearModel) -> LoopMargins:
    """Return the margins of a loop from the continuous models with half of its gain and with all of it."""
    if full.step_size is not None or full.names != half.names:
        raise ValueError("the margins of a loop need two continuous models with the same states")
    if np.linalg.eigvals(full.A).real.max() > ZERO:
        raise AnalysisError("the system is unstable with this gain, so there are no margins")
    around = _Loop(full, *_places(2 * (full.A - half.A)))
    low, high = (2 * math.pi * f for f in _FREQUENCIES)
    grid = np.geomspace(low, high, round(_POINTS_PER_DECADE * math.log10(high / low)) + 1)
    values = np.array([around.eigenvalues(w) for w in grid])
    distance = np.abs(1 + values).min(axis=1)
    crossings = list(_crossings(around, grid, values))
    peak = LoopMargins(
        phase_deg=None,
        phase_hz=None,
        delay=None,
        delay_hz=None,
        peak=float(1 / distance.min()),
        peak_hz=float(grid[distance.argmin()] / (2 * math.pi)),
    )
    if not crossings:
        return peak
    angles = [(abs(math.remainder(np.angle(-value), 2 * math.pi)), w) for w, value in crossings]
    delays = [((np.angle(value) + math.pi) % (2 * math.pi) / w, w) for w, value in crossings]
    (angle, at_angle), (delay, at_delay) = min(angles), min(delays)
    return replace(
        peak,
        phase_deg=math.degrees(angle),
        phase_hz=at_angle / (2 * math.pi),
        delay=float(delay),
        delay_hz=at_delay / (2 * math.pi),
    )


def _places(change: Matrix) -> tuple[Matrix, Matrix]:
    """U and Vᵀ of a change of low rank."""
    rows, columns = (np.flatnonzero(np.abs(change).max(axis=axis)) for axis in (1, 0))
    if not len(rows):
        raise AnalysisError("the gain changes nothing in the linear model, so there is no loop")
    left, sizes, right = np.linalg.svd(change[np.ix_(rows, columns)], full_matrices=False)
    rank = int((sizes > _NEGLIGIBLE * sizes[0]).sum())
    U, V = np.zeros((len(change), rank)), np.zeros((rank, len(change)))
    U[rows], V[:, columns] = left[:, :rank] * sizes[:rank], right[:rank]
    return U, V


class _Loop:
    """L(jω), from the closed loop: with T = Vᵀ·(sI − A)⁻¹·U it is −(I + T)⁻¹·T."""

    def __init__(self, closed: LinearModel, U: Matrix, V: Matrix) -> None:
        self._closed, self._U, self._V = closed, U, V

    def eigenvalues(self, w: float) -> Vector:
        """Return the eigenvalues of L at ω [rad/s], smallest first; their sizes depend continuously on ω."""
        solver = self._closed.shifted(1j * w)
        T = -self._V @ np.column_stack([solver.solve(u) for u in self._U.T])
        found = np.linalg.eigvals(-np.linalg.solve(np.eye(len(T)) + T, T))
        return found[np.argsort(np.abs(found))]


def _crossings(around: _Loop, grid: Vector, values: Vector) -> Iterator[tuple[float, complex]]:
    """Frequencies [rad/s] at which an eigenvalue has the size 1, with the eigenvalue."""
    sizes = np.log(np.abs(values))
    for k in range(values.shape[1]):
        for i in np.flatnonzero(np.sign(sizes[:-1, k]) != np.sign(sizes[1:, k])):
            w = float(
                optimize.brentq(
                    lambda w, k=k: math.log(abs(around.eigenvalues(w)[k])),
                    grid[i],
                    grid[i + 1],
                    rtol=1e-10,
                )
            )
            yield w, complex(around.eigenvalues(w)[k])


_STRIDE = 2**0.5  # factor between two gains that are tried
_REACH = 8.0  # gains from 1/8 to 8 times the designed one are tried
_HALVINGS = 4  # of the step in which a mode is lost: the edge is known to 3 %
# eigenvalues and damping ratios that differ by less, as a part, are one, computed in two ways
_SAME = 1e-6
VARIATION = 0.2  # relative change of K, T_S1 and T_S2, one at a time
LARGER_GAIN = f"K {100 * VARIATION:+.0f} %"


@dataclass(frozen=True)
class Margins:
    # damping ratio below which a mode from 0.1 to 2 Hz, the target included, counts as lost
    limit: float
    # up, down: factor on the gain up to which no mode is lost and no eigenvalue turns unstable; None where that happens
    # neither up to ``reach`` (up) nor down to a gain of 0 (down)
    up: float | None
    down: float | None
    # lost_up, lost_down: the eigenvalue [rad/s] that is lost just beyond ``up`` or ``down``
    lost_up: complex | None
    lost_down: complex | None
    # Phase and delay margin of the loop, broken where the gain acts in all components at once. None if there is no such
    # margin; ``no_loop`` says why.
    loop: LoopMargins | None
    no_loop: str
    # damping ratio of the target by name of the variation, such as ``T_S1 +20 %``; None where it cannot be followed
    variations: dict[str, float]
    reach: float = _REACH


def compute_margins(
    loop: PodLoop, off: Placed, nominal: Placed, least: float, report: Callable[[str], None]
) -> Margins:
    """Return how far the gain may be changed, the margins of the loop, and what other values do to the target.

    ``off``, ``nominal``: the target without the POD and with the designed setting.
    ``least``: damping ratio that every mode should keep; a design that does not reach it keeps its own.
    ``report``: is told what is computed."""
    modes = _ExtremeModes(loop, nominal.setting)
    weakest, fastest = modes.at(nominal.setting)
    limit, growth = min(least, damping_ratio(weakest)), fastest.real if fastest else 0.0

    def lost(factor: float) -> complex | None:
        report(f"margins: all modes with {factor:.3g} times the gain")
        setting = replace(nominal.setting, gain=nominal.setting.gain * factor)
        weakest, fastest = modes.at(setting)
        if fastest and fastest.real > growth:
            return fastest
        return weakest if damping_ratio(weakest) < limit - _SAME else None

    (up, lost_up), (down, lost_down) = (_edge(lost, stride) for stride in (_STRIDE, 1 / _STRIDE))
    report("margins: phase and delay")
    found, why = _margins_of_loop(loop, nominal.setting)
    report("margins: other values of the setting")
    varied = _variations(loop, off, nominal.setting)
    return Margins(
        limit,
        up,
        down=down,
        lost_up=lost_up,
        lost_down=lost_down,
        loop=found,
        no_loop=why,
        variations=varied,
    )


class _ExtremeModes:
    """The least damped mode from 0.1 to 2 Hz and the fastest growing one, by setting.

    In a large system one Schur form gives those of all settings, if it gives those of the nominal one."""

    def __init__(self, loop: PodLoop, nominal: PodSetting) -> None:
        self._loop, self._nominal = loop, nominal
        self._form, self._is_proved = OneForm(loop), False

    def at(self, setting: PodSetting) -> tuple[complex, complex | None]:
        def computed() -> Arrays:
            weakest, fastest = self._by_form(setting) or extremes(self._loop.model(setting))
            return {
                "weakest": np.array(weakest),
                "fastest": np.array([] if fastest is None else [fastest], dtype=complex),
            }

        found = self._loop.figures("extremes", {"setting": astuple(setting)}, computed)
        return complex(found["weakest"]), next(iter(found["fastest"].tolist()), None)

    def _by_form(self, setting: PodSetting) -> tuple[complex, complex | None] | None:
        found = self._form.at(setting)
        if found is None:
            return None
        if not self._is_proved:
            whole = self._loop.spectrum(self._nominal).eigenvalues
            nominal = self._form.at(self._nominal)
            if nominal is None or not _are_alike(self._of(nominal.values), self._of(whole)):
                self._form.fail()
                return None
            self._is_proved = True
        return self._of(found.values)

    def _of(self, values: Complex) -> tuple[complex, complex | None]:
        is_map = self._loop.model(self._nominal).step_size is not None
        return weakest_and_growing(values, step_map=is_map)


def _are_alike(one: tuple[complex, complex | None], other: tuple[complex, complex | None]) -> bool:
    return all(
        a == b or (a is not None and b is not None and abs(a - b) <= _SAME * abs(b))
        for a, b in zip(one, other, strict=True)
    )


def _margins_of_loop(loop: PodLoop, setting: PodSetting) -> tuple[LoopMargins | None, str]:
    try:
        return loop_margins(*loop.continuous_models(setting)), ""
    except AnalysisError as error:
        return None, str(error)


def _edge(
    lost: Callable[[float], complex | None], stride: float
) -> tuple[float | None, complex | None]:
    """The last factor on the gain with which no mode is lost, on the way from 1 to 8, or to 1/8 and then 0; and the
    eigenvalue that is lost beyond it."""
    good, bad = 1.0, stride
    while (what := lost(bad)) is None:
        good = bad
        if not 1.01 / _REACH < good < 0.99 * _REACH:
            bad = 0.0
            if stride > 1 or (what := lost(bad)) is None:
                return None, None
            break
        bad *= stride
    for _ in range(_HALVINGS):
        middle = (good + bad) / 2
        found = lost(middle)
        if found is None:
            good = middle
        else:
            bad, what = middle, found
    return good, what


def _variations(loop: PodLoop, off: Placed, setting: PodSetting) -> dict[str, float]:
    gain, filters = setting.gain, setting.filters
    found = {}
    for sign in (-1, 1):
        factor = 1 + sign * VARIATION
        changed: dict[str, tuple[float, LeadLag]] = {"K": (gain * factor, filters)}
        if filters.T_S1:
            changed["T_S1"] = (gain, replace(filters, T_S1=filters.T_S1 * factor))
            changed["T_S2"] = (gain, replace(filters, T_S2=filters.T_S2 * factor))
        for name, (value, varied) in changed.items():
            found[f"{name} {100 * sign * VARIATION:+.0f} %"] = loop.place(
                off, value, varied
            ).damping_ratio
    return dict(sorted(found.items()))
