"""Machines GENROU, GENSAL, GENROE, GENSAE and two-axis, each from the standard data of its data sheet.

    two_axis  4th order: field, one winding on the q axis          X_d, X'_d, T'_d0; X_q, X'_q, T'_q0
    gensal    5th order: field and damper, one damper on the q axis  X_d, X'_d, X'', T'_d0, T''_d0; X_q, T''_q0
    genrou    6th order: field and damper, two windings on the q axis
    genroe    genrou with another curve of saturation, S(x) = S(1.0)·xⁿ
    gensae    gensal with that curve, of the subtransient flux, on both axes
    genrou_rated_speed  genrou with the emf at rated speed, for phasors alone: RMS simulation of stability programs

Their stator is that of `machine`: with stator transients EMT-type, algebraic in the phasor model. As in stability
programs' models of these names X''_q = X''_d, and saturation adds a current of the iron, S·ψ/X_md, beside the slowest
winding of an axis. X'_q = X_q (genrou, two_axis) says that the slow winding of the q axis is missing; saturation acts
on that axis all the same, with T'_q0.
The equations of these names hold for T''_0 ≥ T'_0 too, as each winding has its own time constant, and for X'' > X' and
X_l ≥ X'', where a winding has a negative reactance; only X_l = X' of an axis with two windings is singular.

    ψ̇_f/ω_b = (R_f/X_md)·(E_fd − X_md·i_f − S·ψ_d)        ψ̇_1q/ω_b = −R_1q·(i_1q + S·ψ_q/X_md)"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from fmus.synchronous_generator.axis import Axis, Winding
from fmus.synchronous_generator.conversion import LEAST_LEAKAGE, AxisData, RotorBranches
from fmus.synchronous_generator.conversion import classical as classical_branches
from fmus.synchronous_generator.machine import FluxDeclaration, Machine, Start, flux_state
from fmus.synchronous_generator.machines.base import Common, declare_common, reactance, time
from fmus.synchronous_generator.saturation import exponential_part, require_rising, saturated_part
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, logic_and


@dataclass(frozen=True)
class WoundAxis:
    """Standard data of an axis on S_n, and (name, description) of its windings' fluxes from slow to fast.

    With one winding its reactance X' and time constant T'_0 stand in ``X1`` and ``T10``, and ``X2`` is X' too."""

    data: AxisData
    fluxes: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Saturation:
    """S(x)·x as a function of x [pu].

    ``both_axes``: of the subtransient flux, on both axes by its parts (GENROU, GENROE, GENSAE); otherwise of E'_q on
    the d axis (GENSAL). ``is_given``: whether the data have a saturation at all."""

    part: Callable[[Expr], Expr]
    both_axes: bool
    is_given: Expr


@dataclass(frozen=True)
class _Circuit:
    """Reactances of an axis: magnetising, of its windings, of the air gap, and between emf and bus."""

    X_m: Expr
    branches: tuple[tuple[Expr, Expr], ...]
    X_sub: Expr
    X_between: Expr


def declare_wound_machine(
    m: ModelBuilder,
    port: DevicePort,
    common: Common,
    d: WoundAxis,
    q: WoundAxis,
    stator_flux: FluxDeclaration,
    saturation: Saturation | None = None,
    *,
    salient: bool = False,
) -> Machine:
    """Declare windings, speed and angle in the steady state of the operating point.

    ``port``: gives the operating point; ``common``: transformer, stator resistance and motion; ``d``, ``q``: data of
    the axes. With saturation of both axes X''_d = X''_q; ``saturation``: of the iron; None for none; ``salient``:
    whether the last reactances of the axes, X'' or X', may differ."""
    with m.scope("machine"):
        circuits = {
            name: _circuit(m, port, name, axis, common.X_t) for name, axis in (("d", d), ("q", q))
        }
        dc, qc = circuits["d"], circuits["q"]
        R, X_l = common.R_s + common.R_t, d.data.X_l
        S_q = Expr(0)  # saturation of the q axis, S
        if saturation and saturation.both_axes:
            flux = (port.v_0 + Phasor(R, dc.X_between) * port.i_0).magnitude()
            S = m.calculated(
                "saturation_0", saturation.part(flux) / flux, "1", "S(ψ'') at the operating point"
            )
            S_q = S
        X_q = qc.X_between + (q.data.X - X_l - qc.X_sub) / (1 + S_q * qc.X_m / dc.X_m)
        delta_0 = (port.v_0 + Phasor(R, X_q) * port.i_0).angle()
        i, v = port.i_0.rotated(-delta_0), port.v_0.rotated(-delta_0)
        i_q, i_d = Expr(i.re), Expr(-i.im)
        psi_d, psi_q = v.re + R * i_q, v.im - R * i_d
        gap_d, gap_q = psi_d + (common.X_t + X_l) * i_d, psi_q + (common.X_t + X_l) * i_q
        axis_d = _axis(m, d, dc, stator_flux=stator_flux, stator=("psi_d", psi_d), gap=gap_d, i=i_d)
        axis_q = _axis(m, q, qc, stator_flux=stator_flux, stator=("psi_q", psi_q), gap=gap_q, i=i_q)
        iron = Expr(0)  # S·ψ_d at the operating point
        if saturation and saturation.both_axes:
            iron = S * (psi_d + dc.X_between * i_d)
            now = (axis_d.emf**2 + axis_q.emf**2) ** 0.5
            factor = saturation.part(now) / fmax(now, 1e-6)
            axis_q = _with_iron(axis_q, factor * axis_q.emf / dc.X_m)
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
    return Machine(
        R=R,
        R_t=common.R_t,
        X_t=common.X_t,
        H=common.H,
        D=common.D,
        d=axis_d,
        q=axis_q,
        w=w,
        delta=delta,
        start=start,
        salient=salient,
    )


def _circuit(m: ModelBuilder, port: DevicePort, name: str, axis: WoundAxis, X_t: Expr) -> _Circuit:
    data = axis.data
    X_m = m.calculated(
        f"X_m{name}", data.X - data.X_l, "pu", f"Magnetising reactance, {name} axis", "S_n"
    )
    b: RotorBranches = classical_branches(data, port.omega_b)
    branches = []
    for number, (X, R) in enumerate(((b.X_1, b.R_1), (b.X_2, b.R_2))[: len(axis.fluxes)], start=1):
        text = f"Rotor winding {number} of the {name} axis"
        declared_X = m.calculated(
            f"{name}_X_{number}", X, "pu", f"{text}: leakage reactance", "S_n"
        )
        declared_R = m.calculated(f"{name}_R_{number}", R, "pu", f"{text}: resistance", "S_n")
        branches.append((declared_X, declared_R))
    total = 1 / X_m
    for X, _ in branches:
        total += 1 / X
    X_sub = m.calculated(
        f"X_m{name}2", 1 / total, "pu", f"Last reactance of the {name} axis, less X_l", "S_n"
    )
    return _Circuit(X_m, tuple(branches), X_sub, X_sub + data.X_l + X_t)


def _axis(
    m: ModelBuilder,
    axis: WoundAxis,
    circuit: _Circuit,
    stator_flux: FluxDeclaration,
    stator: tuple[str, Expr],
    gap: Expr,
    i: Expr,
) -> Axis:
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


_FIELD = ("psi_f", "Field flux")
_DAMPER = ("psi_1d", "Damper flux, d axis")
_FIRST_Q = ("psi_1q", "First damper flux, q axis")
_SECOND_Q = ("psi_2q", "Second damper flux, q axis")

_NO_TIME = 1e-3  # stands for the time constant [s] of a fast winding that a machine does not have
_PATH_OF_SATURATION = 1e-4
"""Part of X_q − X_l by which X'_q stays below X_q at least, where the q axis saturates: it moves no mode by 0.01 %."""

_OF_NO_WINDING = 0.1  # part of T'_0 that stands for a longer T''_0 of such a winding


def two_axis(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare the machine of fourth order (Sauer and Pai). It has no saturation."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        d, q = (
            WoundAxis(
                _one_winding(common, _synchronous(m, axis), _transient(m, axis), _time_1(m, axis)),
                (winding,),
            )
            for axis, winding in (("d", _FIELD), ("q", _FIRST_Q))
        )
        _require_order(m, d.data, q.data, "X_q1")
    return declare_wound_machine(m, port, common, d, q, stator_flux, salient=True)


def gensal(
    m: ModelBuilder,
    port: DevicePort,
    S_n: Expr,
    stator_flux: FluxDeclaration,
    *,
    exponential: bool = False,
) -> Machine:
    """Declare the machine of fifth order, one with salient poles. E'_q saturates the d axis.

    ``exponential``: the subtransient flux saturates both axes, with the exponential curve."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        X_l, X_2, d = _d_axis(m, common)
        X_q = _synchronous(m, "q")
        fast = time(m, "T_q20", 0.05, "Open-circuit subtransient time constant T''_q0")
        q = _one_winding(common, X_q, X_2, fast, X_l)
        _require_order(m, d, q, "X_d2")
        saturation = _saturation(m, both_axes=exponential, exponential=exponential)
    return declare_wound_machine(
        m,
        port,
        common,
        d=WoundAxis(d, (_FIELD, _DAMPER)),
        q=WoundAxis(q, (_FIRST_Q,)),
        stator_flux=stator_flux,
        saturation=saturation,
    )


gensae = partial(gensal, exponential=True)  # PSS/E's GENSAE


def genrou(
    m: ModelBuilder,
    port: DevicePort,
    S_n: Expr,
    stator_flux: FluxDeclaration,
    *,
    exponential: bool = False,
) -> Machine:
    """Declare the machine of sixth order, one with a round rotor. Its subtransient flux saturates both axes.

    ``exponential``: with the exponential curve."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        X_l, X_2, d = _d_axis(m, common)
        X_q, X_q1, T_q10 = _synchronous(m, "q"), _transient(m, "q"), _time_1(m, "q")
        T_q20 = time(m, "T_q20", 0.05, "Open-circuit subtransient time constant T''_q0")
        k = common.scale
        T_q20 = _of_winding(T_q20, T_q10, X_q1 - X_2)
        q = AxisData(k * X_q, k * X_q1, k * X_2, k * X_l, T_q10, T_q20)
        _require_order(m, d, q, "X_q1")
        _require_apart(m, X_l, X_q1, "X_q1")
        saturation = _saturation(m, both_axes=True, exponential=exponential)
        q = _with_path_of_saturation(q, saturation)
    return declare_wound_machine(
        m,
        port,
        common,
        d=WoundAxis(d, (_FIELD, _DAMPER)),
        q=WoundAxis(q, (_FIRST_Q, _SECOND_Q)),
        stator_flux=stator_flux,
        saturation=saturation,
    )


genroe = partial(genrou, exponential=True)  # PSS/E's GENROE


def genrou_rated_speed(
    m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration
) -> Machine:
    """Declare `genrou` with the emf e'' instead of w·e'', as most stability programs have it."""
    return replace(genrou(m, port, S_n, stator_flux), at_rated_speed=True)


def _synchronous(m: ModelBuilder, axis: str) -> Expr:
    return reactance(
        m, f"X_{axis}", {"d": 1.8, "q": 1.7}[axis], f"Synchronous reactance, {axis} axis"
    )


def _transient(m: ModelBuilder, axis: str) -> Expr:
    return reactance(m, f"X_{axis}1", {"d": 0.3, "q": 0.55}[axis], f"Transient reactance X'_{axis}")


def _time_1(m: ModelBuilder, axis: str) -> Expr:
    value = {"d": 8.0, "q": 0.4}[axis]
    return time(m, f"T_{axis}10", value, f"Open-circuit transient time constant T'_{axis}0")


def _one_winding(common: Common, X: Expr, X1: Expr, T_0: Expr, X_l: Expr | float = 0.0) -> AxisData:
    """Data of an axis with one winding, whose leakage reactance cannot be seen from outside."""
    k = common.scale
    return AxisData(k * X, k * X1, k * X1, Expr(k * X_l), T_0, Expr(_NO_TIME))


def _d_axis(m: ModelBuilder, common: Common) -> tuple[Expr, Expr, AxisData]:
    """X_l and X'' as they are given, and the data of the d axis on S_n."""
    X_l = reactance(m, "X_l", 0.2, "Stator leakage reactance", least=0.0)
    X, X1 = _synchronous(m, "d"), _transient(m, "d")
    X2 = reactance(m, "X_d2", 0.25, "Subtransient reactance X''_d = X''_q")
    T_10 = _time_1(m, "d")
    T_20 = time(m, "T_d20", 0.03, "Open-circuit subtransient time constant T''_d0")
    m.require(X - X_l, "machine.X_d must exceed machine.X_l")
    _require_apart(m, X_l, X1, "X_d1")
    T_20 = _of_winding(T_20, T_10, X1 - X2)
    k = common.scale
    return X_l, X2, AxisData(k * X, k * X1, k * X2, k * X_l, T_10, T_20)


def _of_winding(fast: Expr, slow: Expr, screened: Expr) -> Expr:
    """T''_0 of an axis, or, where X'' = X' says that it has no such winding, less than T'_0: it then has no effect."""
    return if_else(fabs(screened) <= 0, fmin(fast, _OF_NO_WINDING * slow), fast)


def _with_path_of_saturation(q: AxisData, saturation: Saturation) -> AxisData:
    """Return the data of the q axis with X'_q below X_q, if there is saturation.

    With X'_q = X_q the diagram's E'_d still follows the saturation of the q axis, with T'_q0; a winding that is missing
    would leave it out."""
    highest = q.X - _PATH_OF_SATURATION * (q.X - q.X_l)
    return replace(q, X1=if_else(saturation.is_given, fmin(q.X1, highest), q.X1))


def _require_apart(m: ModelBuilder, X_l: Expr, X1: Expr, name: str) -> None:
    """Refuse X_l = X', with which the field's or the slow winding's flux is the air gap's."""
    m.require(fabs(X1 - X_l) - LEAST_LEAKAGE * X1, f"machine.X_l must differ from machine.{name}")


def _require_order(m: ModelBuilder, d: AxisData, q: AxisData, lower: str) -> None:
    m.require(d.X - d.X1, "machine.X_d must exceed machine.X_d1")
    m.require(q.X - q.X_l, "machine.X_q must exceed machine.X_l")
    m.require(if_else(q.X1 <= q.X, 1, -1), f"machine.{lower} must not exceed machine.X_q")


def _saturation(m: ModelBuilder, *, both_axes: bool, exponential: bool) -> Saturation:
    s_10, s_12 = (
        m.parameter(
            name, 0.0, "1", f"Saturation S({x}) of the open-circuit curve; both 0: none", minimum=0
        )
        for name, x in (("s_10", "1.0"), ("s_12", "1.2"))
    )
    points = (1.0, s_10), (1.2, s_12)
    require_rising(m, *points, "machine.s_10, machine.s_12")
    if exponential:
        m.require(
            if_else(logic_and(s_12 > 0, s_10 <= 0), -1, 1),
            "machine.s_10 = 0: no power of the flux goes through 0 and machine.s_12; give 0 at both for none",
        )
        return Saturation(lambda x: exponential_part(x, s_10, s_12), both_axes, s_10 > 0)
    return Saturation(lambda x: saturated_part(x, *points), both_axes, s_10 > 0)
