"""The limit of fault current of WECC's grid-forming models: the inner voltage gives way to keep it.

The specifications take the terminal voltage of the same instant. A port whose emf follows from states alone needs a
measured one: while the limit acts, the current is limited after that lag."""

from dataclasses import dataclass

from fmus.toolchain.blocks import low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, sqrt


@dataclass(frozen=True)
class FaultLimit:
    """The most current [pu, S_n], and the lag of the terminal voltage by which it is kept [s]."""

    most: Expr
    lag: Expr


def declare_seen_lag(m: ModelBuilder, name: str) -> Expr:
    """Declare the lag of the terminal voltage that the limit sees [s]."""
    return m.parameter(
        name,
        0.002,
        "s",
        "Lag of the terminal voltage that the fault current limit sees",
        minimum=1e-3,
        source="chosen here; none in the specification",
    )


def limited_in_faults(
    m: ModelBuilder, limit: FaultLimit, inner: Phasor, v: Phasor, Z: Phasor, at_rest: Phasor
) -> tuple[Phasor, Expr]:
    """Return the inner voltage that keeps the current within its limit, and the current without it in parts of it.

    ``v``: at the terminal, in the frame of ``inner`` [pu]; ``at_rest``: that of the operating point."""
    seen = Phasor(
        low_pass(m, "V_seen_re", Expr(v.re), limit.lag, at_rest.re),
        low_pass(m, "V_seen_im", Expr(v.im), limit.lag, at_rest.im),
    )
    current = (inner - seen) / Z
    square = (current.re**2 + current.im**2) / limit.most**2
    scale = 1 / sqrt(fmax(1, square))
    # exactly the inner voltage where the limit does not act
    return inner + Z * current * (scale - 1), sqrt(square)


def declare_terminal_outputs(m: ModelBuilder, v: Phasor, i: Phasor, share: Expr) -> None:
    """Declare the size of terminal voltage and current, and how much of the limit the current asks for."""
    m.output("V", v.magnitude(), "pu", "Voltage magnitude at the terminal", base="bus")
    m.output("I", i.magnitude(), "pu", "Magnitude of the current", base="S_n")
    m.output(
        "fault_current",
        share,
        "1",
        "Current without the fault current limit, in parts of it; above 1 it acts",
    )
