"""Machines with a field winding: from standard data to windings on each axis, and their steady state.

Stator, motion and frame are those of `machine`, the windings the classical ones of `conversion`. Saturation adds a
current of the iron, S·ψ/X_md, beside the slowest winding of an axis:

    ψ̇_f/ω_b = (R_f/X_md)·(E_fd − X_md·i_f − S·ψ_d)        ψ̇_1q/ω_b = −R_1q·(i_1q + S·ψ_q/X_md)"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fmus.synchronous_generator.axis import Axis, Winding
from fmus.synchronous_generator.conversion import AxisData, RotorBranches
from fmus.synchronous_generator.conversion import classical as classical_branches
from fmus.synchronous_generator.machine import FluxDeclaration, Machine, Start, flux_state
from fmus.synchronous_generator.machines.base import Common
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fmax, if_else


@dataclass(frozen=True)
class WoundAxis:
    """Standard data of an axis on S_n, and (name, description) of its windings' fluxes from slow to fast.

    With one winding its reactance X' and time constant T'_0 stand in ``X1`` and ``T10``, and ``X2`` is X' too."""

    data: AxisData
    fluxes: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Saturation:
    """S(x)·x as a function of x [pu].

    ``both_axes``: of the subtransient flux, on both axes by its parts (GENROU); otherwise of E'_q on the d axis
    (GENSAL)."""

    part: Callable[[Expr], Expr]
    both_axes: bool


@dataclass(frozen=True)
class _Circuit:
    """Reactances of an axis: magnetising, of its windings, of the air gap, and between emf and bus."""

    X_m: Expr
    branches: tuple[tuple[Expr, Expr], ...]
    X_sub: Expr
    X_between: Expr


def declare_wound_machine(
    m: ModelBuilder, port: DevicePort, common: Common, d: WoundAxis, q: WoundAxis, stator_flux: FluxDeclaration,
    saturation: Saturation | None = None, *, salient: bool = False,
) -> Machine:  # fmt: skip
    """Declare windings, speed and angle in the steady state of the operating point.

    ``port``: gives the operating point; ``common``: transformer, stator resistance and motion; ``d``, ``q``: data of
    the axes. With saturation of both axes X''_d = X''_q; ``saturation``: of the iron; None for none; ``salient``:
    whether the last reactances of the axes, X'' or X', may differ."""
    with m.scope("machine"):
        circuits = {name: _circuit(m, port, name, axis, common.X_t) for name, axis in (("d", d), ("q", q))}
        dc, qc = circuits["d"], circuits["q"]
        R, X_l = common.R_s + common.R_t, d.data.X_l
        has_slow_q = if_else(q.data.X - q.data.X1 > 1e-9, 1, 0)
        S_q = Expr(0)  # saturation of the q axis, S
        if saturation and saturation.both_axes:
            flux = (port.v_0 + Phasor(R, dc.X_between) * port.i_0).magnitude()
            S = m.calculated("saturation_0", saturation.part(flux) / flux, "1", "S(ψ'') at the operating point")
            S_q = S * has_slow_q
        X_q = qc.X_between + (q.data.X - X_l - qc.X_sub) / (1 + S_q * qc.X_m / dc.X_m)
        delta_0 = (port.v_0 + Phasor(R, X_q) * port.i_0).angle()
        i, v = port.i_0.rotated(-delta_0), port.v_0.rotated(-delta_0)
        i_q, i_d = Expr(i.re), Expr(-i.im)
        psi_d, psi_q = v.re + R * i_q, v.im - R * i_d
        gap_d, gap_q = psi_d + (common.X_t + X_l) * i_d, psi_q + (common.X_t + X_l) * i_q
        axis_d = _axis(m, d, dc, stator_flux, ("psi_d", psi_d), gap_d, i_d)
        axis_q = _axis(m, q, qc, stator_flux, ("psi_q", psi_q), gap_q, i_q)
        iron = Expr(0)  # S·ψ_d at the operating point
        if saturation and saturation.both_axes:
            iron = S * (psi_d + dc.X_between * i_d)
            now = (axis_d.emf**2 + axis_q.emf**2) ** 0.5
            factor = saturation.part(now) / fmax(now, 1e-6)
            axis_q = _with_iron(axis_q, has_slow_q * factor * axis_q.emf / dc.X_m)
            axis_d = _with_iron(axis_d, factor * axis_d.emf / dc.X_m)
        elif saturation:
            iron = saturation.part(psi_d + (common.X_t + d.data.X1) * i_d)
            E_q1 = axis_d.windings[0].psi * dc.X_m / (dc.X_m + axis_d.windings[0].X)
            axis_d = _with_iron(axis_d, saturation.part(E_q1) / dc.X_m)
        E_fd = gap_d + dc.X_m * i_d + iron
        w = m.state("omega", 1.0, "pu", "Rotor speed", base="f_n")
        delta = m.state("delta", delta_0, "rad", "Rotor angle in the network frame")
    v_t = port.v_0 + Phasor(common.R_t, common.X_t) * port.i_0
    start = Start(v_t.magnitude(), E_fd, psi_d * i_q - psi_q * i_d, v, i)
    return Machine(R, common.R_t, common.X_t, common.H, common.D, axis_d, axis_q, w, delta, start, salient)


def _circuit(m: ModelBuilder, port: DevicePort, name: str, axis: WoundAxis, X_t: Expr) -> _Circuit:
    data = axis.data
    X_m = m.calculated(f"X_m{name}", data.X - data.X_l, "pu", f"Magnetising reactance, {name} axis", "S_n")
    b: RotorBranches = classical_branches(data, port.omega_b)
    branches = []
    for number, (X, R) in enumerate(((b.X_1, b.R_1), (b.X_2, b.R_2))[: len(axis.fluxes)], start=1):
        text = f"Rotor winding {number} of the {name} axis"
        declared_X = m.calculated(f"{name}_X_{number}", X, "pu", f"{text}: leakage reactance", "S_n")
        declared_R = m.calculated(f"{name}_R_{number}", R, "pu", f"{text}: resistance", "S_n")
        branches.append((declared_X, declared_R))
    total = 1 / X_m
    for X, _ in branches:
        total += 1 / X
    X_sub = m.calculated(f"X_m{name}2", 1 / total, "pu", f"Last reactance of the {name} axis, less X_l", "S_n")
    return _Circuit(X_m, tuple(branches), X_sub, X_sub + data.X_l + X_t)


def _axis(
    m: ModelBuilder, axis: WoundAxis, circuit: _Circuit, stator_flux: FluxDeclaration, stator: tuple[str, Expr],
    gap: Expr, i: Expr,
) -> Axis:  # fmt: skip
    """Declare the fluxes of an axis; in steady state its slowest winding alone has a current."""
    name, psi = stator
    stator_psi = stator_flux(m, name, psi, f"Flux of stator and transformer, {name[-1]} axis")
    windings = []
    for k, ((flux, text), (X, R)) in enumerate(zip(axis.fluxes, circuit.branches, strict=True)):
        current = gap / circuit.X_m + i if k == 0 else 0.0
        windings.append(Winding(X, R, flux_state(m, flux, gap + X * current, text)))
    return Axis(circuit.X_m, tuple(windings), stator_psi, circuit.X_sub, circuit.X_between)


def _with_iron(axis: Axis, current: Expr) -> Axis:
    slow, *others = axis.windings
    return replace(axis, windings=(replace(slow, saturation_current=current), *others))
