"""Thévenin equivalent of what lies beyond the network: a constant voltage behind R + jX of its short-circuit power."""

from dataclasses import replace

from fmus.toolchain import port_variables
from fmus.toolchain.frames import Phasor, phasor_derivative
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import SourceEmf, declare_phasor_outputs, phasor_builder
from fmus.toolchain.port import BREAKER_TIME, DevicePort, declare_port_outputs, device_port_of
from fmus.toolchain.symbols import sqrt

S_SC = 20000.0  # default short-circuit power [MVA]


def external_grid() -> Model:
    """Source and impedance in the network frame, EMT type."""
    m = ModelBuilder(
        "external_grid",
        "External grid: a voltage source behind its short-circuit impedance (EMT type)",
        kind="network",
    )
    port, Z, e = _declare(m)
    i = Phasor(
        m.state("i_x", port.i_0.re, "pu", "Current into the bus, real part", base="S_n"),
        m.state("i_y", port.i_0.im, "pu", "Current into the bus, imaginary part", base="S_n"),
    )
    closed = (e - port.v - Z * i) * (port.omega_b / Z.im)
    rate = port.through_breaker(closed, i * (-1 / BREAKER_TIME))
    phasor_derivative(m, i, rate)
    declare_port_outputs(m, port, i)
    return m.build()


def external_grid_phasor() -> Model:
    """The same without network transients."""
    m = phasor_builder(
        "external_grid_phasor",
        "External grid: a voltage source behind its impedance (phasor type)",
        kind="network",
    )
    port, Z, e = _declare(m)
    declare_phasor_outputs(m, port, SourceEmf(behind=e, ahead=e), Z)
    return m.build()


def _declare(m: ModelBuilder) -> tuple[DevicePort, Phasor, Phasor]:
    """Port, impedance [pu, S_n] and the source's voltage [pu], which the power flow gives."""
    text = "Short-circuit power of the grid, the device's base: |R + jX| is 1 pu"
    S_n = m.declare(replace(port_variables.S_N, start=S_SC, description=text))
    port = device_port_of(m, S_n, P_0=0.0)
    ratio = m.parameter("R_X", 0.1, "1", "R/X of the grid's impedance", minimum=0.0, maximum=10.0)
    X = 1 / sqrt(1 + ratio**2)
    Z = Phasor(ratio * X, X)
    start = port.v_0 + Z * port.i_0
    with m.scope("source"):
        e = Phasor(
            m.calculated("E_re", start.re, "pu", "Voltage of the source, real part", base="bus"),
            m.calculated(
                "E_im", start.im, "pu", "Voltage of the source, imaginary part", base="bus"
            ),
        )
    return port, Z, e
