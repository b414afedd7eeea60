"""Faults: an impedance R + jX to earth behind a switch.

In an EMT network its current is a state; once the fault is over the current fades within a millisecond, as that of a
line which opens. In a network of phasors it is an admittance, and may be that of a fault of fewer phases: R + jX then
hold the impedances of the other sequences, which may be capacitive."""

from fmus.grid.element_data import SMALLEST_REACTANCE
from fmus.grid.elements import Branch, Bus
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr

LARGEST_REACTANCE = 100.0  # of a fault in an EMT network [pu, 100 MVA]
_LARGEST_CAPACITIVE = 1e6
"""Largest size of a fault's reactance in a network of phasors [pu, 100 MVA]: where neutrals are not earthed, the small
capacitance to earth of the network is met in series."""


def declare_fault(m: ModelBuilder, bus: str, buses: dict[str, Bus]) -> Branch:
    """Declare a fault at a bus, with its current as a state."""
    R, X, on = _declare_values(m, bus, SMALLEST_REACTANCE, LARGEST_REACTANCE)
    text = "Current of the fault"
    with m.scope(f"{bus}.fault"):
        current = Phasor(
            m.state("i_re_state", 0.0, "pu", f"{text}, real part", SYSTEM_BASE),
            m.state("i_im_state", 0.0, "pu", f"{text}, imaginary part", SYSTEM_BASE),
        )
    buses[bus].injected -= current
    return Branch(current, current, R, X, bus, connected=on)


def fault_admittance(m: ModelBuilder, place: str) -> Phasor:
    """Declare a fault at a bus; its admittance is 0 while there is none."""
    return switched_fault_admittance(m, place)[0]


def switched_fault_admittance(m: ModelBuilder, place: str) -> tuple[Phasor, Expr]:
    """Declare a fault at a bus or along a line: its admittance, 0 while there is none, and its switch."""
    R, X, on = _declare_values(m, place, -_LARGEST_CAPACITIVE, _LARGEST_CAPACITIVE)
    m.require(R * R + X * X, f"the fault of {place} has no impedance: give it a reactance")
    return Phasor(1.0, 0.0) / Phasor(R, X) * on, on


def declare_fault_outputs(m: ModelBuilder, bus: str, current: Phasor) -> None:
    """Declare the current of a fault as outputs."""
    with m.scope(f"{bus}.fault"):
        m.output(
            "i_re",
            current.re,
            "pu",
            "Current into the fault, real part, network frame",
            base=SYSTEM_BASE,
        )
        m.output(
            "i_im",
            current.im,
            "pu",
            "Current into the fault, imaginary part, network frame",
            base=SYSTEM_BASE,
        )


def _declare_values(
    m: ModelBuilder, bus: str, least: float, most: float
) -> tuple[Expr, Expr, Expr]:
    """Declare R, X and the switch; where X may be negative R may be, as equivalents of reduced networks are."""
    with m.scope(f"{bus}.fault"):
        return (
            m.parameter(
                "R",
                0.0,
                "pu",
                f"Resistance of a fault at {bus}",
                base=SYSTEM_BASE,
                minimum=0 if least > 0 else None,
                tunable=True,
            ),
            m.parameter(
                "X",
                SMALLEST_REACTANCE,
                "pu",
                f"Reactance of a fault at {bus}",
                base=SYSTEM_BASE,
                minimum=least,
                maximum=most,
                tunable=True,
            ),
            m.switch("on", False, f"There is a fault at {bus}", tunable=True),
        )
