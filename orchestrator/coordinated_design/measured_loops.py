"""Open POD loops of a running system, measured on its FMUs."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.analysis.component_linearization import ComponentLinearization
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.slope_linearization import linearize_slopes
from orchestrator.arrays import Matrix
from orchestrator.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.coupling.master import Master
from orchestrator.errors import AnalysisError

UNIT_GAIN = 50.0
"""Gain with which a loop is measured [pu]; the signal stays far below its limit."""

_RANK = 1e-6
"""A loop has one signal: the second singular value of its effect is below this part of the first."""


def measure(
    master: Master, model: LinearModel, known: Mapping[str, ComponentLinearization], places: Sequence[PodPlace]
) -> OpenLoops:
    """The system with its loops open.

    Parameters
    ----------
    master
        At its operating point, with the loops' controllers off and without lead/lag.
    model
        The continuous model there.
    known
        The components' own models there.
    places
        The loops; those of components that are out of service are left out.

    Raises
    ------
    AnalysisError
        If a controller does not act as one signal on the states of its converter.
    """
    first = dict(zip(known, np.cumsum([0, *(len(c.states) for c in known.values())]).tolist(), strict=False))
    there = [place for place in places if place.component in known]
    n = len(model.names)
    U, V = np.zeros((n, len(there))), np.zeros((len(there), n))
    for k, place in enumerate(there):
        before = known[place.component]
        rows = slice(first[place.component], first[place.component] + len(before.states))
        U[rows, k], V[k, rows] = _loop(master, place, before)
    return OpenLoops.of(model.A, U, V, there, model.names)


def _loop(master: Master, place: PodPlace, before: ComponentLinearization) -> tuple[Matrix, Matrix]:
    """Where the signal with unit gain acts, and what it is made of: column of U and row of V."""
    component, exchange = master.components[place.component], master.exchanges[place.component]
    saved = component.save_state()
    try:
        component.set({f"{place.controller}.enabled": True, f"{place.controller}.K": UNIT_GAIN})
        with_it = linearize_slopes(exchange, master.time, master.clock.step_size)
    finally:
        component.restore_state(saved)
        component.free_state(saved)
        component.set({f"{place.controller}.enabled": False})
    m = len(with_it.inputs)
    if with_it.A_c is None or with_it.B_c is None or before.A_c is None or before.B_c is None:
        raise AnalysisError(f"component {place.component!r} does not give its derivatives, so no loop can be measured")
    change = (with_it.A_c - before.A_c) / UNIT_GAIN
    others = [with_it.B_c - before.B_c[:, :m], with_it.C - before.C, with_it.D - before.D[:, :m]]
    left, sizes, right = np.linalg.svd(change)
    if sizes[0] == 0:
        raise AnalysisError(f"{place.name} does not act on its converter at all; nothing can be designed there")
    if sizes[1] > _RANK * sizes[0] or any(np.abs(part).max(initial=0.0) > _RANK * sizes[0] for part in others):
        raise AnalysisError(f"{place.name} acts on its converter in more ways than by one signal on its states")
    return left[:, 0] * sizes[0], right[0]
