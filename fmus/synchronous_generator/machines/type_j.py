"""GENTPJ: WECC's machine of type J, whose iron saturates all of the rotor's inductances, by the stator's current too.

Of each axis, with its factor of saturation S, in E' and ψ'' (d axis; the q axis has no field):

    T'_0·dE'/dt = E_fd − S·(E' + (E' − ψ'')·(X − X')/(X' − X''))
    T''_0·dψ''/dt = S·(E' − ψ'') − i·(X' − X'')
    ψ = ψ'' − X''_sat·i,  X''_sat = X_l + (X'' − X_l)/S

These are fluxes behind X'' of two windings, of which the fast one has no leakage: ψ'' is its flux, and the slow one's
flux and leakage are E'·(X_m + X_1)/X_m and X_1 = X_m·(X' − X'')/(X − X'), X_m = X − X''. Iron that saturates divides
all of the rotor's inductances by S, and leaves the resistances. With the flux behind the leakage reactance, ψ_l,

    S_d = 1 + s,  S_q = 1 + s·X_q/X_d,  s = S(x) of the open-circuit curve at x = |ψ_l| + K_is·|i|

The stator's flux and current depend on S, and S on them; so S follows with a short lag, ``T_saturation``.

Sources: OpenIPSL at 2be0558a (equations), InterPSS at 2b791e9 (order of the fields). K_is = 0 is GENTPF."""

from dataclasses import dataclass, field, replace

from fmus.synchronous_generator.axis import Axis, Winding
from fmus.synchronous_generator.machine import FluxDeclaration, Machine, Start, flux_state
from fmus.synchronous_generator.machines.base import declare_common, reactance, time
from fmus.synchronous_generator.saturation import require_rising, saturated_part
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME, DevicePort
from fmus.toolchain.symbols import Expr, fmax, if_else

_NO_FLUX = 1e-6  # flux [pu] below which nothing saturates
_NO_WINDING = 1e-9  # part of X that stands for X − X' = 0, an axis without a slow winding


@dataclass(frozen=True)
class SeriesAxis(Axis):
    """An axis whose fast winding has no leakage: its flux is the emf behind X''_sat.

    ``X_m`` and the windings' reactances are those without saturation, which is in ``factor``; ``X_rate``: rate of
    ``X_between`` [pu/s]."""

    factor: Expr = field(default_factory=lambda: Expr(1))
    X_rate: Expr = field(default_factory=lambda: Expr(0))

    @property
    def emf(self) -> Expr:
        """Flux behind the subtransient reactance [pu]."""
        return self.windings[1].psi

    @property
    def psi_airgap(self) -> Expr:
        """Flux of the fast winding, which all of the air gap's passes [pu]."""
        return self.emf

    def current(self, number: int) -> Expr:
        """Current of a rotor winding [pu], counted from the slowest, with what iron draws."""
        slow, fast = self.windings
        of_slow = self.factor * (slow.psi - fast.psi) / slow.X
        return of_slow if number == 0 else self.factor * fast.psi / self.X_m - of_slow + self.i

    def current_rate(self, psi_rate: Expr, rotor_rates: tuple[Expr, ...]) -> Expr:
        """di/dt from the rates of stator flux and windings' fluxes."""
        return (rotor_rates[1] - psi_rate - self.X_rate * self.i) / self.X_between

    def open_rate(self, rotor_rates: tuple[Expr, ...]) -> Expr:
        """Rate of the stator flux for which di/dt = −i/τ, as behind an open breaker."""
        return rotor_rates[1] + (self.X_between / BREAKER_TIME - self.X_rate) * self.i


@dataclass(frozen=True)
class _AxisData:
    """Reactances on S_n, and time constants [s], of an axis."""

    X: Expr
    X1: Expr
    X2: Expr
    T10: Expr
    T20: Expr


@dataclass(frozen=True)
class _Iron:
    """The open-circuit curve by two points, and how far the stator's current on S_n adds to the flux."""

    one: tuple[float, Expr]
    other: tuple[float, Expr]
    K_is: Expr

    def saturation(self, flux: Expr, current: Expr) -> Expr:
        """S at a flux and a current [pu]."""
        x = fmax(flux + self.K_is * current, _NO_FLUX)
        return saturated_part(x, self.one, self.other) / x


@dataclass(frozen=True)
class _Stator:
    """Reactances on S_n outside of the rotor, and how the flux is declared."""

    X_l: Expr
    X_t: Expr
    flux: FluxDeclaration


_DEFAULTS = {"d": (1.8, 0.3, 0.25, 8.0, 0.03), "q": (1.7, 0.55, 0.25, 0.4, 0.05)}
_FLUXES = {
    "d": (("psi_f", "Field flux"), ("psi_1d", "Damper flux, d axis")),
    "q": (("psi_1q", "First damper flux, q axis"), ("psi_2q", "Second damper flux, q axis")),
}


def gentpj(m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration) -> Machine:
    """Declare the machine."""
    common = declare_common(m, S_n)
    with m.scope("machine"):
        X_l = common.scale * reactance(m, "X_l", 0.2, "Stator leakage reactance", least=0.0)
        stator = _Stator(X_l, common.X_t, stator_flux)
        d, q = (_declared(m, axis, common.scale, X_l) for axis in _DEFAULTS)
        iron = _declared_iron(m, common.scale)
        T_S = m.parameter("T_saturation", 0.005, "s", "Lag of the saturation", minimum=1e-3)
        R = common.R_s + common.R_t
        at_leakage = (port.v_0 + Phasor(R, common.X_t + X_l) * port.i_0).magnitude()
        S_0 = m.calculated(
            "saturation_0",
            iron.saturation(at_leakage, port.i_0.magnitude()),
            "1",
            "S at the operating point",
        )
        S = m.state("saturation", S_0, "1", "S of the open-circuit curve, through a lag")
        share = q.X / d.X
        X_q = X_l + common.X_t + (q.X - X_l) / (1 + share * S_0)
        delta_0 = (port.v_0 + Phasor(R, X_q) * port.i_0).angle()
        i, v = port.i_0.rotated(-delta_0), port.v_0.rotated(-delta_0)
        i_q, i_d = Expr(i.re), Expr(-i.im)
        psi_d, psi_q = v.re + R * i_q, v.im - R * i_d
        factors = (1 + S, 1 + S_0), (1 + share * S, 1 + share * S_0)
        axis_d = _axis(m, port, d, stator, factors[0], ("d", psi_d, i_d))
        axis_q = _axis(m, port, q, stator, factors[1], ("q", psi_q, i_q))
        leaks = [axis.psi + (common.X_t + X_l) * axis.i for axis in (axis_d, axis_q)]
        flux, current = Phasor(*leaks).magnitude(), Phasor(axis_d.i, axis_q.i).magnitude()
        rate = (iron.saturation(flux, current) - S) / T_S
        m.derivative(S, rate)
        axis_d = _with_rate(axis_d, d.X2 - X_l, rate)
        axis_q = _with_rate(axis_q, q.X2 - X_l, share * rate)
        E_fd = factors[0][1] * (psi_d + _between(d, stator, factors[0][1]) * i_d)
        E_fd += (d.X - d.X2) * i_d
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
        X_port=_between(d, stator, 1 + S_0),
    )


def _declared(m: ModelBuilder, axis: str, scale: Expr, X_l: Expr) -> _AxisData:
    X, X1, X2, T10, T20 = _DEFAULTS[axis]
    found = _AxisData(
        scale * reactance(m, f"X_{axis}", X, f"Synchronous reactance, {axis} axis"),
        scale * reactance(m, f"X_{axis}1", X1, f"Transient reactance X'_{axis}"),
        scale * reactance(m, f"X_{axis}2", X2, f"Subtransient reactance X''_{axis}"),
        time(m, f"T_{axis}10", T10, f"Open-circuit transient time constant T'_{axis}0"),
        time(m, f"T_{axis}20", T20, f"Open-circuit subtransient time constant T''_{axis}0"),
    )
    slow = found.X - found.X1
    if axis == "d":  # without a field winding nothing could excite the machine
        m.require(slow, "machine.X_d must exceed machine.X_d1")
    else:
        m.require(if_else(slow >= 0, 1, -1), "machine.X_q1 must not exceed machine.X_q")
    m.require(found.X1 - found.X2, f"machine.X_{axis}1 must exceed machine.X_{axis}2")
    least = if_else(X_l <= found.X2, 1, -1)
    m.require(least, f"machine.X_l must not exceed machine.X_{axis}2")
    return found


def _declared_iron(m: ModelBuilder, scale: Expr) -> _Iron:
    s_10, s_12 = (
        m.parameter(
            name, 0.0, "1", f"Saturation S({x}) of the open-circuit curve; both 0: none", minimum=0
        )
        for name, x in (("s_10", "1.0"), ("s_12", "1.2"))
    )
    one, other = (1.0, s_10), (1.2, s_12)
    require_rising(m, one, other, "machine.s_10, machine.s_12")
    K_is = m.parameter(
        "K_is", 0.0, "1", "Flux that a stator current of 1 adds in the curve; 0: GENTPF", minimum=0
    )
    return _Iron(one, other, scale * K_is)


def _between(data: _AxisData, stator: _Stator, factor: Expr) -> Expr:
    """Reactance between emf and bus at a factor of saturation [pu]."""
    return stator.X_t + stator.X_l + (data.X2 - stator.X_l) / factor


def _axis(
    m: ModelBuilder,
    port: DevicePort,
    data: _AxisData,
    stator: _Stator,
    factor: tuple[Expr, Expr],
    at_start: tuple[str, Expr, Expr],
) -> SeriesAxis:
    """Declare the fluxes of an axis.

    ``factor``: of saturation, now and at the start; ``at_start``: name of the axis, stator flux and current."""
    name, psi, i = at_start
    now, start = factor
    slowness = fmax(data.X - data.X1, _NO_WINDING * data.X)
    X_m = m.calculated(
        f"X_m{name}",
        data.X - data.X2,
        "pu",
        f"Magnetising reactance beyond X'', {name} axis",
        "S_n",
    )
    screened = data.X1 - data.X2
    X = (X_m * screened / slowness, Expr(0))
    R = (X_m**2 / slowness / (port.omega_b * data.T10), screened / (port.omega_b * data.T20))
    emf = psi + _between(data, stator, start) * i
    fluxes = ((emf + screened * i / start) * X_m / slowness, emf)
    if name == "q":  # its slow winding has no current in steady state
        fluxes = (emf, emf)
    flux = stator.flux(m, f"psi_{name}", psi, f"Flux of stator and transformer, {name} axis")
    windings = tuple(
        Winding(X_k, R_k, flux_state(m, label, value, text))
        for X_k, R_k, value, (label, text) in zip(X, R, fluxes, _FLUXES[name], strict=True)
    )
    between = _between(data, stator, now)
    return SeriesAxis(X_m, windings, flux, Expr(0), between, factor=now)


def _with_rate(axis: SeriesAxis, saturable: Expr, rate: Expr) -> SeriesAxis:
    """The axis with the rate at which its reactance to the bus changes with that of the factor [1/s]."""
    return replace(axis, X_rate=-saturable * rate / axis.factor**2)
