"""Declarations of all machines of `synchronous_generator`: their base, motion and the transformer in series.

Data sheets give reactances, H and D on ratings of their own; networks on 100 MVA. ``machine.S_data`` says on which."""

from dataclasses import dataclass

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else

SOURCE = "typical data of a steam turbine's generator, Kundur 1994, example 12.6"

SN = "S_n"


@dataclass(frozen=True)
class Common:
    """Transformer, stator resistance, inertia constant and damping on S_n; ``scale`` carries a reactance to S_n."""

    R_t: Expr
    X_t: Expr
    R_s: Expr
    H: Expr
    D: Expr
    scale: Expr


LEAST_INERTIA = 0.01
"""Smallest inertia constant of a rotor [s]: far below every machine's."""


def declare_common(
    m: ModelBuilder, S_n: Expr, H: float = 6.5, least_H: float = LEAST_INERTIA
) -> Common:
    """Declare transformer, base, resistance and motion; in steady state speed is 1.

    ``S_n``: rating [MVA]; ``H``: default of the inertia constant [s]; ``least_H``: its smallest value [s]."""
    with m.scope("transformer"):
        R_t = m.parameter("R_t", 0.0, "pu", "Resistance", base=SN, minimum=0)
        X_t = m.parameter(
            "X_t",
            0.0,
            "pu",
            "Reactance; 0 where the network has the transformer",
            base=SN,
            minimum=0,
        )
    with m.scope("machine"):
        S_data = m.parameter(
            "S_data",
            0.0,
            "MVA",
            "Base of the machine's data (X, R_s, H, D); 0: they are on S_n",
            minimum=0,
        )
        scale = m.calculated(
            "scale", if_else(S_data > 0, S_n / S_data, 1), "1", "S_n over the data's base"
        )
        R_s = m.parameter(
            "R_s", 0.0025, "pu", "Stator resistance", base="S_data", minimum=0, source=SOURCE
        )
        text = "Inertia constant, on S_data" + ("" if least_H else "; 0: an infinite bus")
        inertia = m.parameter("H", H, "s", text, minimum=least_H, source=SOURCE)
        D = m.parameter(
            "D", 0.0, "pu", "Damping torque per speed deviation", base="S_data", minimum=0
        )
        return Common(R_t, X_t, scale * R_s, inertia / scale, D / scale, scale)


def reactance(m: ModelBuilder, name: str, value: float, text: str, *, least: float = 1e-4) -> Expr:
    """Declare a reactance on the data's base; ``least``: its smallest value [pu]."""
    return m.parameter(name, value, "pu", text, base="S_data", minimum=least, source=SOURCE)


def time(m: ModelBuilder, name: str, value: float, text: str) -> Expr:
    """Declare an open-circuit time constant [s]."""
    return m.parameter(name, value, "s", text, minimum=1e-3, source=SOURCE)
