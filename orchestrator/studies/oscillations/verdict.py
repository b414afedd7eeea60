"""The oscillations of a record with what they are and where they come from."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.units import whole_percent
from orchestrator.studies.oscillations.close_lines import doubt, most_explained, skirt
from orchestrator.studies.oscillations.detection import (
    Signals,
    SpectralLine,
    envelope,
    find_oscillations,
    phasors,
    signals_of,
)
from orchestrator.studies.oscillations.location import (
    DEF,
    DYNAMIC_MODE,
    QV_PHASE,
    Opinion,
    felt_beyond,
    opinions,
)
from orchestrator.studies.oscillations.measurements import Measurements
from orchestrator.studies.oscillations.models import OWN_MODEL, UnitModels, own_models

OscillationKind = Literal["forced", "mode", "not known"]

_STRONGEST = 5
_FEWEST_PERIODS = 8
# spread of the envelope as a part of its mean: of filtered noise it is 0.52
_STEADY = 0.25  # below it is a sine's
_RESTLESS = 0.35  # above it is not

_TREND = 0.7  # part of the envelope's variance that an exponential must explain to be one
_SINE = 1.85  # fourth moment beside the square of the second: 1.5 of a sine, 3 of noise
# of the largest amplitude of its kind, from which a signal is looked at for disturbances
_LEAST_PART = 0.2

_CLEAN = 0.04
"""Spread of the envelope up to which nothing else is asked."""

_SKIRT = 5.0
"""Factor by which what is left beside a line may fall from near it to further off where the envelope spreads more: it
falls by more beside a mode with next to no damping that noise shakes."""

_SHOCK = 6.0  # deviation at the begin, in amplitudes, that a forcing's own transient does not reach
_COHERENT = 0.975
# part of the envelope's power from which on two sines explain it; of a mode of 3 % in noise 0.4 to
# 0.87
_PAIR = 0.87
# change of the amplitude over the window from which on an oscillation decays or grows
_CHANGE = 0.25


@dataclass(frozen=True)
class Evidence:
    kind: OscillationKind
    damping_percent: float  # from the envelope; negative where it grows
    envelope_spread: float  # standard deviation of the envelope as a part of its mean
    kurtosis: float  # 1.5 of a sine, 3 of noise
    # length of the mean phasor beside the phasors' mean length: 1 where the phase stays
    coherence: float
    skirt: float  # power beside the line as a multiple of that further off
    periods: float
    disturbed: bool  # whether it begins with a step or a shock in the signals
    reasons: tuple[str, ...]  # in words


def evidence_of(signals: Signals, found: SpectralLine) -> Evidence:
    """Return the figures of an oscillation's envelope, and the kind of oscillation that they speak for."""
    f, step = found.frequency, float(signals.times[1] - signals.times[0])
    settle = 0 if found.begin is None else round(2 / (f * step))
    used = slice(min(found.first + settle, found.last - 2), found.last)
    columns = [
        *map(signals.names.index, [*found.amplitudes][: min(found.clear or _STRONGEST, _STRONGEST)])
    ]
    t = signals.times[used]
    periods = len(t) * step * f
    if periods < _FEWEST_PERIODS:
        return _too_short(periods, t, settles=settle > 0, sinks=found.last < len(signals.times))
    seen, envelopes = [], []
    for k in columns:
        z, half = envelope(t, signals.values[used, k], f)
        late = t[half : len(t) - half]
        envelopes.append(z)
        seen.append(_figures_of_envelope(z, late, f))
    beside = float(np.median([skirt(t, signals.values[used, k], [f]) for k in columns]))
    spread, kurtosis, coherence, slope, change, pair = np.median(seen, axis=0).tolist()
    damping = float(-100 * slope / np.hypot(slope, 2 * np.pi * f))
    shocked = _disturbed(signals, found)
    figures = Evidence(
        "not known",
        damping,
        envelope_spread=spread,
        kurtosis=kurtosis,
        coherence=coherence,
        skirt=beside,
        periods=periods,
        disturbed=shocked,
        reasons=(),
    )
    kind, reasons = _judge(figures, change, pair, found)
    if kind != "not known":
        shown = signals.values[used][half : len(t) - half, columns]
        other = doubt(kind, late, np.column_stack(envelopes), shown, f)
        kind, reasons = ("not known", [f"{reasons[0]}, but {other}"]) if other else (kind, reasons)
    return replace(figures, kind=kind, reasons=tuple(reasons))


def _too_short(periods: float, times: Numbers, *, settles: bool, sinks: bool) -> Evidence:
    """``times``: those at which it can be judged; ``settles``: whether two periods after its begin are left out;
    ``sinks``: whether the record goes on."""
    after = ", two periods after it begins," if settles else ""
    until = ", when less than half of it is left" if sinks else ""
    return Evidence(
        "not known",
        0.0,
        envelope_spread=0.0,
        kurtosis=0.0,
        coherence=0.0,
        skirt=0.0,
        periods=periods,
        disturbed=False,
        reasons=(
            f"it can be judged from {times[0]:.1f} s{after} to {times[-1]:.1f} s{until}: {periods:.1f} periods, "
            f"and {_FEWEST_PERIODS} are needed to tell a driven oscillation from one that decays",
        ),
    )


def _figures_of_envelope(z: Numbers, times: Numbers, frequency: float) -> list[float]:
    """Figures of the complex amplitude z of one signal over the time.

    Spread of its size, kurtosis, coherence; slope of its logarithm [1/s], and the change that an exponential makes of
    it, 0 if none explains it; the part that two sines at close frequencies explain, 0 if it hardly spreads."""
    size, after = np.abs(z), times - times.mean()
    slope, level = np.polyfit(after, np.log(np.maximum(size, 1e-300)), 1)
    trend = np.exp(level + slope * after)
    explained = 1 - float(((size - trend) ** 2).mean() / size.var())
    change = np.expm1(slope * (times[-1] - times[0])) if explained > _TREND else 0.0
    wave = np.real(z * np.exp(2j * np.pi * frequency * times))
    kurtosis = (wave**4).mean() / (wave**2).mean() ** 2
    spread, pair = size.std() / size.mean(), 0.0
    if spread > _RESTLESS:
        some = z[:: max(1, len(z) // 64), None]
        at = np.linspace(0, 1, len(some))
        _, pair = most_explained(at, some, np.arange(-2, 2.01, 0.125), 2)
    return [spread, kurtosis, abs(z.mean()) / size.mean(), slope, change, pair]


def forced_frequencies(times: Numbers, names: Sequence[str], values: Numbers) -> list[float]:
    """Return the frequencies [Hz] of the forced oscillations in signals of shape (n, m)."""
    signals = Signals(times, tuple(names), values - values.mean(axis=0))
    return [
        one.frequency
        for one in find_oscillations(signals)
        if evidence_of(signals, one).kind == "forced"
    ]


def _judge(
    seen: Evidence, change: float, pair: float, found: SpectralLine
) -> tuple[OscillationKind, list[str]]:
    """Return the kind and the reasons for it, in words.

    ``change``: of the amplitude over the record, as a part of it, if an exponential explains the envelope; else 0.
    ``pair``: part of the envelope's power that two sines at close frequencies explain."""
    harmonics = ", ".join(
        f"{order} x ({whole_percent(part)})" for order, part in found.harmonics.items()
    )
    sharp = seen.envelope_spread <= _CLEAN or seen.skirt <= _SKIRT or bool(harmonics)
    steady = seen.envelope_spread < _STEADY and seen.kurtosis < _SINE and seen.coherence > _COHERENT
    figures = (
        f"amplitude ± {whole_percent(seen.envelope_spread)}, kurtosis {seen.kurtosis:.2f} (a sine has 1.5, noise 3), "
        f"phase steady to {seen.coherence:.2f} of 1"
    )
    if abs(change) > _CHANGE and seen.coherence > 0.8 and not harmonics:
        way = "decays" if change < 0 else "grows"
        trend = f"its amplitude {way}, by {whole_percent(abs(change))} over {seen.periods:.0f} periods ({figures})"
        return "mode", [trend]
    if steady and seen.disturbed and not harmonics:
        after = "a mode without damping would ring alike after the disturbance with which it begins"
        return "not known", [f"it is steady ({figures}), but {after}"]
    if steady and not sharp:
        return "not known", [
            f"it is steady ({figures}), but its line widens as that of a mode that noise shakes"
        ]
    if steady:
        said = [
            f"it is steady over {seen.periods:.0f} periods ({figures}): noise would make a mode's amplitude wander"
        ]
        said += (
            [f"multiples of its frequency: {harmonics}, as of a limit or a switch"]
            if harmonics
            else []
        )
        return "forced", said
    restless = seen.envelope_spread > _RESTLESS
    if restless and pair > _PAIR:
        return "not known", [
            f"it swells and fades as two steady sines at close frequencies would ({figures})"
        ]
    if restless and seen.kurtosis > _SINE and seen.coherence < 0.9:
        return "mode", [f"its amplitude and phase wander as noise makes them ({figures})"]
    return "not known", [f"neither steady nor restless: {figures}"]


def _disturbed(signals: Signals, found: SpectralLine) -> bool:
    """Return whether a level changes, or something far larger than the oscillation happens, where it begins."""
    if found.begin is None:
        return False
    step = float(signals.times[1] - signals.times[0])
    period = max(2, round(1 / (found.frequency * step)))
    at, end = found.first, found.last
    around = slice(max(0, at - 2 * period), at + 2 * period)
    before, after = (
        slice(max(0, at - 4 * period), max(1, at - period)),
        slice(at + period, min(end, at + 5 * period)),
    )
    for name, amplitude in found.amplitudes.items():
        alike = (
            a
            for other, a in found.amplitudes.items()
            if other.rpartition(".")[2] == name.rpartition(".")[2]
        )
        if amplitude < _LEAST_PART * max(alike) or not name.endswith((".p", ".q")):
            continue
        x = signals.values[:, signals.names.index(name)]
        size = float(np.abs(phasors(signals.times[at:end], x[at:end, None], [found.frequency]))[0])
        noise = float(x[before].std())
        shock = float(np.abs(x[around] - np.median(x[before])).max())
        moved = abs(float(np.mean(x[after])) - float(np.mean(x[before])))
        if shock > _SHOCK * size + 4 * noise or moved > size + 4 * noise:
            return True
    return False


_SHOWN = 8  # signals whose amplitudes the JSON has
_FEWEST_TOLD = 5  # periods from which on an oscillation is told


@dataclass(frozen=True)
class Located:
    """One oscillation, what it is, and its source where the methods allow to name one."""

    found: SpectralLine
    evidence: Evidence
    opinions: tuple[Opinion, ...]
    # a place that drives it, perhaps not alone; None where that is not known, or nothing forces it
    drives: str | None
    source: str | None  # the same, where it is known that nothing else drives
    reason: str  # why it is named, or why not
    advice: str  # what would confirm the answer, or what helps
    # of a case's mode: POD and PSS, the one that moves it most first
    controllers: tuple[dict[str, Any], ...] = ()

    def as_json(self) -> dict[str, Any]:
        onset = self.found.onset
        begin = None if onset is None else onset.at
        begin_within = None if onset is None else [onset.earliest, onset.latest]
        return {
            "frequency_hz": self.found.frequency,
            "kind": self.evidence.kind,
            "source": self.source,
            "drives": self.drives,
            "reason": self.reason,
            "advice": self.advice,
            "begin": begin,
            "begin_within": begin_within,
            "harmonics": {str(order): part for order, part in self.found.harmonics.items()},
            "evidence": asdict(self.evidence),
            "controllers": list(self.controllers),
            "methods": [asdict(o) | {"ranking": list(map(list, o.ranking))} for o in self.opinions],
            "amplitudes": dict(list(self.found.amplitudes.items())[:_SHOWN]),
        }


def locate(measured: Measurements, models: UnitModels | None = None) -> list[Located]:
    """Return each oscillation of a record, with its kind and its source.

    ``models``: linear models of a case's units; if they are given and fit, they decide which unit drives it."""
    signals = signals_of(measured)
    found = [
        one for one in find_oscillations(signals) if one.periods(measured.interval) >= _FEWEST_TOLD
    ]
    answers = []
    for one in found:
        evidence = evidence_of(signals, one)
        others = [o.frequency for o in found if o is not one]
        said = opinions(measured, one, others)
        if models is not None:
            own = own_models(models, measured, one, others)
            said = [own, *said] if own.applies else [*said, own]
            if own.place not in {None, *models.loads} and evidence.kind == "not known":
                evidence = replace(evidence, kind="forced", reasons=(own.reason,))
        drives, reason = _verdict(evidence, said)
        reason += f"; {OWN_MODEL}: {said[-1].reason}" if said[-1].method == OWN_MODEL else ""
        if (
            drives is not None
            and said[0].method != OWN_MODEL
            and not felt_beyond(measured, one, others, drives)
        ):
            reason = f"no other bus moves with {drives}: its measuring may err, or nothing else is in view"
            drives = None
        sole = said[0].alone and drives is not None
        if not sole and drives is not None:
            reason += f"; whether {drives} does so alone is not known"
        advice = _advice(measured, evidence, drives, sole=sole)
        answers.append(
            Located(
                one,
                evidence,
                opinions=tuple(said),
                drives=drives,
                source=drives if sole else None,
                reason=reason,
                advice=advice,
            )
        )
    return answers


def _verdict(evidence: Evidence, said: Sequence[Opinion]) -> tuple[str | None, str]:
    """Return what drives it, where the methods agree or one is known not to apply."""
    if evidence.kind != "forced":
        known = evidence.kind == "mode" and "a mode of the system has no source"
        return None, f"{known or 'it is not known whether it is forced'}: {evidence.reasons[0]}"
    if said[0].method == OWN_MODEL:
        others = "; ".join(
            f"{o.method}: {o.reason}" for o in said[1:] if o.applies and o.place != said[0].place
        )
        return said[0].place, f"{said[0].reason}{others and f' (besides, {others})'}"
    said = [o for o in said if o.method != OWN_MODEL]
    by_method = {o.method: o for o in said}
    flow, phase, mode = by_method[DEF], by_method[QV_PHASE], by_method[DYNAMIC_MODE]
    physical = [o for o in (flow, phase) if o.applies]
    named = {o.place for o in physical}
    if named == {None} or not physical:
        return None, "; ".join(f"{o.method}: {o.reason}" for o in physical)
    if len(named) > 1 or (mode.place is not None and mode.place not in named):
        return None, "the methods disagree: " + "; ".join(f"{o.method}: {o.reason}" for o in said)
    agree = [o for o in said if o.place is not None]
    quiet = [o for o in said if o.place is None]
    return agree[0].place, "; ".join(f"{o.method}: {o.reason}" for o in [*agree, *quiet])


def _advice(measured: Measurements, evidence: Evidence, drives: str | None, *, sole: bool) -> str:
    if evidence.kind == "mode":
        return "damp the mode, which nothing drives: `gfor sensitivities CASE` ranks the POD and PSS that move it most"
    if drives is None:
        return "look at the places that lead the methods' rankings; a longer record, or more of the grid, may decide"
    if any(p.name == drives and p.kind == "branch" for p in measured.places):
        return f"measure beyond {drives}: it comes from there"
    more = "if it does not end, something else drives it as well, which the units' models can show (--case)"
    end = "the oscillation has to end" if sole else more
    return f"hold the references of {drives}, or switch its controllers to manual: {end}"
