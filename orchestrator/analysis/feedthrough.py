"""Outputs that depend on inputs of the same instant."""

import numpy as np

from orchestrator.analysis.blocks import Blocks
from orchestrator.errors import AnalysisError


def check_feedthrough(blocks: Blocks, names: list[str]) -> None:
    """No output of the named components may depend on itself within one instant."""
    waiting = list(names)
    while waiting:
        pending = {i for name in waiting for i in range(len(blocks.output_names))[blocks.window[name]]}
        ready = [name for name in waiting if not pending & feedthrough_sources(blocks, name)]
        if not ready:
            raise AnalysisError(
                f"direct feed-through closes an algebraic loop through {', '.join(waiting)}; "
                "one of them must give an output that does not depend directly on its inputs"
            )
        waiting = [name for name in waiting if name not in ready]


def feedthrough_sources(blocks: Blocks, name: str) -> set[int]:
    """Indices in y that a component's outputs depend on directly: not over a delay, nor over a cut connection."""
    used = np.abs(blocks.components[name].D).max(axis=0, initial=0.0) > 0
    used[list(blocks.linked(name))] = False
    return {i for i in blocks.sources[name][used].tolist() if i < len(blocks.output_names)}
