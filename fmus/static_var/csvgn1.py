"""PSS/E's CSVGN1: a static var compensator, a fixed capacitor beside a reactor that thyristors control.

    v − V_ref → K·(1+sT_1)(1+sT_2)/((1+sT_3)(1+sT_4)) → within V_MIN and V_MAX → 1/(1+sT_5), within R_MIN/S_n and 1 → y
    B = (C_BASE − S_n·y)/S_n        [pu, S_n]

y is the reactor's share of S_n, which is MBASE; a higher voltage asks for more of it. At the start y follows from the
reactive power of the power flow, and V_ref from y.

Sources: PSS/E's CSVGN1 as PowerSimulationsDynamics.jl and PowerWorld's guide describe it; the order of its fields as in
the 14-generator benchmark of the IEEE PES."""

from fmus.static_var.reactor import reactor_susceptance
from fmus.static_var.susceptance import susceptance_model
from fmus.toolchain.model import Model

S_N = 430.0
"""Default rating [MVA]."""


def csvgn1_phasor() -> Model:
    """The static var compensator, phasor type."""
    title = "Static var compensator CSVGN1 of PSS/E (phasor type)"
    return susceptance_model("csvgn1_phasor", title, S_N, reactor_susceptance)
