"""Refinement of a POD design on the real closed loop, until the required damping is met or out of reach.

The paper's design stops at a prediction from the sensitivity at a small gain. Here the gain is searched with the mode
itself, and where the gain alone does not do, the lead/lag is centred anew on the mode where it is, with the
sensitivity that it has there. Where that does not do either, settings are searched on the linear models."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.pod_design import lead_lag as leads
from orchestrator.studies.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.studies.pod_design.guard import extremes


@dataclass(frozen=True)
class Judgement:
    """The judgement on a setting: the damping ratio that counts, its prohibited effect on other modes, and the least
    damping ratio of all modes from 0.1 to 2 Hz."""

    damping: float
    broken: str | None
    least: float | None = None


Judge = Callable[[Placed], Judgement]

SearchSettings = Callable[[], Sequence[tuple[str, PodSetting]]]
"""Gives settings to try, each with where it comes from; raises AnalysisError where it cannot search."""

_MOST_STATES = 500  # of a system whose other modes are looked at with every gain
_GAINS = 9
_TURN = 15.0
"""Step of the compensation's angle [°]. Once re-centring no longer helps, the angle is turned by this step to either
side as long as that helps."""
_ROUNDS = 5
_WORTH = 5e-4  # the search ends when a round raises the damping ratio by less than this
_SMALL_GAIN = 0.1  # gain that stands for 0 in the sensitivity at a gain of 0 [pu]
# the search for a gain ends when the damping ratio differs by less than this from the required one
_TOLERANCE = 2e-4


@dataclass(frozen=True)
class GainSweep:
    """The target mode over the range of the gain, with one lead/lag."""

    why: str
    filters: leads.LeadLag
    points: tuple[Placed, ...]
    # the smallest gain that meets the requirement, else the gain of the best damping
    chosen: Placed
    # the gains, that of ``chosen`` too, with which the system is unstable [pu]; empty for systems of more than
    # `_MOST_STATES` states, which are not examined
    unstable: tuple[float, ...] = ()
    # least damping ratio of all modes from 0.1 to 2 Hz at each of the points; empty for such systems
    least: tuple[float, ...] = ()
    chosen_least: float | None = None  # the same with ``chosen``; None where it is not known


@dataclass
class Refinement:
    sweeps: list[GainSweep] = field(default_factory=list)
    # the best setting within the bounds that has no prohibited effect on other modes; None if no such setting exists
    chosen: Placed | None = None
    score: float = -1.0  # damping ratio of ``chosen`` that counts
    met: bool = False  # whether ``chosen`` has the required damping
    # the setting with the best least damping of all modes; None where it is not asked for
    even: Placed | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def best(self) -> Placed:
        """The best damping of all tried settings, whatever their effect on other modes."""
        return max((s.chosen for s in self.sweeps), key=lambda p: p.damping_ratio)


def refine(
    loop: PodLoop,
    off: Placed,
    filters: leads.LeadLag,
    required: float,
    bounds: tuple[float, float],
    judge: Judge,
    search: SearchSettings,
    *,
    evenly: bool = False,
    report: Callable[[str], None] = lambda text: None,
) -> Refinement:
    """Search gain and lead/lag on the closed loop.

    ``required``: damping ratio of the target.
    ``bounds``: of the gain [pu].
    ``search``: gives settings where nothing near the design meets the requirement.
    ``evenly``: whether, where no setting meets the requirement, that with the best least damping of all modes is
    chosen."""
    result = Refinement()
    even = -1.0
    near = ((why, candidate, None) for why, candidate in _candidates(loop, result, filters))
    for why, candidate, gain in chain(near, _searched(result, search)):
        report(f"refinement, lead/lag {why}: {len(result.sweeps)} swept before")
        try:
            found = sweep(
                loop,
                off,
                filters=candidate,
                required=required,
                bounds=bounds,
                why=why,
                special=gain,
            )
        except AnalysisError as error:
            result.notes.append(f"{why}: {error}")
            continue
        found = replace(found, chosen_least=judge(found.chosen).least)
        result.sweeps.append(found)
        for own in (point for point in found.points if point.setting.gain == gain):
            least = judge(own).least
            if evenly and least is not None and least > even and judge(own).broken is None:
                even, result.even = least, own
        allowed = _guarded(loop, found, judge, result.notes)
        if allowed is None:
            continue
        damping, least = judge(allowed).damping, judge(allowed).least
        if evenly and least is not None and least > even:
            even, result.even = least, allowed
        if damping < allowed.damping_ratio:
            result.notes.append(
                f"{why}: at a gain of {allowed.setting.gain:.4g} the target trades places with another mode, which "
                f"then bears its name with {100 * damping:.2f} %"
            )
        if damping > result.score:
            result.score, result.chosen = damping, allowed
        if damping >= required - _TOLERANCE:
            result.met = True
            break
    if not result.met and result.even is not None:
        result.chosen, result.score = result.even, judge(result.even).damping
    return result


def sweep(
    loop: PodLoop,
    off: Placed,
    filters: leads.LeadLag,
    required: float,
    bounds: tuple[float, float],
    why: str,
    special: float | None = None,
) -> GainSweep:
    """The target over the range of the gain, and the gain that meets the requirement or comes nearest to it.

    ``off``: the target with the controller off; following begins there.
    ``required``: damping ratio of the target.
    ``bounds``: of the gain [pu of the converter's rating].
    ``why``: where the lead/lag comes from, for people.
    ``special``: A gain within the bounds that the sweep always includes [pu]."""
    points: list[Placed] = []
    here = off
    for gain in sorted(
        {*np.linspace(*bounds, _GAINS).tolist(), *([] if special is None else [special])}
    ):
        try:
            here = loop.place(here, gain, filters)
        except AnalysisError:
            if not points:
                raise
            break  # the mode could be followed up to this gain, and the sweep ends here
        points.append(here)
    above = next((k for k, p in enumerate(points) if p.damping_ratio >= required), None)
    if above == 0:
        chosen = points[0]
    elif above is not None:
        chosen = _crossing(loop, points[above - 1], points[above], required)
    else:
        chosen = _peak(loop, points)
    unstable, least = _of_all_modes(loop, [*points, chosen])
    return GainSweep(why, filters, tuple(points), chosen, unstable, least[: len(points)])


def _of_all_modes(
    loop: PodLoop, points: Sequence[Placed]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The gains with which the system is unstable, and the least damping ratio of all modes from 0.1 to 2 Hz at each;
    empty for a system with more than `_MOST_STATES` states."""
    if len(loop.model(points[0].setting).names) > _MOST_STATES:
        return (), ()
    found = [extremes(loop.model(point.setting)) for point in points]
    unstable = [
        p.setting.gain for p, (_, growing) in zip(points, found, strict=True) if growing is not None
    ]
    return tuple(unstable), tuple(damping_ratio(weakest) for weakest, _ in found)


def _crossing(loop: PodLoop, low: Placed, high: Placed, required: float) -> Placed:
    """The smallest gain between two that has the required damping: regula falsi that does not stall."""
    for k in range(20):
        if high.damping_ratio - required <= _TOLERANCE:
            break
        share = (required + _TOLERANCE / 2 - low.damping_ratio) / (
            high.damping_ratio - low.damping_ratio
        )
        share = min(max(share, 0.05), 0.95) if k % 3 < 2 else 0.5
        middle = loop.place(low, low.setting.gain + share * (high.setting.gain - low.setting.gain))
        low, high = (low, middle) if middle.damping_ratio >= required else (middle, high)
    return high


def _peak(loop: PodLoop, points: Sequence[Placed]) -> Placed:
    if len(points) == 1:
        return points[0]
    k = max(range(len(points)), key=lambda i: points[i].damping_ratio)
    best, step = points[k], (points[-1].setting.gain - points[0].setting.gain) / (_GAINS - 1)
    low, high = points[0].setting.gain, points[-1].setting.gain
    for _ in range(3):
        step /= 2
        for gain in (best.setting.gain - step, best.setting.gain + step):
            if low <= gain <= high and gain > 0:
                best = max(best, loop.place(best, gain), key=lambda p: p.damping_ratio)
    return best


def _candidates(
    loop: PodLoop, result: Refinement, first: leads.LeadLag
) -> Iterator[tuple[str, leads.LeadLag]]:
    """Lead/lag settings to try; each follows from the results of the sweeps before it."""
    yield "as designed", first
    if first.N_S == 0 or not result.sweeps:
        return
    base = result.sweeps[0].chosen
    for k in range(1, _ROUNDS + 1):
        try:
            candidate = recentred(loop, base)
        except AnalysisError as error:
            result.notes.append(f"re-centring {k}: {error}")
            break
        count = len(result.sweeps)
        yield f"re-centred, round {k}", candidate
        if (
            len(result.sweeps) == count
            or result.sweeps[-1].chosen.damping_ratio < base.damping_ratio + _WORTH
        ):
            break
        base = result.sweeps[-1].chosen
    base = result.chosen or result.best
    for direction in (+1, -1):
        turn, reached = direction * _TURN, result.score
        while (candidate_turned := _turned(base, turn)) is not None:
            yield f"turned by {turn:+.0f}°", candidate_turned
            if result.score < reached + _WORTH:
                break
            turn, reached = turn + direction * _TURN, result.score


def _searched(
    result: Refinement, search: SearchSettings
) -> Iterator[tuple[str, leads.LeadLag, float | None]]:
    """The settings of a search, which is made only if no other setting has met the requirement."""
    try:
        found = search()
    except AnalysisError as error:
        result.notes.append(f"search: {error}")
        return
    for why, setting in found:
        yield why, setting.filters, setting.gain


def _turned(base: Placed, turn: float) -> leads.LeadLag | None:
    """The lead/lag of a setting with another angle, centred on the mode of this setting; None if its stages cannot give
    this angle."""
    filters = base.setting.filters
    total = filters.N_S * filters.stage_angle_deg + turn
    if abs(total) >= leads.LARGEST_TURN * filters.N_S or base.eigenvalue.imag <= 0:
        return None
    return leads.lead_lag_turning(total, base.eigenvalue.imag, filters.N_S)


def recentred(loop: PodLoop, here: Placed) -> leads.LeadLag:
    """The lead/lag by the design's formulas, with the present mode and its present sensitivity."""
    gain, filters = here.setting.gain, here.setting.filters
    change = 0.01 * gain or _SMALL_GAIN
    moved = loop.place(here, gain + change)
    slope = (moved.eigenvalue - here.eigenvalue) / change
    phase = leads.angle_deg(leads.local_non_compensated(slope, here.eigenvalue, filters))
    if here.eigenvalue.imag <= 0:
        raise AnalysisError(
            f"at a gain of {gain:.4g} the mode no longer oscillates, so there is nothing to centre on"
        )
    if abs(leads.compensation_deg(phase)) >= leads.LARGEST_TURN * filters.N_S:
        raise AnalysisError(
            f"the sensitivity at a gain of {gain:.4g} points to {phase:.0f}°, too far for its stages"
        )
    return leads.lead_lag(phase, here.eigenvalue.imag, filters.N_S)


def _guarded(loop: PodLoop, found: GainSweep, judge: Judge, notes: list[str]) -> Placed | None:
    """The sweep's choice, or the largest gain below it without prohibited effect on other modes; None if every gain has
    one."""
    reason = judge(found.chosen).broken
    if reason is None:
        return found.chosen
    notes.append(f"{found.why}: at a gain of {found.chosen.setting.gain:.4g} {reason}")
    good = found.points[0]
    if good.setting.gain >= found.chosen.setting.gain or judge(good).broken is not None:
        return None
    bad = found.chosen
    for _ in range(5):
        middle = loop.place(good, (good.setting.gain + bad.setting.gain) / 2)
        good, bad = (good, middle) if judge(middle).broken else (middle, bad)
    return good
