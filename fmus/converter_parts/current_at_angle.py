"""A current at the angle of the bus voltage, as WECC's models without a PLL feed it, and the emf that gives it."""

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE, ExtrapolatedVoltage
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import MasterStep, SourceEmf, motion
from fmus.toolchain.symbols import Expr, fmax


def port_of_current(m: ModelBuilder) -> Phasor:
    """Declare the impedance across which a current is fed."""
    text = (
        "Reactance of the port, across which the current is fed; it changes nothing in steady state"
    )
    X = m.parameter("X_port", 2.0, "pu", text, base="S_n", minimum=0.01, source="chosen here")
    R = m.parameter("R_port", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    return Phasor(R, X)


def at_angle_of(v: Phasor, current: Phasor) -> Phasor:
    """Return a current that is given at a voltage's angle, in the voltage's frame [pu]."""
    return current * v / fmax(v.magnitude(), LEAST_VOLTAGE)


def emf_of_current(
    m: ModelBuilder,
    seen: ExtrapolatedVoltage,
    Z: Phasor,
    fed: Phasor,
    start: Phasor,
    master: MasterStep,
) -> SourceEmf:
    """Return the emf behind Z that feeds a current, half a step ago and in half a step.

    ``fed``: at the voltage's angle [pu, S_n]; ``start``: of the operating point."""
    with m.scope("source"):
        moving = motion(m, "i", fed, start, "Current at the voltage's angle")

    def emf(time: Expr) -> Phasor:
        v = seen.after(time)
        return v + Z * at_angle_of(v, fed + moving * time)

    return SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
