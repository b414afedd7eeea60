"""Examination of a linear model's verdict: comparison with the FMUs, their perturbation and the communication step.

Every command that linearises uses this examination, and so all of them give the same warnings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from orchestrator.analysis.apart import standing_apart
from orchestrator.analysis.coupled_response import confirmed
from orchestrator.analysis.delays import LARGEST_ERROR, doubtful_delays, representation_error, too_long, warnings_of
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearity import Doubt, doubts
from orchestrator.analysis.linearization import Blocks
from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ, Mode, Spectrum, find_spectrum
from orchestrator.analysis.resolution import check_resolution, verdict_warnings
from orchestrator.analysis.stability import WHOLE, Stability, judge, whole_spectrum
from orchestrator.coupling.master import Master


@dataclass(frozen=True)
class Examination:
    stability: Stability
    warnings: tuple[str, ...]


def examine(
    master: Master, blocks: Blocks, model: LinearModel, system: LinearModel | None, *, spectrum: Spectrum | None = None,
    of_system: Spectrum | None = None, modes: Sequence[Mode] | None = None, shown: Sequence[Mode] | None = None,
    frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
) -> Examination:  # fmt: skip
    """Judge a step map, and look for what would make the verdict wrong; say what it leaves out of the connections.

    ``spectrum`` and ``of_system``: all eigenvalues of both models, where they are known already.
    ``modes``: oscillations that must not depend on the perturbation; by default those of the range. If a component is
    doubtful, all oscillations from 0.1 to 2 Hz are added.
    ``shown``: modes that must not depend on the communication step; by default the same."""
    if spectrum is None:
        small = len(model.names) <= WHOLE
        spectrum = find_spectrum(model, *frequency_range) if small and modes is None else whole_spectrum(model)
    if modes is None:
        modes = [] if spectrum is None else [mode for mode in spectrum.modes if mode.is_oscillation]
    elif any(component.doubtful for component in blocks.components.values()) and len(model.names) <= WHOLE:
        modes = [*modes, *(mode for mode in find_spectrum(model).modes if mode.is_oscillation)]
    rightmost = [spectrum.rightmost] if spectrum is not None and spectrum.rightmost is not None else []
    stability = confirmed(master, blocks, model, judge(model, spectrum, system, of_system))
    if model.period > 1:
        told = (
            f"sampled controllers repeat after {model.period} communication steps "
            f"({model.period * master.clock.step_size:g} s): the modes are those of the map over this period"
        )
        apart = standing_apart(master, model, stability.zeros)
        return Examination(stability, (told, *verdict_warnings(stability), *apart, *warnings_of(master)))
    found = doubts(blocks, master.schedule, model, [*modes, *rightmost])
    shown = modes if shown is None else shown
    eigenvalues = [mode.eigenvalue for mode in [*shown, *rightmost]]
    links = blocks.links.values()
    long = too_long(links, frequency_range[1], model.step_size)
    wires = (
        *standing_apart(master, model, stability.zeros),
        *warnings_of(master),
        *long,
        *doubtful_delays(links, eigenvalues, model.step_size),
    )
    if long and not (stability.stable is False and _has_delays(blocks, model, rightmost)):
        stability = replace(stability, stable=None, reason="; ".join(long))
    if turning := _turning(blocks, master, model, stability, found, rightmost):
        stability = replace(stability, stable=None, reason="; ".join(map(str, turning)))
        found = [doubt for doubt in found if doubt not in turning]
        return Examination(stability, (*verdict_warnings(stability), *map(str, found), *wires))
    step = check_resolution(master, model, system, shown, frequency_range, stability)
    return Examination(stability, (*step, *map(str, found), *wires))


def _has_delays(blocks: Blocks, model: LinearModel, modes: Sequence[Mode]) -> bool:
    return all(
        representation_error(link, mode.eigenvalue, model.step_size) <= LARGEST_ERROR
        for link in blocks.links.values()
        if link.delay
        for mode in modes
    )


def _turning(
    blocks: Blocks, master: Master, model: LinearModel, stability: Stability, found: list[Doubt], rightmost: list[Mode]
) -> list[Doubt]:
    """Doubts that leave the verdict open. If a mode grows, only doubts about this mode count."""
    turning = [doubt for doubt in found if doubt.turns]
    if not turning or stability.stable is None:
        return []
    if stability.stable is False:
        return [doubt for doubt in doubts(blocks, master.schedule, model, rightmost) if doubt.turns]
    return turning
