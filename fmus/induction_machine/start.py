"""The slip at which an induction machine draws its power of the power flow.

P(s) rises from no load to the pull-out point, and its slope falls there: Newton's method from s = 0 comes to the
solution from one side, and does not pass it."""

from dataclasses import dataclass

from fmus.induction_machine.circuit import Circuit
from fmus.toolchain.blocks import limit
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, fabs

ITERATIONS = 16  # near the pull-out point each halves the distance; elsewhere it squares the error
MOST_SLIP = (
    1.0  # standstill: where there is no solution, the slip stays finite and the refusal tells why
)
ACCURACY = 1e-6  # error of the power [pu, S_n] that is rounding of a file


@dataclass(frozen=True)
class Start:
    """The machine's own operating point: slip, current into the stator, e'', fluxes of the cages [pu, S_n].

    ``shunt``: susceptance beside the machine, which generates what the power flow's Q has more than the machine's."""

    slip: Expr
    stator: Phasor
    emf: Phasor
    fluxes: tuple[Phasor, Phasor]
    torque: Expr
    shunt: Expr


def find_start(m: ModelBuilder, circuit: Circuit, port: DevicePort) -> Start:
    """Find the operating point from P_0 and Q_0 at v_0, which is refused beyond the pull-out point."""
    s_0 = power(port.v_0, port.i_0)
    square = Expr(port.v_0.re) ** 2 + Expr(port.v_0.im) ** 2
    drawn = -Expr(s_0.re)
    slip = Expr(0.0)
    for _ in range(ITERATIONS):
        found, slope = _active(circuit, slip, square)
        slip = limit(slip - (found - drawn) / slope, MOST_SLIP)
    slip = m.calculated("slip_0", slip, "pu", "Slip at the operating point", base="f_n")
    found, slope = _active(circuit, slip, square)
    m.require(
        ACCURACY - fabs(found - drawn),
        "the machine cannot take or give P_0 at v_0: that lies beyond its pull-out point; lower |P_0|, or raise S_n "
        "(MBASE, PMULT) or v_0",
    )
    m.require(
        slope, "P_0 lies beyond the pull-out point, where the machine cannot stay: lower |P_0|"
    )
    Z, _ = circuit.impedance(slip)
    stator = port.v_0 / Z
    reactive = power(port.v_0, stator).im
    shunt = m.calculated(
        "B_shunt",
        (reactive + s_0.im) / square,
        "pu",
        "Susceptance beside the machine, for the power flow's reactive power; above 0 capacitive",
        base="S_n",
    )
    emf = port.v_0 - circuit.subtransient * stator
    fluxes = _fluxes(circuit, slip, stator)
    return Start(slip, stator, emf, fluxes, Expr(power(emf, stator).re), shunt)


def _active(circuit: Circuit, slip: Expr, square: Expr) -> tuple[Expr, Expr]:
    """Active power that the machine draws at a slip and a voltage's square, and its slope by the slip [pu]."""
    Z, rate = circuit.impedance(slip)
    Y = Phasor(1.0, 0.0) / Z
    return Expr(Y.re) * square, -Expr((rate * Y * Y).re) * square


def _fluxes(circuit: Circuit, slip: Expr, stator: Phasor) -> tuple[Phasor, Phasor]:
    """Fluxes at which j·s·ψ_k = R_k·i_k, with ψ = X_M·i_s − L·i: (R·L⁻¹ + j·s)·ψ = R·L⁻¹·X_M·i_s."""
    (first, between, second), (R_1, R_2) = circuit.cages.own, circuit.cages.resistances
    turning = Phasor(0.0, slip)
    a, b = Phasor(R_1 * first, 0.0) + turning, R_1 * between
    c, d = R_2 * between, Phasor(R_2 * second, 0.0) + turning
    main = stator * circuit.magnetising
    u_1, u_2 = main * (R_1 * circuit.cages.sums[0]), main * (R_2 * circuit.cages.sums[1])
    # without a second cage ψ_2 is 0, and d is replaced, which may be 0
    d = Phasor(d.re + 1 - circuit.cages.has_second, d.im)
    determinant = a * d - Phasor(b * c, 0.0)
    return (u_1 * d - u_2 * b) / determinant, (u_2 * a - u_1 * c) / determinant
