"""Limits of generators of parts: ceilings of exciters, limits of stabilisers, valves and gates of governors.

A state with non-windup limits rests at its limit while that acts, and one that passes its input through lies beyond it:
in both cases its value is at or beyond the limit. What has no state of its own is reconstructed from the lag behind it.
"""

from orchestrator.coupling.system import System
from orchestrator.watch.limit import Lead, Limit

_EXCITER, _GOVERNOR, _PSS = "exciter", "governor", "pss"


def _exciter(what: str, signal: str, high: str, low: str, **further: object) -> Limit:
    return _part(_EXCITER, what, signal, high, low, **further)


def _part(part: str, what: str, signal: str, high: str, low: str, **further: object) -> Limit:
    return Limit(what, f"{part}.{signal}", f"{part}.{high}", low=f"{part}.{low}", **further)  # type: ignore[arg-type]


def _names(part: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{part}.{name}" for name in names)


def _rate(what: str, state: str, high: str, low: str) -> Limit:
    return Limit(what, f"der({_GOVERNOR}.{state})", f"{_GOVERNOR}.{high}", low=f"{_GOVERNOR}.{low}")


def _stabiliser(stage: int, lead: str, lag: str, **further: object) -> Limit:
    state = f"{_PSS}.lead_lag_{stage}"
    output = Lead(state, f"{_PSS}.{lead}", lag=f"{_PSS}.{lag}")
    return _part(_PSS, "output limit of the stabiliser", f"lead_lag_{stage}", "V_STMAX", "V_STMIN", lead=output,
                 enabled=f"{_PSS}.enabled", **further)  # fmt: skip


MACHINE_LIMITS = (
    # SEXS; IEEET1 and DC1A; AC1A, whose amplifier has two pairs of limits; AC4A without the rectifier's loading; ST1A.
    _exciter("ceiling of the exciter", "amplifier", "E_MAX", "E_MIN"),
    _exciter("ceiling of the regulator", "amplifier", "V_RMAX", "V_RMIN", knows=_names(_EXCITER, "E")),
    _exciter("ceiling of the regulator", "amplifier", "V_RMAX", "V_RMIN", knows=_names(_EXCITER, "V_E")),
    _exciter("limit of the amplifier", "amplifier", "V_AMAX", "V_AMIN"),
    Limit("ceiling of the exciter", "E_fd", "exciter.V_RMAX", low="exciter.V_RMIN", scale="v_t",
          knows=_names(_EXCITER, "V_AMAX", "K_LR")),
    Limit("ceiling of the exciter", "E_fd", "exciter.V_RMAX", low="exciter.V_RMIN",
          knows=_names(_EXCITER, "amplifier", "V_IMAX"), lacks=_names(_EXCITER, "K_LR")),
    _exciter("limit of the regulator", "bridge", "V_RMAX", "V_RMIN", knows=_names(_EXCITER, "regulator"),
             lead=Lead("exciter.bridge", "exciter.T_A", lag="exciter.T_A")),
    _stabiliser(2, "T_3", "T_4", lacks=_names(_PSS, "lead_lag_3")),
    _stabiliser(3, "T_10", "T_11"),
    # TGOV1 and GAST; IEEEG1; HYGOV, whose limited signal is that before the gate's servo.
    _part(_GOVERNOR, "limit of the valve", "valve", "V_MAX", "V_MIN"),
    _part(_GOVERNOR, "limit of the valve", "gate", "P_MAX", "P_MIN"),
    _rate("limit of the valve's speed", "gate", "U_o", "U_c"),
    _part(_GOVERNOR, "limit of the gate", "gate", "G_MAX", "G_MIN",
          lead=Lead("governor.gate", "governor.T_g")),
    Limit("limit of the gate's speed", "der(governor.gate)", "governor.VELM"),
)  # fmt: skip
"""Limits by the names of parts in `fmus.synchronous_generator`."""

_READ = frozenset(name for limit in MACHINE_LIMITS for name in limit.variables())


def is_inner(name: str, system: System) -> bool:
    """Whether a signal is an inner state of a machine that is read for its limits alone, and judged by nothing else."""
    component, _, variable = name.partition(".")
    return variable in _READ and variable not in system.components[component].description.outputs
