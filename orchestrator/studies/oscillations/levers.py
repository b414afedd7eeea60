"""Which damping controllers move a mode: each in turn is switched the other way in the running system."""

import re
from dataclasses import replace
from typing import Any

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.continuation import pair_at, pairs_near
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.modes.modes import changed, running
from orchestrator.studies.oscillations.verdict import Located

_SWITCH = re.compile(r"(pod_p|pod_q|pss)\.enabled")
_NEAR = 0.15  # largest relative distance of a case's mode from what was seen
_NAMED = 3  # controllers in a sentence


def levers_of(prepared: PreparedScenario, hertz: float) -> tuple[complex, list[dict[str, Any]]]:
    """The eigenvalue [rad/s] nearest to an oscillation; controllers, whether they are on, and its damping with each
    switched the other way, the one that moves it most first."""
    with running(prepared) as master:
        find_operating_point(master)
        blocks, found = Blocks(master), list[tuple[float, str, dict[str, Any]]]()
        mode = pair_at(model_of(master, blocks), 2j * np.pi * hertz)
        for name, component in master.components.items():
            for variable in filter(_SWITCH.fullmatch, component.description.variables):
                key, on = f"{name}.{variable}", bool(component.get([variable])[variable])
                with changed(master, {key: not on}, {key: on}):
                    varied = model_of(master, blocks.with_component(master, name))
                now = max(pairs_near(varied, mode.eigenvalue), key=mode.similarity).eigenvalue
                lever = {
                    "controller": key.removesuffix(".enabled"),
                    "on": on,
                    "damping_percent": damping_percent(now),
                }
                found.append((-abs(now - mode.eigenvalue), key, lever))
    return mode.eigenvalue, [lever for *_, lever in sorted(found, key=lambda x: x[:2])]


def with_levers(prepared: PreparedScenario, one: Located) -> Located:
    """Return what was found of a mode, with what helps against it; anything else as it is."""
    if one.evidence.kind != "mode":
        return one
    mode, levers = levers_of(prepared, one.found.frequency)
    if abs(mode.imag / (2 * np.pi) / one.found.frequency - 1) > _NEAR:
        return replace(one, advice=f"{one.advice}; the case has no mode near")
    text = "{} switched {} makes that {:.2f} %"
    said = [
        text.format(x["controller"], ("on", "off")[x["on"]], x["damping_percent"])
        for x in levers[:_NAMED]
    ]
    there = f"the case's mode there has {damping_percent(mode):.2f} % of damping; {'; '.join(said)}"
    there = there if levers else "no POD or PSS is there; `gfor site CASE` tells where one helps"
    return replace(
        one, advice=f"damp the mode, which nothing drives: {there}", controllers=tuple(levers)
    )
