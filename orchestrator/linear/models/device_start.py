"""Misfits between foreign devices and their bindings, seen at the start of a coupled system."""

from cmath import rect
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import replace
from itertools import count

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import CosimError
from orchestrator.devices.binding.misfits import (
    Misfit,
    at_rest,
    is_consequence,
    likely_cause,
    of_current,
    of_frequency,
    of_power,
)
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.systems.coupling.master import Master

_HOLDS = 0.2  # time [s] for which a device is held alone before its omega is read
# distance of the voltage from v_0 up to which the power is to be what the power flow asks for [pu]
_AT = 0.01


def misfits_of(master: Master) -> dict[str, list[Misfit]]:
    """By component; for a master at its start. What cannot be read there is not judged."""
    found = {}
    for name in master.components:
        try:
            component, its = master.components[name], list(_of(master, name))
            faults = [misfit.fault for misfit in its]
            found[name] = [
                _with_cause(misfit, component)
                for misfit in its
                if not is_consequence(component.description, misfit.fault, faults)
            ]
        except CosimError:
            continue
    return {name: misfits for name, misfits in found.items() if misfits}


def sentences(found: Mapping[str, list[Misfit]]) -> tuple[str, ...]:
    return tuple(misfit.sentence(name) for name, misfits in found.items() for misfit in misfits)


def _with_cause(misfit: Misfit, component: Component) -> Misfit:
    cause = likely_cause(component.description, misfit.fault)
    return replace(misfit, evidence=f"{misfit.evidence}; {cause}") if cause else misfit


def _omega_alone(master: Master, name: str) -> tuple[float, bool]:
    """Its omega at rest in a second instance at an ideal bus, as in `gfor fmu check`, and whether it has settled."""
    plan, inputs, h = (
        master.system.components[name],
        master.exchanges[name].inputs.names,
        master.clock.step_size,
    )
    with closing(open_component(name, plan.description, isolated=plan.isolated)) as alone:
        alone.setup(0.0, None)
        alone.set(plan.parameters)
        alone.enter_initialization_mode()
        alone.set({**plan.inputs, **dict(zip(inputs, master.arriving(name).tolist(), strict=True))})
        alone.exit_initialization_mode()
        index = count()

        def hold() -> Numbers:
            omega = np.empty(max(1, round(_HOLDS / h)))
            for k in range(len(omega)):
                alone.step(next(index) * h, h)
                omega[k] = alone.get(["omega"])["omega"]
            return omega

        return at_rest(hold)


def _of(master: Master, name: str) -> Iterator[Misfit]:
    component = master.components[name]
    described = component.description
    if not isinstance(described, BoundDescription):
        return
    if "omega" in described.outputs:  # it may begin at 1 whatever it shows at rest
        with suppress(CosimError):  # there may be no second instance
            omega, settled = _omega_alone(master, name)
            misfit = of_frequency(omega, described.port.f_n) if settled else None
            if misfit:
                yield misfit
    inputs = master.exchanges[name].inputs
    given = dict(zip(inputs.names, inputs.values.tolist(), strict=True))
    start, outputs = (
        component.values(["S_n", "P_0", "Q_0", "v_0", "theta_0"]),
        component.get(["i_re", "i_im"]),
    )
    current = complex(outputs["i_re"], outputs["i_im"]) * SYSTEM_BASE_MVA / start["S_n"]
    v = complex(given.get("v_re", 0.0), given.get("v_im", 0.0))
    if described.port.start.get("P_0") and abs(v - rect(start["v_0"], start["theta_0"])) < _AT:
        asked = complex(start["P_0"], start["Q_0"])
        misfit = of_power(asked, v * current.conjugate())
        if misfit:
            yield misfit
    misfit = of_current(abs(current), described.port.current_limit)
    if misfit:
        yield misfit
