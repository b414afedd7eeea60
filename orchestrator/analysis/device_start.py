"""What does not fit between foreign devices and their bindings, seen at the start of a coupled system."""

from cmath import rect
from collections.abc import Iterator, Mapping
from dataclasses import replace

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.binding.misfits import SHOWN, Misfit, likely_cause, of_current, of_frequency, of_power
from orchestrator.coupling.master import Master
from orchestrator.errors import CosimError
from orchestrator.fmi.component import Component
from orchestrator.fmi.port import BoundDescription

_AT = 0.01
"""Distance of the voltage from v_0 up to which the power is to be what the power flow asks for [pu]."""


def misfits_of(master: Master) -> dict[str, list[Misfit]]:
    """By component; for a master at its start. What cannot be read there is not judged."""
    found = {}
    for name in master.components:
        try:
            found[name] = [_with_cause(misfit, master.components[name]) for misfit in _of(master, name)]
        except CosimError:
            continue
    return {name: misfits for name, misfits in found.items() if misfits}


def sentences(found: Mapping[str, list[Misfit]]) -> tuple[str, ...]:
    return tuple(misfit.sentence(name) for name, misfits in found.items() for misfit in misfits)


def _with_cause(misfit: Misfit, component: Component) -> Misfit:
    cause = likely_cause(component.description, misfit.fault)
    return replace(misfit, evidence=f"{misfit.evidence}; {cause}") if cause else misfit


def _of(master: Master, name: str) -> Iterator[Misfit]:
    component = master.components[name]
    described = component.description
    if not isinstance(described, BoundDescription):
        return
    omega = component.get(["omega"])["omega"] if "omega" in described.outputs else 1.0
    if SHOWN[0] < omega < SHOWN[1] and (misfit := of_frequency(omega, described.port.f_n)):
        yield misfit
    inputs = master.exchanges[name].inputs
    given = dict(zip(inputs.names, inputs.values.tolist(), strict=True))
    start, outputs = component.values(["S_n", "P_0", "Q_0", "v_0", "theta_0"]), component.get(["i_re", "i_im"])
    current = complex(outputs["i_re"], outputs["i_im"]) * SYSTEM_BASE_MVA / start["S_n"]
    v = complex(given.get("v_re", 0.0), given.get("v_im", 0.0))
    if described.port.start.get("P_0") and abs(v - rect(start["v_0"], start["theta_0"])) < _AT:
        asked = complex(start["P_0"], start["Q_0"])
        if misfit := of_power(asked, v * current.conjugate()):
            yield misfit
    if misfit := of_current(abs(current), described.port.current_limit):
        yield misfit
