"""The four-VSC benchmark from its published data and equations, with NumPy and SciPy alone.

Nothing of the project is used. All converters follow. The power flow is solved, every state follows from it, and the
eigenvalues are those of the equations' Jacobian by central differences. Quantities are per unit: the network's on 100
MVA, a converter's on its rating; d lies along the voltage, q ahead of it.

Data: COLIB, page 4VSCSystem with lf_2.dat and dyn_det_2.dat (2023), and the report of CRESYM's project BiGER (2025).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq, fsolve

W = 100 * np.pi
"""Base angular frequency [rad/s]."""
BUSES = ("A", "A2", "B", "B2", "C", "E", "F")
C = BUSES.index("C")
Z_400, Z_225 = 1600.0, 506.25
"""Base impedances [Ω]."""
LOAD, REACTORS = 11.687 - 1.776j, {"E": 3.0, "F": 2.0}
"""Admittance of the load at bus C and of the reactors [pu]."""


@dataclass(frozen=True)
class Converter:
    """One converter; P [MW], and V [pu] or Q [Mvar] of its bus in the power flow.

    ``pll_integral`` multiplies the PLL's integral gain of 25/T².
    """

    bus: str
    S: float
    P: float
    L: float
    ratio: float
    K_pc: float
    V: float | None = None
    Q: float | None = None
    by_voltage: bool = True
    K_pv: float = 0.1667
    K_iv: float = 50.0
    R: float = 0.005
    K_ic: float = 6.0
    T: float = 0.0033
    K_pp: float = 0.0333
    K_ip: float = 10.0
    T_pll: float = 0.1
    pll_integral: float = 1.0


WP1 = Converter(
    "E", 2400.0, 1991.9, 0.12, 1.04, 0.4584, Q=-146.6, by_voltage=False, K_pv=0.0333, K_iv=10.0
)
WP2 = Converter("F", 2400.0, 1991.7, 0.12, 1.0, 0.4584, V=0.9997311)
HVDC1 = Converter("A", 1200.0, -1125.2, 0.15, 1.0, 0.5730, V=1.0075727)
HVDC2 = Converter("B", 1700.0, -1607.5, 0.15, 0.99, 0.5730, V=1.0054174)


@dataclass(frozen=True)
class FourVsc:
    """The system, with what can be changed about it.

    Attributes
    ----------
    S_sc
        Short-circuit power of the equivalent [MVA].
    dynamic
        Whether the network has its own differential equations (EMT), or is one of admittances (phasors).
    circuits_AB, circuits_AC, circuits_BC
        That are closed; the power flow is that of two each.
    load
        ``"parallel"``: conductance beside an inductor; ``"series"``; ``"none"``: the equivalent takes its power.
    load_share
        Of the load; the equivalent takes the rest.
    fed_forward, actuated
        Lags of the voltage that is fed forward, and of the converter's voltage [s]; 0 in the benchmark's equations.
    delay
        Of the converter's voltage [s], by Padé's fraction of first order.
    charging, cables
        Factors of the charging of all lines and cables, and of the cables alone.
    capacitors
        Whether the reactors at E and F are entered as capacitors.
    """

    S_sc: float = 20000.0
    dynamic: bool = True
    converters: tuple[Converter, ...] = (WP1, WP2, HVDC1, HVDC2)
    tap_B: float = 1.05
    circuits_AB: int = 2
    circuits_AC: int = 2
    circuits_BC: int = 2
    R_X: float = 0.0
    load: str = "parallel"
    load_share: float = 1.0
    fed_forward: float = 0.0
    actuated: float = 0.0
    delay: float = 0.0
    charging: float = 1.0
    cables: float = 1.0
    capacitors: bool = False
    branches: tuple = field(init=False)

    def __post_init__(self):
        rows = [("A", "B", 0.51, 10.24, 48e-6)] * self.circuits_AB
        rows += [("A", "C", 1.04, 20.80, 98e-6)] * self.circuits_AC
        rows += [("B", "C", 1.12, 22.40, 105e-6)] * self.circuits_BC
        found = [
            (a, b, R / Z_400, X / Z_400, self.charging * Y * Z_400, 1.0) for a, b, R, X, Y in rows
        ]
        B = self.charging * self.cables * 9e-3 * Z_225
        found += [(a, b, 0.42 / Z_225, 0.83 / Z_225, B, 1.0) for a, b in (("A2", "E"), ("B2", "F"))]
        found += [
            ("A2", "A", 0.005 / 24, 0.15 / 24, 0.0, 1.0),
            ("B2", "B", 0.005 / 24, 0.15 / 24, 0.0, self.tap_B),
        ]
        at = BUSES.index
        object.__setattr__(self, "branches", tuple((at(a), at(b), *rest) for a, b, *rest in found))

    @property
    def admittance(self):
        """Of the load [pu]."""
        return 0.0 if self.load == "none" else self.load_share * LOAD

    @property
    def Z_eq(self):
        """Impedance of the equivalent [pu]."""
        return 100 / self.S_sc * (self.R_X + 1j) / np.hypot(1, self.R_X)

    def admittances(self, with_load):
        Y = np.zeros((7, 7), complex)
        for i, j, R, X, B, n in self.branches:
            y = 1 / (R + 1j * X)
            Y[i, i] += y + 1j * B
            Y[j, j] += y / n**2 + 1j * B
            Y[i, j] -= y / n
            Y[j, i] -= y / n
        for bus, b in REACTORS.items():
            Y[BUSES.index(bus), BUSES.index(bus)] -= 1j * (-b if self.capacitors else b)
        if with_load:
            Y[C, C] += self.admittance
        return Y

    def power_flow(self):
        """Voltages, and powers into the network [pu]; the benchmark's flow has both circuits."""
        Y = replace(self, circuits_AB=2, circuits_AC=2, circuits_BC=2).admittances(with_load=False)
        free = [k for k in range(7) if k != C]
        by_bus = {BUSES.index(u.bus): u for u in self.converters}

        def voltages(x):
            v = np.ones(7, complex)
            v[free] = x[6:] * np.exp(1j * x[:6])
            return v

        def missing(x):
            v = voltages(x)
            s, found = v * np.conj(Y @ v), []
            for k in free:
                u = by_bus.get(k)
                found.append(s[k].real - (u.P / 100 if u else 0.0))
                held = u is not None and u.V is not None
                found.append(abs(v[k]) - u.V if held else s[k].imag - (u.Q / 100 if u else 0.0))
            return found

        v = voltages(fsolve(missing, np.r_[np.zeros(6), np.ones(6)], xtol=1e-13))
        return v, v * np.conj(Y @ v)

    def start(self):
        """Converters with their references, the equivalent's voltage, and all states."""
        v, s = self.power_flow()
        units, x = [], []
        for u in self.converters:
            k = BUSES.index(u.bus)
            i = np.conj(s[k] / v[k]) * 100 / u.S * u.ratio
            d, V = i * np.exp(-1j * np.angle(v[k])), abs(v[k]) / u.ratio
            P, Q = s[k].real * 100 / u.S, s[k].imag * 100 / u.S
            inside = V + (u.R + 1j * u.L) * d
            controlled = abs(inside) if u.by_voltage else Q
            units.append((u, k, P, controlled))
            x += [
                d.real,
                d.imag,
                np.angle(v[k]),
                0.0,
                u.R * d.real,
                u.R * d.imag,
                P,
                d.real,
                controlled,
                d.imag,
            ]
            x += [V, inside.real, inside.imag]
        into = np.conj(s[C] / v[C]) + self.admittance * v[C]
        E = v[C] + self.Z_eq * into
        if self.dynamic:
            z = [*v, *((v[i] - v[j] / n) / (R + 1j * X) for i, j, R, X, _, n in self.branches)]
            z += [*(v[i] / (R + 1j * X) for i, R, X in self._coils()), into]
            x += list(np.column_stack([np.real(z), np.imag(z)]).ravel())
        return units, E, np.array(x)

    def _coils(self):
        """Inductors to earth: bus, resistance and reactance [pu]."""
        found = (
            []
            if self.capacitors
            else [(BUSES.index(bus), 0.0, 1 / b) for bus, b in REACTORS.items()]
        )
        if self.load == "parallel":
            found.append((C, 0.0, -1 / self.admittance.imag))
        if self.load == "series":
            found.append((C, (1 / self.admittance).real, (1 / self.admittance).imag))
        return found

    def rates(self):
        """The function of all states that gives their rates, and the operating point.

        States may be a matrix with a column for each of several places."""
        units, E, x_0 = self.start()
        coils, size = self._coils(), 13
        B = np.zeros(7)
        for i, j, _, _, b, _ in self.branches:
            B[i] += b
            B[j] += b
        for bus, b in REACTORS.items() if self.capacitors else ():
            B[BUSES.index(bus)] += b
        Y = self.admittances(with_load=True)
        Y[C, C] += 1 / self.Z_eq
        impedances = np.linalg.inv(Y)

        def injected(x):
            I = np.zeros((7, *x.shape[1:]), complex)  # noqa: E741
            for a, (u, k, _, _) in enumerate(units):
                d, q, theta = x[size * a : size * a + 3]
                I[k] += (d + 1j * q) * np.exp(1j * theta) * u.S / 100 / u.ratio
            return I

        def network(x, I):  # noqa: E741
            z = x[size * len(units) :: 2] + 1j * x[size * len(units) + 1 :: 2]
            v, lines, rest = np.split(z, [7, 7 + len(self.branches)])
            through = 1j * B
            if self.load == "parallel":
                through[C] += self.admittance.real
            I = I - (through * v.T).T  # noqa: E741
            rates = []
            for (i, j, R, X, _, n), now in zip(self.branches, lines, strict=True):
                I[i] -= now
                I[j] += now / n
                rates.append(W / X * (v[i] - v[j] / n - (R + 1j * X) * now))
            for (i, R, X), now in zip(coils, rest[:-1], strict=True):
                I[i] -= now
                rates.append(W / X * (v[i] - (R + 1j * X) * now))
            I[C] += rest[-1]
            rates.append(W / self.Z_eq.imag * (E - v[C] - self.Z_eq * rest[-1]))
            found = np.concatenate([(W / B * I.T).T, rates])
            return v, np.stack([found.real, found.imag], axis=1).reshape(-1, *x.shape[1:])

        def f(x):
            I = injected(x)  # noqa: E741
            if self.dynamic:
                v, rest = network(x, I)
            else:
                I[C] += E / self.Z_eq
                v, rest = impedances @ I, np.empty((0, *x.shape[1:]))
            own = [
                self._converter(u, P, held, x[size * a : size * (a + 1)], v[k])
                for a, (u, k, P, held) in enumerate(units)
            ]
            return np.concatenate([*own, rest])

        return f, x_0

    def _converter(self, u, P_ref, held, x, v):
        """Rates of one converter's states at a bus voltage [pu]."""
        d, q, theta, x_pll, M_d, M_q, P_f, x_P, X_f, x_Q, seen, out_d, out_q = x
        bus = v * np.exp(-1j * theta)
        e, i = bus / u.ratio, d + 1j * q
        w = 1 + x_pll + 10 / (W * u.T_pll) * bus.imag
        s = e * np.conj(i)
        error = P_ref - P_f
        deviation = X_f - held
        e_d, e_q = u.K_pp * error + x_P - d, u.K_pv * deviation + x_Q - q
        fed = seen if self.fed_forward else e.real
        m_d, m_q = fed - w * u.L * q + u.K_pc * e_d + M_d, w * u.L * d + u.K_pc * e_q + M_q
        v_d, v_q = (
            (out_d, out_q)
            if self.actuated
            else (2 * out_d - m_d, 2 * out_q - m_q)
            if self.delay
            else (m_d, m_q)
        )
        lag = self.actuated or self.delay / 2 or 1e-3
        controlled = abs(e + (u.R + 1j * u.L) * i) if u.by_voltage else s.imag
        return [
            W / u.L * (v_d - e.real - u.R * d + w * u.L * q),
            W / u.L * (v_q - e.imag - u.R * q - w * u.L * d),
            W * (w - 1),
            u.pll_integral * 25 / (W * u.T_pll**2) * bus.imag,
            u.K_ic * e_d,
            u.K_ic * e_q,
            (s.real - P_f) / u.T,
            u.K_ip * error,
            (controlled - X_f) / u.T,
            u.K_iv * deviation,
            (e.real - seen) / (self.fed_forward or 1e-3),
            (m_d - out_d) / lag,
            (m_q - out_q) / lag,
        ]

    def eigenvalues(self):
        """Of the steady state that these controls find [1/s]."""
        f, x = self.rates()
        for _ in range(12):
            change = np.linalg.lstsq(_jacobian(f, x), -f(x), rcond=1e-12)[0]
            x = x + change
            if np.abs(change).max() < 1e-10:
                break
        return np.linalg.eigvals(_jacobian(f, x))

    def oscillation(self):
        """The least stable eigenvalue from 6 to 40 Hz; None where there is none."""
        found = self.eigenvalues()
        found = found[(found.imag > 12 * np.pi) & (found.imag < 80 * np.pi)]
        return found[np.argmax(found.real)] if len(found) else None

    def critical(self):
        """The least stable eigenvalue but the direct components of loops of inductors, at ±j·ω_b."""
        found = self.eigenvalues()
        found = found[(found.imag >= 0) & (np.abs(found - 1j * W) > 0.1)]
        return found[np.argmax(found.real)]


def _jacobian(f, x, step=1e-6):
    steps = step * np.eye(len(x))
    return (f(x[:, None] + steps) - f(x[:, None] - steps)) / (2 * step)


def with_all(system, **changes):
    """The same with changes to every converter."""
    return replace(system, converters=tuple(replace(u, **changes) for u in system.converters))


def report(**changes):
    """The data of 2025: no ratios, and wind park 1 holds its voltage with the gains of the others."""
    first = replace(WP1, by_voltage=True, K_pv=0.1667, K_iv=50.0, ratio=1.0)
    return FourVsc(converters=(first, WP2, HVDC1, replace(HVDC2, ratio=1.0)), tap_B=1.0, **changes)


def emtp(K_pv=0.1667, K_iv=50.0, **changes):
    """The data of 2025 with wind park 1 at the voltage of BiGER's listing."""
    system = report(**changes)
    first = replace(system.converters[0], V=1.047555, Q=None, K_pv=K_pv, K_iv=K_iv)
    return replace(system, converters=(first, *system.converters[1:]))


def limit(system, low, high):
    """Short-circuit power [MVA] between the two at which the system becomes unstable, and the frequency [Hz]."""
    found = brentq(lambda S: replace(system, S_sc=S).critical().real, low, high, rtol=1e-4)
    return found, replace(system, S_sc=found).critical().imag / 2 / np.pi
