"""An FMU of a voltage source behind a reactance, whose angle can follow that of the bus."""

import shutil
from pathlib import Path

import casadi as ca

from fmus.toolchain.exporter import cached
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.port import declare_port_outputs, device_port


def reactance_source() -> Model:
    """Source behind X and X/10; with ``follow`` its angle keeps its start's distance from the bus behind a lag."""
    m = ModelBuilder("reactance_source", "A voltage source behind a reactance")
    port = device_port(m, 100.0, 0.5)
    X = m.parameter("X", 0.15, "pu", "Reactance", base="S_n", minimum=0.01)
    follow = m.parameter("follow", 0.0, "1/s", "Rate at which the angle follows the bus; 0: never", minimum=0)
    Z = Phasor(X / 10, X)
    inside = port.v_0 + Z * port.i_0
    delta = m.state("delta", 0.0, "rad", "Angle by which the source has moved")
    moved = ca.atan2(port.v.im, port.v.re) - ca.atan2(port.v_0.im, port.v_0.re)
    m.derivative(delta, follow * (moved - delta))
    i = Phasor(
        m.state("i_source_re", port.i_0.re, "pu", "Current, real part", base="S_n"),
        m.state("i_source_im", port.i_0.im, "pu", "Current, imaginary part", base="S_n"),
    )
    rate = (inside.rotated(delta) - port.v - Z * i) * (port.omega_b / X)
    m.derivative(ca.SX(i.re), rate.re)
    m.derivative(ca.SX(i.im), rate.im)
    declare_port_outputs(m, port, i)
    return m.build()


def write_source(folder: Path) -> Path:
    """The FMU, in a folder."""
    return Path(shutil.copyfile(cached(NativeFmu(reactance_source())), folder / "reactance_source.fmu"))
