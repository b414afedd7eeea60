"""Three-winding transformers: currents of two windings as states, the third is minus their sum.

With v_k behind the ratios, leg 3 subtracted from legs 1 and 2, and the star point is gone without loss:

    1/ω_b·[[X_1 + X_3, X_3], [X_3, X_2 + X_3]]·d(i_1, i_2)/dt = (e_1, e_2),  e_k = v_k − v_3 − Z_k·i_k + Z_3·i_3

It has a solution wherever that matrix is positive definite, also where one X_k is negative."""

from dataclasses import dataclass

from fmus.grid.element_data import ThreeWinding
from fmus.grid.elements import Bus, declare_power
from fmus.grid.nodal_equations import Admittances, add_admittance
from fmus.toolchain.frames import Phasor, phasor_derivative, polar
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr

_ONE = Phasor(1.0, 0.0)


@dataclass(frozen=True)
class Windings:
    """A declared transformer: Z = R + jX and the ratio of each winding, 1 or 0 where it is open, and its currents."""

    data: ThreeWinding
    Z: tuple[Phasor, Phasor, Phasor]
    ratio: tuple[Phasor, Phasor, Phasor]
    connected: Expr
    currents: tuple[Phasor, Phasor, Phasor] | None = None


def declare_windings(m: ModelBuilder, data: ThreeWinding) -> Windings:
    """Declare the parameters of a transformer."""
    Z, ratio = [], []
    with m.scope(data.name):
        for k in range(3):
            n, text = k + 1, f"of winding {k + 1} in the star"
            X = m.parameter(
                f"X_{n}",
                data.X[k],
                "pu",
                f"Reactance {text}",
                base=SYSTEM_BASE,
                minimum=-100,
                maximum=100,
            )
            R = m.parameter(
                f"R_{n}", data.R[k], "pu", f"Resistance {text}", base=SYSTEM_BASE, minimum=-100
            )
            Z.append(Phasor(R, X))
            turns = _ONE
            if data.has_ratio(k):
                tap = m.parameter(
                    f"tap_{n}", data.tap[k], "1", f"Ratio at winding {n}", minimum=0.1, maximum=10
                )
                turns = polar(
                    tap,
                    m.parameter(f"shift_{n}", data.shift[k], "rad", f"Phase shift at winding {n}"),
                )
            ratio.append(turns)
        connected = m.switch(
            "connected", True, "The transformer is closed at all windings", tunable=True
        )
    a, b, c = (Expr(z.im) for z in Z)
    rule = f"transformer {data.name}: the reactances of any two windings, and of all three, must be those of inductors"
    m.require(a + c, rule)
    m.require(a * b + b * c + c * a, rule)
    return Windings(data, (Z[0], Z[1], Z[2]), (ratio[0], ratio[1], ratio[2]), connected)


def declare_transformer(m: ModelBuilder, data: ThreeWinding, buses: dict[str, Bus]) -> Windings:
    """Declare a transformer with its currents as states, and take them from its buses."""
    windings = declare_windings(m, data)
    start = _standing(windings, [buses[bus].v_0 for bus in data.buses])
    found = []
    with m.scope(data.name):
        for k in (0, 1):
            parts = [
                m.state(
                    f"i_{part}_{k + 1}",
                    value,
                    "pu",
                    f"Current of winding {k + 1}, {which} part",
                    SYSTEM_BASE,
                )
                for part, which, value in (
                    ("re", "real", start[k].re),
                    ("im", "imaginary", start[k].im),
                )
            ]
            found.append(Phasor(parts[0], parts[1]))
    currents = (found[0], found[1], -(found[0] + found[1]))
    for bus, current, ratio in zip(data.buses, currents, windings.ratio, strict=True):
        buses[bus].injected -= current / ratio.conjugate()
    return Windings(data, windings.Z, windings.ratio, windings.connected, currents)


def transformer_equations(
    m: ModelBuilder, windings: Windings, buses: dict[str, Bus], omega_b: Expr
) -> None:
    """Give both currents their rates; where the transformer is open they fade, as a line's current does.

    ``windings``: the declared transformer, with its currents; ``buses``: by name; they give the voltages; ``omega_b``:
    rated angular frequency [rad/s]."""
    assert windings.currents is not None
    behind = [buses[bus].v / t for bus, t in zip(windings.data.buses, windings.ratio, strict=True)]
    drops = [z * i for z, i in zip(windings.Z, windings.currents, strict=True)]
    over = [behind[k] - behind[2] - drops[k] + drops[2] for k in (0, 1)]
    a, b, c = (Expr(z.im) for z in windings.Z)
    factor = windings.connected * omega_b / (a * b + b * c + c * a)
    fading = (1 - windings.connected) / BREAKER_TIME
    for current, own, other, X in (
        (windings.currents[0], over[0], over[1], b + c),
        (windings.currents[1], over[1], over[0], a + c),
    ):
        rate = (own * X - other * c) * factor - current * fading
        phasor_derivative(m, current, rate)


def add_windings(Y: Admittances, windings: Windings) -> None:
    """Add a transformer to the admittances."""
    for k, own in enumerate(_admittances(windings)):
        for other, y in enumerate(own):
            scaled = y / (windings.ratio[k].conjugate() * windings.ratio[other])
            add_admittance(Y, windings.data.buses[k], windings.data.buses[other], scaled)


def declare_winding_powers(m: ModelBuilder, windings: Windings, buses: dict[str, Bus]) -> None:
    """Declare the power that enters each winding, as outputs."""
    voltages = [buses[bus].v for bus in windings.data.buses]
    currents = windings.currents or _standing(windings, voltages)
    for k in range(3):
        drawn = currents[k] / windings.ratio[k].conjugate()
        texts = f"Active power entering winding {k + 1}", f"Reactive power entering winding {k + 1}"
        declare_power(m, f"{windings.data.name}.winding_{k + 1}", voltages[k], drawn, *texts)


def _admittances(windings: Windings) -> tuple[tuple[Phasor, ...], ...]:
    """Admittances of the three windings behind their ratios: y_j·y_k/Σy off the diagonal, without dividing by Z."""
    a, b, c = windings.Z
    scale = _ONE / (a * b + b * c + c * a) * windings.connected
    return (
        ((b + c) * scale, -c * scale, -b * scale),
        (-c * scale, (a + c) * scale, -a * scale),
        (-b * scale, -a * scale, (a + b) * scale),
    )


def _standing(windings: Windings, voltages: list[Phasor]) -> tuple[Phasor, Phasor, Phasor]:
    """Currents into the windings in steady state."""
    behind = [v / t for v, t in zip(voltages, windings.ratio, strict=True)]
    rows = [y[0] * behind[0] + y[1] * behind[1] + y[2] * behind[2] for y in _admittances(windings)]
    return rows[0], rows[1], rows[2]
