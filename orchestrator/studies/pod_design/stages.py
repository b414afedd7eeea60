"""The stages of a POD's lead/lag: as many as its variable says, or the fixed number of a vendor's device.

A device with a fixed number has no variable N_S. Its stages do nothing where both time constants are equal. A device
whose time constants cannot be set either, or not while it runs, has a gain alone that can be designed."""

import cmath
import math

import numpy as np

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Complex
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.system import ComponentPlan

NEEDED = ("enabled", "K")  # variables without which no POD can be designed
LEAD_LAG = ("T_S1", "T_S2")  # variables without which its gain alone is designed
GAIN_ALONE = 0.0  # in place of neutral time constants [s], of a device whose lead/lag cannot be set
# [s], of both time constants, if the device starts with none
_NEUTRAL = 0.1
# gain [pu] and lead T_S1/T_S2 with which stages are counted: so small that the converter's answer to its own POD does
# not turn the ratio (of 10 pu by 8° in a device with matching control, of 0.1 pu by 0.1°)
_GAIN = 0.1
_LEAD = 2.0
# by how much the response that is measured may differ from that of a whole number of stages
_WHOLE = 0.02
_MOST = 10


def neutral_time(plan: ComponentPlan, controller: str) -> float | None:
    """Both time constants [s] with which the stages of a device do nothing; None if their number can be set to 0,
    `GAIN_ALONE` if its lead/lag cannot be set at all."""
    if fixed_lead_lag(plan.description, controller):
        return GAIN_ALONE
    if f"{controller}.N_S" in plan.description.variables:
        return None
    return plan.number(f"{controller}.T_S2") or plan.number(f"{controller}.T_S1") or _NEUTRAL


def fixed_lead_lag(description: FmuDescription, controller: str) -> list[str]:
    """Return the variables of the lead/lag that the device has not, or not as tunable ones; none if it can be set."""
    variables = description.variables
    return [
        name
        for name in (f"{controller}.{v}" for v in LEAD_LAG)
        if name not in variables or variables[name].variability != "tunable"
    ]


def count_stages(prepared: PreparedScenario, component: str, controller: str) -> int:
    """How many equal stages (1 + s·T_S1)/(1 + s·T_S2) a device has, from its answer with and without lead.

    Raises `AnalysisError` if its answer is not that of a whole number of such stages."""
    time = neutral_time(prepared.system.components[component], controller) or _NEUTRAL
    with running(prepared) as master:
        find_operating_point(master)
        blocks = Blocks(master)
        found = []
        for gain, lead in ((0.0, 1.0), (_GAIN, 1.0), (_GAIN, _LEAD)):
            values = {"enabled": gain > 0, "K": gain, "T_S1": lead * time, "T_S2": time}
            master.components[component].set({f"{controller}.{k}": v for k, v in values.items()})
            there = blocks.with_component(master, component).components[component]
            found.append(_response(there, cmath.exp(1j / time * master.clock.step_size)))
    off, plain, leading = found
    place = np.unravel_index(np.abs(plain - off).argmax(), plain.shape)
    if plain[place] == off[place]:
        raise AnalysisError(f"{component}.{controller} does not act on its converter at all")
    ratio = complex((leading - off)[place] / (plain - off)[place])
    each = (1 + 1j * _LEAD) / (1 + 1j)
    number = min(range(_MOST + 1), key=lambda n: abs(each**n - ratio))
    if abs(each**number - ratio) > _WHOLE * abs(ratio):
        raise AnalysisError(
            f"{component}.{controller}: T_S1 = {_LEAD * time:g} s with T_S2 = {time:g} s turns its signal by "
            f"{math.degrees(cmath.phase(ratio)):.1f}° and makes it {abs(ratio):.3g} times larger at "
            f"{1 / (2 * math.pi * time):.3g} Hz, which no number of equal stages (1 + s·T_S1)/(1 + s·T_S2) does; a "
            "design needs such stages"
        )
    return number


def _response(model: ComponentLinearization, z: complex) -> Complex:
    states = np.linalg.solve(z * np.eye(len(model.A)) - model.A, model.B)
    return np.asarray(model.C @ states + model.D, dtype=complex)
