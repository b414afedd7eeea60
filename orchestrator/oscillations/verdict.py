"""The oscillations of a record with what they are and where they come from."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from orchestrator.oscillations.detection import SpectralLine, find_oscillations, signals_of
from orchestrator.oscillations.kind import Evidence, evidence_of
from orchestrator.oscillations.location import DEF, DYNAMIC_MODE, QV_PHASE, Opinion, felt_beyond, opinions
from orchestrator.oscillations.measurements import Measurements
from orchestrator.oscillations.models import OWN_MODEL, UnitModels, own_models

_SHOWN = 8
_FEWEST_PERIODS = 5  # of an oscillation that is told


@dataclass(frozen=True)
class Located:
    """One oscillation, what it is, and its source where the methods allow to name one."""

    found: SpectralLine
    evidence: Evidence
    opinions: tuple[Opinion, ...]
    drives: str | None  # a place that drives it, perhaps not alone; None where that is not known, or nothing forces it
    source: str | None  # the same, where it is known that nothing else drives
    reason: str  # why it is named, or why not
    advice: str  # what would confirm the answer, or what helps

    def as_json(self) -> dict[str, Any]:
        return {
            "frequency_hz": self.found.frequency, "kind": self.evidence.kind, "source": self.source,
            "drives": self.drives, "reason": self.reason, "advice": self.advice, "begin": self.found.begin,
            "harmonics": {str(order): part for order, part in self.found.harmonics.items()},
            "evidence": asdict(self.evidence),
            "methods": [asdict(o) | {"ranking": [list(one) for one in o.ranking]} for o in self.opinions],
            "amplitudes": dict(list(self.found.amplitudes.items())[:_SHOWN]),
        }  # fmt: skip


def locate(measured: Measurements, models: UnitModels | None = None) -> list[Located]:
    """What is there; with the linear models of a case's units, these decide."""
    signals = signals_of(measured)
    found = [one for one in find_oscillations(signals) if one.periods(measured.interval) >= _FEWEST_PERIODS]
    answers = []
    for one in found:
        evidence = evidence_of(signals, one)
        others = [o.frequency for o in found if o is not one]
        said = opinions(measured, one, others)
        if models is not None:
            own = own_models(models, measured, one, others)
            said = [own, *said] if own.applies else [*said, own]
            if own.place is not None and evidence.kind == "not known":
                evidence = replace(evidence, kind="forced", reasons=(own.reason,))
        drives, reason = _verdict(evidence, said)
        reason += f"; {OWN_MODEL}: {said[-1].reason}" if said[-1].method == OWN_MODEL else ""
        if drives is not None and said[0].method != OWN_MODEL and not felt_beyond(measured, one, others, drives):
            drives, reason = (
                None,
                f"no other bus moves with {drives}: its measuring may err, or nothing else is in view",
            )
        sole = said[0].alone and drives is not None
        if drives is not None and not sole:
            reason += f"; whether {drives} does so alone is not known"
        advice = _advice(measured, evidence, drives, sole=sole)
        answers.append(Located(one, evidence, tuple(said), drives, drives if sole else None, reason, advice))
    return answers


def _verdict(evidence: Evidence, said: Sequence[Opinion]) -> tuple[str | None, str]:
    """What drives it, where the methods agree or one is known not to apply."""
    if evidence.kind != "forced":
        what = (
            "a mode of the system has no source" if evidence.kind == "mode" else "it is not known whether it is forced"
        )
        return None, f"{what}: {evidence.reasons[0]}"
    if said[0].method == OWN_MODEL:
        others = "; ".join(f"{o.method}: {o.reason}" for o in said[1:] if o.applies and o.place != said[0].place)
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
    held = f"hold the references of {drives}, or switch its controllers to manual"
    return (
        f"{held}: the oscillation has to end"
        if sole
        else (
            f"{held}: if it does not end, something else drives it as well, which the units' models can show (--case)"
        )
    )
