"""Damping that a device brings: a scenario's damping beside that of another one with the same power flow."""

import math
from collections.abc import Iterator, Sequence

from orchestrator.core.errors import AnalysisError, CosimError
from orchestrator.core.units import whole_percent
from orchestrator.linear.models.linear_model import IDENTIFIED
from orchestrator.linear.spectra import continuation
from orchestrator.linear.spectra.mode_tracking import ModeSet, match
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, Mode, damping_percent
from orchestrator.studies.modes.mode_identity import MOST_STATES, damping_gains
from orchestrator.studies.modes.modes import ModesResult, compute_modes

_SAME_VOLTAGE = 1e-4  # between two power flows that are one operating point [pu]


def sentences_beside(results: Sequence[ModesResult]) -> Iterator[str]:
    """A sentence on each scenario that others name as the one beside them, also where it was left out."""
    known = {r.prepared.name: r for r in results}
    wanted = {r.prepared.name: r.prepared.case.scenarios[r.prepared.name].beside for r in results}
    for name in dict.fromkeys(name for name in wanted.values() if name is not None):
        other = known.get(name)
        if other is None:
            yield f"What the change of power flow alone does: --scenario {name} beside"
        elif before := min(other.modes, key=lambda mode: mode.damping_percent, default=None):
            found = "; ".join(
                _compared(r, other, before) for r in results if wanted[r.prepared.name] == name
            )
            mode = f"({before.frequency_hz:.3f} Hz, {before.damping_percent:.2f} %), at the same power flow"
            yield f"Beside {other.prepared.title!r} {mode}: {found}"


def _compared(result: ModesResult, other: ModesResult, before: Mode) -> str:
    title = result.prepared.title
    flows = [r.prepared.power_flow for r in (result, other)]
    voltages = [{} if flow is None else flow.voltages for flow in flows]
    if not all(
        abs(v - voltages[1].get(bus, 0.0)) < _SAME_VOLTAGE for bus, v in voltages[0].items()
    ):
        return f"{title}: not known, as its power flow is another one"
    least = min((mode.damping_percent for mode in result.modes), default=math.nan)
    try:
        damping = _followed(result, other, before)
    except CosimError as error:
        points = least - before.damping_percent
        return f"{title} at least {points:+.2f} points (least damped: {least:.2f} %), as {error}"
    weaker = (
        f", and the least damped now {least:.2f} %" if round(least, 2) < round(damping, 2) else ""
    )
    return f"{title} {damping - before.damping_percent:+.2f} points ({damping:.2f} %{weaker})"


def _followed(result: ModesResult, other: ModesResult, before: Mode) -> float:
    """The damping [%] of another scenario's mode here: first with the gains of damping controllers at 0, by its shape,
    and then along the gains."""
    prepared, start = result.prepared, result
    small = (
        result.model.number_of_states <= MOST_STATES
        and IDENTIFIED not in result.model.sources.values()
    )
    if small and prepared.beside and (gains := dict.fromkeys(damping_gains(prepared), 0.0)):
        rest, seen = prepared.beside(prepared.name, False, gains), result.hidden
        if rest is not None:
            start = compute_modes(rest, seen.frequency_range if seen else ELECTROMECHANICAL_HZ)
    one, two = (ModeSet.of(r.modes, tuple(r.model.names)) for r in (other, start))
    here = next(
        (
            start.modes[link.target]
            for link in match(one, two)
            if other.modes[link.source] is before
        ),
        None,
    )
    way = continuation.between(start.model, result.model)
    if here is None or way is None:
        raise AnalysisError("no mode is clearly the same")
    pair = continuation.pair_of(here, start.model.names)
    try:
        return damping_percent(
            continuation.follow_along(pair, way, 0.0, 1.0, continuation.CAREFUL).eigenvalue
        )
    except continuation.ModesMeetError as error:
        raise AnalysisError(
            f"the mode meets another one at {whole_percent(error.beyond)} of the controllers' gains"
        ) from error
