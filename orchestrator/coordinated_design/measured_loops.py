"""Open POD loops of a running system, measured on its FMUs."""

from collections.abc import Sequence

import numpy as np

from orchestrator.analysis.component_linearization import ComponentLinearization
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearization import Blocks
from orchestrator.analysis.slope_linearization import linearize_slopes
from orchestrator.arrays import Vector
from orchestrator.coordinated_design.open_loops import OpenLoops, PodPlace
from orchestrator.coupling.master import Master
from orchestrator.coupling.step_awareness import other_step
from orchestrator.errors import AnalysisError

UNIT_GAIN = 50.0  # gain with which a loop is measured [pu]; the signal stays far below its limit
_RANK = 1e-6  # A loop has one signal: the second singular value of its effect is below this part of the first


def measure(master: Master, model: LinearModel, blocks: Blocks, places: Sequence[PodPlace]) -> OpenLoops:
    windows, known = blocks.state_windows(), blocks.components
    there = [place for place in places if place.component in known]
    p = len(blocks.output_names)
    newest, arriving = np.arange(p), p + np.arange(len(blocks.links))  # as `continuous` numbers w
    U, V = np.zeros((len(model.names), len(there))), np.zeros((len(there), len(model.names)))
    sent, seen = np.zeros((model.K.shape[0], len(there))), np.zeros((len(there), model.K.shape[0]))
    for k, place in enumerate(there):
        name, before = place.component, known[place.component]
        n = len(before.states)
        acts, sees = _loop(master, place, before)
        U[windows[name], k], sent[:p][blocks.window[name], k] = acts[:n], acts[n:]
        V[k, windows[name]], seen[k, blocks.entries(name, newest, arriving)] = sees[:n], sees[n:]
    if not (sent.any() or seen.any()):
        return OpenLoops.of(model.A, U, V, there, model.names)
    # What a loop gives to the outputs comes back by way of the network: ż = F·z + G·w + U·s, w = H·z + K·w + sent·s.
    travelled = model.settle(sent)
    through = model.settle(model.H.toarray())
    return OpenLoops.of(model.A, U + model.G @ travelled, V + seen @ through, there, model.names, seen @ travelled)


def _loop(master: Master, place: PodPlace, before: ComponentLinearization) -> tuple[Vector, Vector]:
    """Where the signal with unit gain acts, on states and outputs, and what it is made of, states and inputs."""
    component, exchange = master.components[place.component], master.exchanges[place.component]
    saved = component.save_state()
    try:
        component.set({f"{place.controller}.enabled": True, f"{place.controller}.K": UNIT_GAIN})
        with other_step(master, place.component, 0.0):  # as the whole system is: without a communication step
            with_it = linearize_slopes(exchange, master.time, master.clock.step_size)
    finally:
        component.restore_state(saved)
        component.free_state(saved)
        component.set({f"{place.controller}.enabled": False})
    if with_it.A_c is None or with_it.B_c is None or before.A_c is None or before.B_c is None:
        raise AnalysisError(f"component {place.component!r} does not give its derivatives, so no loop can be measured")
    m = len(with_it.inputs)
    changes = [[with_it.A_c - before.A_c, with_it.B_c - before.B_c[:, :m]],
               [with_it.C - before.C, with_it.D - before.D[:, :m]]]  # fmt: skip
    left, sizes, right = np.linalg.svd(np.block(changes) / UNIT_GAIN)
    if sizes[0] == 0:
        raise AnalysisError(f"{place.name} does not act on its converter at all; nothing can be designed there")
    if sizes[1] > _RANK * sizes[0]:
        raise AnalysisError(f"{place.name} acts on its converter in more ways than by one signal")
    return left[:, 0] * sizes[0], right[0]
