"""Machines GENROU, GENSAL and two-axis, each from the standard data of its data sheet.

    two_axis  4th order: field, one winding on the q axis          X_d, X'_d, T'_d0; X_q, X'_q, T'_q0
    gensal    5th order: field and damper, one damper on the q axis  X_d, X'_d, X'', T'_d0, T''_d0; X_q, T''_q0
    genrou    6th order: field and damper, two windings on the q axis
    genrou_rated_speed  the same with the emf at rated speed, for phasors alone: RMS simulation of stability programs

Their stator is that of `machine`: with stator transients EMT-type, algebraic in the phasor model. As in stability
programs' models of these names X''_q = X''_d, and saturation is that of `windings`. X'_q = X_q (genrou, two_axis) says
that the slow winding of the q axis is missing."""

from dataclasses import replace

from fmus.synchronous_generator.conversion import AxisData
from fmus.synchronous_generator.declarations import require_rising, saturated_part
from fmus.synchronous_generator.machine import FluxDeclaration, Machine
from fmus.synchronous_generator.machines.base import Common, declare_common, reactance, time
from fmus.synchronous_generator.machines.windings import Saturation, WoundAxis, declare_wound_machine
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, if_else

_FIELD = ("psi_f", "Field flux")
_DAMPER = ("psi_1d", "Damper flux, d axis")
_FIRST_Q = ("psi_1q", "First damper flux, q axis")
_SECOND_Q = ("psi_2q", "Second damper flux, q axis")

_NO_TIME = 1e-3
"""Stands for the time constant [s] of a fast winding that a machine does not have."""


def two_axis(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare the machine of fourth order (Sauer and Pai). It has no saturation."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        d, q = (
            WoundAxis(_one_winding(common, _synchronous(m, axis), _transient(m, axis), _time_1(m, axis)), (winding,))
            for axis, winding in (("d", _FIELD), ("q", _FIRST_Q))
        )
        _require_order(m, d.data, q.data, "X_q1")
    return declare_wound_machine(m, port, common, d, q, stator_flux, salient=True)


def gensal(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare the machine of fifth order, one with salient poles. E'_q saturates the d axis."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        X_l, X_2, d = _d_axis(m, common)
        X_q = _synchronous(m, "q")
        fast = time(m, "T_q20", 0.05, "Open-circuit subtransient time constant T''_q0")
        q = _one_winding(common, X_q, X_2, fast, X_l)
        _require_order(m, d, q, "X_d2")
        saturation = _saturation(m, both_axes=False)
    return declare_wound_machine(
        m, port, common, WoundAxis(d, (_FIELD, _DAMPER)), WoundAxis(q, (_FIRST_Q,)), stator_flux, saturation
    )


def genrou(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare the machine of sixth order, one with a round rotor. Its subtransient flux saturates both axes.

    ``port``: gives the operating point; ``S_n``: rating [MVA]; ``stator_flux``: declares the stator's fluxes: as
    states, or as signals that a model without stator transients closes."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        X_l, X_2, d = _d_axis(m, common)
        X_q, X_q1, T_q10 = _synchronous(m, "q"), _transient(m, "q"), _time_1(m, "q")
        T_q20 = time(m, "T_q20", 0.05, "Open-circuit subtransient time constant T''_q0")
        k = common.scale
        q = AxisData(k * X_q, k * X_q1, k * X_2, k * X_l, T_q10, T_q20)
        _require_order(m, d, q, "X_q1")
        m.require(if_else(q.X2 <= q.X1, 1, -1), "machine.X_d2, which is X''_q too, must not exceed machine.X_q1")
        m.require(T_q10 - T_q20, "machine.T_q10 must exceed machine.T_q20")
        saturation = _saturation(m, both_axes=True)
    return declare_wound_machine(
        m, port, common, WoundAxis(d, (_FIELD, _DAMPER)), WoundAxis(q, (_FIRST_Q, _SECOND_Q)), stator_flux, saturation
    )


def genrou_rated_speed(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare `genrou` with the emf e'' instead of w·e'', as most stability programs have it."""
    return replace(genrou(m, port, S_n, stator_flux), at_rated_speed=True)


def _synchronous(m: ModelBuilder, axis: str) -> Expr:
    return reactance(m, f"X_{axis}", {"d": 1.8, "q": 1.7}[axis], f"Synchronous reactance, {axis} axis")


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
    X_l = reactance(m, "X_l", 0.2, "Stator leakage reactance")
    X, X1 = _synchronous(m, "d"), _transient(m, "d")
    X2 = reactance(m, "X_d2", 0.25, "Subtransient reactance X''_d = X''_q")
    T_10 = _time_1(m, "d")
    T_20 = time(m, "T_d20", 0.03, "Open-circuit subtransient time constant T''_d0")
    m.require(if_else(X2 <= X1, 1, -1), "machine.X_d2 must not exceed machine.X_d1")
    m.require(X2 - X_l, "machine.X_d2 must exceed machine.X_l")
    m.require(T_10 - T_20, "machine.T_d10 must exceed machine.T_d20")
    k = common.scale
    return X_l, X2, AxisData(k * X, k * X1, k * X2, k * X_l, T_10, T_20)


def _require_order(m: ModelBuilder, d: AxisData, q: AxisData, lower: str) -> None:
    m.require(d.X - d.X1, "machine.X_d must exceed machine.X_d1")
    m.require(if_else(q.X1 <= q.X, 1, -1), f"machine.{lower} must not exceed machine.X_q")


def _saturation(m: ModelBuilder, *, both_axes: bool) -> Saturation:
    s_10, s_12 = (
        m.parameter(name, 0.0, "1", f"Saturation S({x}) of the open-circuit curve; both 0: none", minimum=0)
        for name, x in (("s_10", "1.0"), ("s_12", "1.2"))
    )
    points = (1.0, s_10), (1.2, s_12)
    require_rising(m, *points, "machine.s_10, machine.s_12")
    return Saturation(lambda x: saturated_part(x, *points), both_axes)
