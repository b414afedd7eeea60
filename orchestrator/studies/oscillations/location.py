"""Which place feeds an oscillation, by three methods that can disagree.

Dissipating energy flow: Maslennikov, Wang and Litvinov, "Dissipating energy flow method for locating the source of
sustained oscillations", Int. J. Electrical Power & Energy Systems 88, 2017. Participation in the dynamic mode that is
fitted to the signals: Schmid, "Dynamic mode decomposition of numerical and experimental data", J. Fluid Mechanics 656,
2010, with left and right vectors. The Q-V phase: what follows its voltage takes reactive power as it rises; what drives
it gives more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.units import whole_percent
from orchestrator.studies.oscillations.detection import SpectralLine, phasors
from orchestrator.studies.oscillations.measurements import Measurements, Site

# names of the methods, as results have them
DEF = "dissipating energy flow"
DYNAMIC_MODE = "dynamic-mode participation"
QV_PHASE = "Q-V phase"

_SHARE = 0.8
"""Part of all that is fed that one place must feed to be named. Over 540 forcings with known places in `two_area` and
`ieee39` the method that applies gives the right place 0.91 and more."""

# what is fed beside what is taken, 0.75 and more with all units in view; with less, others feed too
_BALANCE = 0.7
_CONCENTRATED = 0.9  # participation of one place from which it is no mode's shape
_POWER = 0.16
"""Reactive work beside dissipating work up to which an oscillation acts through active power, and the Q-V phase says
nothing."""

_VOLTAGE = 0.4
"""Reactive work beside dissipating work from which on an oscillation acts through voltage, and energy flow points
elsewhere."""

_LEAST_TOLD = 0.005  # part that is not told as 0 %
_CERTAIN = 3.0  # standard errors by which a figure must exceed zero
_BLOCK_PERIODS = 4  # periods of the oscillation that a block has at least
_MOST_BLOCKS = 8
_SMALL = 0.02  # part of the largest mean power below which its sign says nothing


@dataclass(frozen=True)
class Opinion:
    method: str
    place: str | None  # a place that drives, or None
    applies: bool  # whether it is known to hold for this oscillation
    reason: str
    # places with their part of what is fed, or of the participation, the largest first.
    ranking: tuple[tuple[str, float], ...]
    # whether nothing else drives, which phasors alone never tell: what drives may take energy
    alone: bool = False

    @property
    def others_give(self) -> bool:
        """True if the places take more than they give: parts of what is given say little then."""
        taken = -sum(share for _, share in self.ranking if share < 0)
        return _BALANCE * taken > 1.0


@dataclass(frozen=True)
class _Work:
    """A figure of each place, shape (places,), and its standard error."""

    names: tuple[str, ...]
    values: Numbers
    errors: Numbers

    def opinion(self, method: str, verb: str) -> Opinion:
        mean, error = self.values, self.errors
        fed, taken = float(mean[mean > 0].sum()), float(-mean[mean < 0].sum())
        scale = fed or 1.0
        ranking = tuple((self.names[k], float(mean[k] / scale)) for k in np.argsort(-mean))
        best = int(mean.argmax())
        name, share = self.names[best], float(mean[best] / scale)
        if mean[best] <= _CERTAIN * error[best]:
            return Opinion(
                method, None, True, f"no place {verb} more than the noise explains", ranking
            )
        if share < _SHARE:
            both = ", ".join(f"{n} {whole_percent(x)}" for n, x in ranking[:3] if x > 0)
            return Opinion(method, None, True, f"several places {verb[:-1]} it: {both}", ranking)
        if fed < _BALANCE * taken:
            part = f"{100 * fed / taken:.0f}" if fed > _LEAST_TOLD * taken else "less than 1"
            return Opinion(
                method,
                None,
                True,
                f"what {verb} it is not among the places that are observed: they give {part} % of what they take",
                ranking,
            )
        return Opinion(method, name, True, f"{name} {verb} {whole_percent(share)} of it", ranking)


def opinions(measured: Measurements, found: SpectralLine, others: Sequence[float]) -> list[Opinion]:
    plain = _opinions(measured.candidates, measured, found, others)
    doubtful = _doubtful(measured)
    if doubtful == "all":
        why = "the units together take active power: signs of P or directions of currents may be wrong"
        return [replace(o, place=None, reason=why) for o in plain]
    for name in doubtful:
        for turned in (("p", "q"), ("p",)):
            places = [_turned(p, turned) if p.name == name else p for p in measured.candidates]
            other = {o.method: o for o in _opinions(places, measured, found, others)}
            plain = [_agreed(o, other[o.method], name) for o in plain]
    return plain


def _opinions(
    places: Sequence[Site], measured: Measurements, found: SpectralLine, others: Sequence[float]
) -> list[Opinion]:
    energy, reactive = works(places, measured.times, found, others)
    ratio = float(np.abs(reactive.values).max() / (np.abs(energy.values).max() or 1e-300))
    flow, phase = energy.opinion(DEF, "feeds"), reactive.opinion(QV_PHASE, "drives")
    if ratio <= _POWER:
        why = f"it acts through active power ({whole_percent(ratio)} as much through voltage): says nothing here"
        phase = replace(phase, applies=False, place=None, reason=why)
    elif ratio >= _VOLTAGE:
        why = (
            f"it acts through voltage ({whole_percent(ratio)} of what it does through active power), where energy flow "
            f"is known to point elsewhere{f', here to {flow.place}' if flow.place else ''}"
        )
        flow = replace(flow, applies=False, place=None, reason=why)
    return [flow, dynamic_mode(places, measured.times, found), phase]


def works(
    places: Sequence[Site], times: Numbers, found: SpectralLine, others: Sequence[float]
) -> tuple[_Work, _Work]:
    """Dissipating work Re(ΔP* jΔθ + ΔQ* jΔln V)/2 and reactive work Re(Δln V* ΔQ)/2 of each place.

    They are those of the mean phasors of several blocks, each turned by the phase that all signals share; errors are
    the jackknife's."""
    whole, errors = jackknife(block_phasors(places, times, found, others), _energies)
    names = tuple(place.name for place in places)
    return _Work(names, whole[0], errors[0]), _Work(names, whole[1], errors[1])


def block_phasors(
    places: Sequence[Site], times: Numbers, found: SpectralLine, others: Sequence[float]
) -> Complex:
    """Phasors of p, q, angle and ln v of each place in blocks, turned by the phase that the clear ones share."""
    step = float(times[1] - times[0])
    settle = 0 if found.begin is None else round(2 / (found.frequency * step))
    used = np.arange(min(found.first + settle, found.last - 4), found.last)
    count = int(np.clip(len(used) * step * found.frequency / _BLOCK_PERIODS, 2, _MOST_BLOCKS))
    beside = [found.frequency, *(order * found.frequency for order in found.harmonics), *others]
    signals = np.column_stack(
        [x for p in places for x in (p.p, p.q, p.angle, np.log(np.maximum(p.v, 1e-9)))]
    )
    blocks = np.array(
        [phasors(times[block], signals[block], beside) for block in np.array_split(used, count)]
    )
    clear = {name.replace(".speed", ".angle") for name in [*found.amplitudes][: found.clear]}
    named = [
        name
        for p in places
        for name in (f"{p.name}.p", f"{p.name}.q", f"{p.bus}.angle", f"{p.bus}.v")
    ]
    chosen = blocks[:, [name in clear for name in named]] if clear & {*named} else blocks
    shared = np.linalg.svd(
        chosen / np.maximum(np.abs(chosen).mean(axis=0), 1e-300), full_matrices=False
    )[0][:, 0]
    return np.asarray(blocks * np.exp(-1j * np.angle(shared))[:, None])


def felt_beyond(
    measured: Measurements, found: SpectralLine, others: Sequence[float], name: str
) -> bool:
    """Tell if a voltage at another bus than a place's own moves with it for sure: what drives a grid moves it."""
    (home,) = {place.bus for place in measured.places if place.name == name}
    away = [place.bus != home for place in measured.places]
    whole, errors = jackknife(
        block_phasors(measured.places, measured.times, found, others), lambda mean: mean
    )
    return bool((np.abs(whole) > 2 * _CERTAIN * errors).reshape(-1, 4)[away, 2:].any())


def jackknife(blocks: Complex, figures: Callable[[Complex], Any]) -> tuple[Any, Numbers]:
    """Figures of the mean of all blocks, and their standard errors."""
    count = len(blocks)
    without = np.array([figures(np.delete(blocks, k, axis=0).mean(axis=0)) for k in range(count)])
    spread = np.abs(without - without.mean(axis=0)) ** 2
    return figures(blocks.mean(axis=0)), np.sqrt((count - 1) / count * spread.sum(axis=0))


def _energies(signals: Complex) -> Numbers:
    """Dissipating and reactive work from the phasors of p, q, angle and ln v of each place, shape (2, places)."""
    p, q, angle, lnv = signals.reshape(-1, 4).T
    energy = 0.5 * np.real(np.conj(p) * 1j * angle + np.conj(q) * 1j * lnv)
    return np.array([energy, 0.5 * np.real(np.conj(lnv) * q)])


def dynamic_mode(places: Sequence[Site], times: Numbers, found: SpectralLine) -> Opinion:
    """Participation of each place's powers in the fitted mode at the oscillation's frequency."""
    step = float(times[1] - times[0])
    thin = max(1, round(1 / (12 * found.frequency * step)))
    sizes = [max(float(np.hypot(p.p.mean(), p.q.mean())), 1e-9) for p in places]
    columns = [x / size for p, size in zip(places, sizes, strict=True) for x in (p.p, p.q)]
    data = np.column_stack(columns)[found.first : found.last : thin]
    data = data - data.mean(axis=0)
    delays = 4
    stacked = np.concatenate(
        [data[k : len(data) - delays + k + 1] for k in range(delays)], axis=1
    ).T
    u, s, vh = np.linalg.svd(stacked[:, :-1], full_matrices=False)
    rank = max(2, min(int((s > 1e-2 * s[0]).sum()), 20))
    u, s, vh = u[:, :rank], s[:rank], vh[:rank]
    multipliers, right = np.linalg.eig(u.T @ stacked[:, 1:] @ vh.T / s)
    exponents = np.log(multipliers.astype(complex) + 1e-300) / (thin * step)
    nearest = int(np.abs(exponents - 2j * np.pi * found.frequency).argmin())
    left = np.linalg.pinv(right)[nearest] @ u.T
    part = np.abs(left * (u @ right[:, nearest])).reshape(delays, len(places), 2).sum(axis=(0, 2))
    part = part / part.sum()
    order = np.argsort(-part)
    ranking = tuple((places[k].name, float(part[k])) for k in order)
    name, share = ranking[0]
    if len(places) > 1 and share < _CONCENTRATED:
        why = (
            f"spread as a mode's shape is, most at {name} ({whole_percent(share)}): does not decide"
        )
        return Opinion(DYNAMIC_MODE, None, False, why, ranking)
    return Opinion(DYNAMIC_MODE, name, True, f"{name} has {whole_percent(share)} of it", ranking)


def _doubtful(measured: Measurements) -> list[str] | str:
    """Units that take active power, as wrong signs would make them; "all" where they do together."""
    means = {p.name: float(p.p.mean()) for p in measured.places if p.kind == "unit"}
    if means and sum(means.values()) < 0:
        return "all"
    least = _SMALL * max((abs(m) for m in means.values()), default=0.0)
    return [name for name, mean in means.items() if mean < -least]


def _turned(place: Site, signals: Sequence[str]) -> Site:
    return replace(place, p=-place.p, q=-place.q if "q" in signals else place.q)


def _agreed(one: Opinion, other: Opinion, name: str) -> Opinion:
    """An opinion that holds with the signs of a place as they are and the other way round."""
    if one.place is None or (one.place == other.place and one.applies == other.applies):
        return one
    why = f"{one.reason}, but not if the sign of {name}, which takes active power, is wrong"
    return replace(one, place=None, reason=why)
