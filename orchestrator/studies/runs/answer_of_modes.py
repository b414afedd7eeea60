"""The answer by eigenvalues: whether a scenario is stable, and which swing is damped least."""

from collections.abc import Sequence

from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import Cause, Stability, drift_in_words
from orchestrator.output.report.short_texts import first_few
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.answer import ScenarioAnswer


def of_modes(result: ModesResult) -> ScenarioAnswer:
    """Return the answer of a scenario's eigenvalues."""
    verdict, mode = result.stability, least_damped(result)
    told = [
        _remark(result, mode),
        *(
            f"{name}: {m.frequency_hz:.3f} Hz, {m.damping_percent:.2f} %"
            for name, m in _named_elsewhere(result, mode)
        ),
        *(f"which mode is {name!r} is not known" for name in result.unnamed),
    ]
    remark = with_misfits(result, "; ".join(filter(None, told)))
    return ScenarioAnswer(result.prepared.subject, verdict.stable, verdict.verdict, mode, remark)


def least_damped(result: ModesResult) -> Mode | None:
    return min(result.modes, key=lambda mode: mode.damping_percent, default=None)


def name_of_answers(results: Sequence[ModesResult]) -> str:
    """The only name that a case looks for, if every answer's mode has it; else ""."""
    names = {name for r in results for name in (*r.named, *r.unnamed)}
    (name, *others) = names or {""}
    told = name and not others and all(_tells_of(r, name) for r in results)
    return name if told else ""


def _tells_of(result: ModesResult, name: str) -> bool:
    mode = result.named.get(name)
    return mode is not None and mode is least_damped(result)


def _remark(result: ModesResult, mode: Mode | None) -> str:
    """Say who swings in the least damped mode; what grows, if something does; why the verdict is open, if it is."""
    verdict = result.stability
    swing = "" if mode is None else swing_of(result, mode)
    if verdict.stable is None:
        return swing if result.misfits else verdict.reason
    if verdict.stable or verdict.mode is None:
        return swing
    if verdict.only_common_speed:
        drift = drift_in_words(verdict.mode.eigenvalue.real)
        return f"{drift}; {swing}" if swing else drift
    place = _outside(result, verdict.mode)
    who = _who_grows(result, verdict.mode) if place else ""
    because = "; cause: the coupling" if verdict.cause is Cause.COUPLING else ""
    grows = (
        f"grows at {verdict.mode.eigenvalue.real:+.3g} 1/s{place}{who}{because}{_hidden(verdict)}"
    )
    if swing and not place:
        return f"{grows}; {swing}"
    if mode is not None and mode.eigenvalue.real > 0:
        return f"{grows}; the mode at {mode.frequency_hz:.3f} Hz grows as well: {swing}"
    return grows


def _hidden(verdict: Stability) -> str:
    """Say that the damping in the row, which is with the communication step, hides the growth; "" if it does not."""
    step = verdict.hidden_by_step
    if step is None:
        return ""
    return (
        f" without a communication step; a step of {step:g} s, as in this row's damping, hides it"
    )


def _who_grows(result: ModesResult, growing: Mode) -> str:
    if result.stability.common_speed:
        return ": the common speed"
    return f": {growing.participation[0][0]}" if growing.participation else ""


def _outside(result: ModesResult, growing: Mode) -> str:
    """Say where a growing mode lies that is outside of the range; "" if it is inside."""
    low, high = (0.0, 0.0) if result.hidden is None else result.hidden.frequency_range
    hertz = growing.frequency_hz
    if low <= hertz <= high:
        return ""
    return f" at {hertz:.4g} Hz" if hertz else " without oscillation"


def _named_elsewhere(result: ModesResult, least: Mode | None) -> list[tuple[str, Mode]]:
    """The only mode that the case looks for, where another one is damped less."""
    looked_for = (
        list(result.named.items()) if len(result.prepared.case.table.analysis.modes) == 1 else []
    )
    return [(name, mode) for name, mode in looked_for if mode is not least]


def with_misfits(result: ModesResult, remark: str) -> str:
    faults = [
        f"{name}: {', '.join(m.fault for m in found)}" for name, found in result.misfits.items()
    ]
    return "; ".join([*faults, remark] if remark else faults)


def swing_of(result: ModesResult, mode: Mode) -> str:
    return swing_in_words(result, mode) or ", ".join(state for state, _ in mode.participation[:2])


def swing_in_words(result: ModesResult, mode: Mode) -> str:
    """Who swings against whom, the first of many named; "" if nothing swings."""
    return mode.swing_groups(result.swing).words(lambda side: first_few(side, str))
