"""Impedances behind the units that feed a short circuit: machines with their transformer, external grids."""

import math

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.systems.coupling.system import ComponentPlan

_REACTANCES = ("machine.X_d2", "machine.X_d1")  # the first that a machine has counts


def source_impedance(plan: ComponentPlan) -> complex | None:
    """Return the impedance behind a machine or an external grid [pu, 100 MVA]; None for anything else."""
    machine = machine_impedance(plan)
    if machine is not None:
        return machine + transformer_impedance(plan)
    return external_impedance(plan)


def machine_impedance(plan: ComponentPlan) -> complex | None:
    """Return R_s + jX''_d, or jX'_d of the classical machine, without its transformer [pu, 100 MVA]; else None."""
    reactance = next((v for v in _REACTANCES if v in plan.description.variables), None)
    base = machine_base(plan)
    if reactance is None or not base:
        return None
    z = complex(_or_zero(plan, "machine.R_s"), plan.number(reactance))
    return SYSTEM_BASE_MVA / base * z


def machine_base(plan: ComponentPlan) -> float:
    """Return the base of a machine's data [MVA]; 0 for what has no rating."""
    return _or_zero(plan, "machine.S_data") or _or_zero(plan, "S_n")


def transformer_impedance(plan: ComponentPlan) -> complex:
    """Return the impedance of the transformer that is a part of a machine [pu, 100 MVA]; 0 without one."""
    rating = _or_zero(plan, "S_n")
    z = complex(_or_zero(plan, "transformer.R_t"), _or_zero(plan, "transformer.X_t"))
    return SYSTEM_BASE_MVA / rating * z if rating else 0j


def external_impedance(plan: ComponentPlan) -> complex | None:
    """Return the impedance of an external grid [pu, 100 MVA]; None for anything else."""
    rating, known = _or_zero(plan, "S_n"), plan.description.variables
    if not rating or "R_X" not in known or "source.E_re" not in known:
        return None
    ratio = plan.number("R_X")
    return SYSTEM_BASE_MVA / rating * complex(ratio, 1.0) / math.hypot(1.0, ratio)


def _or_zero(plan: ComponentPlan, variable: str) -> float:
    return plan.number(variable) if variable in plan.description.variables else 0.0
