"""A limit of an FMU, described by the variables that show when it acts, and the limits of machines' parts."""

from collections.abc import Container
from dataclasses import dataclass
from functools import partial

from orchestrator.systems.coupling.system import System

# with which the state of a block that is left out follows its input [s], as the models have it
BYPASS_TIME = 0.01


@dataclass(frozen=True)
class Lead:
    """The limited quantity, reconstructed as signal + T/gain·(d state/dt) from the state of a block or of a control's
    integrator."""

    state: str
    # time, gain: parameters with T [s] and the gain; None stands for 1
    time: str
    gain: str | None = None
    # parameter with the lag of a lead/lag, whose block is left out where it is 0; its state then follows the input with
    # `BYPASS_TIME`, and T is that time
    lag: str | None = None


@dataclass(frozen=True)
class Limit:
    """The variables of an FMU that show an active limit. The limit is watched if the FMU has all of them."""

    name: str
    signal: str
    # parameter with the limit of the magnitude, or the upper one where there is a lower one; None if the signal is
    # given as a part of the limit
    limit: str | None
    # reconstruction of the limited quantity from a derivative, if the signal only follows this quantity
    lead: Lead | None = None
    enabled: str | None = None  # switch that must be on for the limited signal to have an effect
    # Whether the model has the limit. Otherwise the FMU only shows when the limit would act.
    represented: bool = True
    low: str | None = None  # parameter with the lower limit; None if the magnitude is limited
    scale: str | None = None  # signal that both limits are multiplied by
    # Parameter that is above 0 where another limit acts instead. An FMU need not have it.
    unless: str | None = None
    knows: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()

    def variables(self) -> tuple[str, ...]:
        derivative = None if self.lead is None else f"der({self.lead.state})"
        return tuple(name for name in (self.signal, derivative, self.scale) if name is not None)

    def needed(self) -> tuple[str, ...]:
        lead = (self.lead.time, self.lead.gain, self.lead.lag) if self.lead is not None else ()
        parameters = (self.limit, self.low, self.enabled, *lead)
        return (*self.variables(), *self.knows, *(p for p in parameters if p is not None))

    def fits(self, variables: Container[str]) -> bool:
        return all(name in variables for name in self.needed()) and not any(
            name in variables for name in self.lacks
        )


# scopes of a machine's parts
_EXCITER = "exciter"
_GOVERNOR = "governor"
_PSS = "pss"


def _part(part: str, what: str, signal: str, high: str, low: str, **further: object) -> Limit:
    return Limit(what, f"{part}.{signal}", f"{part}.{high}", low=f"{part}.{low}", **further)  # type: ignore[arg-type]


_exciter = partial(_part, _EXCITER)


def _names(part: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{part}.{name}" for name in names)


def _stabiliser(stage: int, lead: str, lag: str, **further: object) -> Limit:
    state = f"{_PSS}.lead_lag_{stage}"
    output = Lead(state, f"{_PSS}.{lead}", lag=f"{_PSS}.{lag}")
    return _part(
        _PSS,
        "output limit of the stabiliser",
        f"lead_lag_{stage}",
        "V_STMAX",
        "V_STMIN",
        lead=output,
        enabled=f"{_PSS}.enabled",
        **further,
    )


MACHINE_LIMITS = (
    Limit("limiter of overexcitation", "oel.acts", None),
    Limit("limiter of underexcitation", "uel.acts", None),
    # SEXS; IEEET1 and DC1A; AC1A, whose amplifier has two pairs of limits; AC4A without the rectifier's loading; ST1A.
    _exciter("ceiling of the exciter", "amplifier", "E_MAX", "E_MIN"),
    _exciter(
        "ceiling of the regulator", "amplifier", "V_RMAX", "V_RMIN", knows=_names(_EXCITER, "E")
    ),
    _exciter(
        "ceiling of the regulator", "amplifier", "V_RMAX", "V_RMIN", knows=_names(_EXCITER, "V_E")
    ),
    _exciter("limit of the amplifier", "amplifier", "V_AMAX", "V_AMIN"),
    Limit(
        "ceiling of the exciter",
        "E_fd",
        "exciter.V_RMAX",
        low="exciter.V_RMIN",
        scale="v_t",
        knows=_names(_EXCITER, "V_AMAX", "K_LR"),
    ),
    Limit(
        "ceiling of the exciter",
        "E_fd",
        "exciter.V_RMAX",
        low="exciter.V_RMIN",
        knows=_names(_EXCITER, "amplifier", "V_IMAX"),
        lacks=_names(_EXCITER, "K_LR"),
    ),
    _exciter(
        "limit of the regulator",
        "bridge",
        "V_RMAX",
        "V_RMIN",
        knows=_names(_EXCITER, "regulator"),
        lead=Lead("exciter.bridge", "exciter.T_A", lag="exciter.T_A"),
    ),
    _stabiliser(2, "T_3", "T_4", lacks=_names(_PSS, "lead_lag_3")),
    _stabiliser(3, "T_10", "T_11"),
    # TGOV1 and GAST; IEEEG1; HYGOV, whose limited signal is that before the gate's servo.
    _part(_GOVERNOR, "limit of the valve", "valve", "V_MAX", "V_MIN"),
    _part(_GOVERNOR, "limit of the valve", "gate", "P_MAX", "P_MIN"),
    Limit(
        "limit of the valve's speed",
        f"der({_GOVERNOR}.gate)",
        f"{_GOVERNOR}.U_o",
        low=f"{_GOVERNOR}.U_c",
    ),
    _part(
        _GOVERNOR,
        "limit of the gate",
        "gate",
        "G_MAX",
        "G_MIN",
        lead=Lead("governor.gate", "governor.T_g"),
    ),
    Limit("limit of the gate's speed", "der(governor.gate)", "governor.VELM"),
)
"""Limits by the names of parts in `fmus.synchronous_generator`."""

_READ = frozenset(name for limit in MACHINE_LIMITS for name in limit.variables())


def is_inner(name: str, system: System) -> bool:
    """Tell if a signal is an inner state of a machine that is read for its limits alone, and judged by nothing else."""
    component, _, variable = name.partition(".")
    return variable in _READ and variable not in system.components[component].description.outputs
