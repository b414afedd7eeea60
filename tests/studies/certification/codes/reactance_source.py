"""An FMU of a voltage source behind a reactance, whose angle can follow that of the bus, and which can cheat."""

import shutil
from math import pi
from pathlib import Path

from fmus.toolchain import port_variables
from fmus.toolchain.exporter import cached
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.port import BREAKER_TIME, device_port
from fmus.toolchain.symbols import Expr, atan2, fmax, fmin, if_else, sqrt


def reactance_source() -> Model:
    """Source behind X and X/10; with ``follow`` its angle keeps its start's distance from the bus behind a lag.

    From ``cheat.at`` on it can turn away by ``cheat.turns`` in a second, which no output shows, let its current fade
    where ``cheat.trips``, hold the current that it has where ``cheat.holds``, and give no numbers where ``cheat.nan``.
    Its outputs p and q never move where ``cheat.lies``.
    """
    m = ModelBuilder("reactance_source", "A voltage source behind a reactance")
    port = device_port(m, 100.0, 0.5)
    X = m.parameter("X", 0.15, "pu", "Reactance", base="S_n", minimum=0.01)
    follow = m.parameter(
        "follow", 0.0, "1/s", "Rate at which the angle follows the bus; 0: never", minimum=0
    )
    Z = Phasor(X / 10, X)
    inside = port.v_0 + Z * port.i_0
    phi = m.state("phi", 0.0, "rad", "Angle by which the source has moved")
    with m.scope("cheat"):
        t = m.state("t", 0.0, "s", "Time")
        at = m.parameter("at", 1e9, "s", "When it begins")
        turns = m.parameter("turns", 0.0, "1", "Turns in the second after")
        trips, holds, nan, lies = (
            m.switch(name, False, name) for name in ("trips", "holds", "nan", "lies")
        )
    m.derivative(t, Expr(1.0))
    begun = t >= at
    away = 2 * pi * turns * fmin(fmax(t - at, 0), 1)
    moved = atan2(port.v.im, port.v.re) - atan2(port.v_0.im, port.v_0.re)
    m.derivative(phi, follow * (moved - phi))
    i = Phasor(
        m.state("i_source_re", port.i_0.re, "pu", "Current, real part", base="S_n"),
        m.state("i_source_im", port.i_0.im, "pu", "Current, imaginary part", base="S_n"),
    )
    rate = (inside.rotated(phi + away) - port.v - Z * i) * (port.omega_b / X)
    gone, held = begun * trips, 1 - begun * holds
    broken = if_else(begun * nan, sqrt(at - t), 1)
    for current, change in ((i.re, rate.re), (i.im, rate.im)):
        m.derivative(
            Expr(current), ((1 - gone) * change - gone * current / BREAKER_TIME) * held * broken
        )
    shown = power(port.v, i)
    said = power(port.v_0, port.i_0)
    m.declare_output(port_variables.I_RE, i.re * port.current_scale)
    m.declare_output(port_variables.I_IM, i.im * port.current_scale)
    m.declare_output(port_variables.P, if_else(lies, said.re, shown.re))
    m.declare_output(port_variables.Q, if_else(lies, said.im, shown.im))
    return m.build()


def write_source(folder: Path) -> Path:
    """The FMU, in a folder."""
    return Path(
        shutil.copyfile(cached(NativeFmu(reactance_source())), folder / "reactance_source.fmu")
    )
