"""Several machines on a network of phasors: modes of published examples, with their books' assumptions.

Stator and network are algebraic. Machines are those of stability programs: of sixth order (GENROU, saturation through
two points) or, where X''_d is not given, of fourth. Loads follow their voltage with any exponent. Everything is per
unit on 100 MVA; a machine's data are on its own ``base``. Every value with a name from a book has the book's name.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import root

BASE = 100.0


@dataclass(frozen=True)
class Branch:
    """Line or transformer [pu on 100 MVA]; B of the whole line."""

    a: int
    b: int
    R: float
    X: float
    B: float = 0.0


@dataclass(frozen=True)
class Load:
    """P + jQ [pu on 100 MVA], in proportion to |v|^a and |v|^b; 0: constant power, 1: current, 2: impedance."""

    bus: int
    P: float
    Q: float
    a: float = 2.0
    b: float = 2.0


@dataclass(frozen=True)
class Machine:
    """Data on ``base`` [MVA], times in s. ``E_fd`` has a regulator or is constant, see `System`."""

    bus: int
    base: float
    P: float
    V: float
    H: float
    X_d: float
    X_q: float
    X_d1: float
    X_q1: float
    T_d10: float
    T_q10: float
    R_a: float = 0.0
    X_d2: float | None = None
    X_l: float = 0.0
    T_d20: float = 1.0
    T_q20: float = 1.0
    S_10: float = 0.0
    S_12: float = 0.0
    D: float = 0.0


@dataclass(frozen=True)
class Thyristor:
    """Measurement, K_A·(1+sT_A)/(1+sT_B) with the book's T_A; and a stabiliser if K_STAB > 0."""

    K_A: float = 200.0
    T_R: float = 0.01
    T_A: float = 1.0
    T_B: float = 1.0
    K_STAB: float = 0.0
    T_W: float = 10.0
    leads: tuple[tuple[float, float], ...] = ((0.05, 0.02), (3.0, 5.4))


@dataclass(frozen=True)
class Commutator:
    """IEEE type 1; ``saturation`` gives S_E(E)."""

    saturation: Callable[[float], float]
    K_A: float = 20.0
    T_A: float = 0.2
    K_E: float = 1.0
    T_E: float = 0.314
    K_F: float = 0.063
    T_F: float = 0.35
    T_R: float = 0.0


@dataclass(frozen=True)
class System:
    """A network with machines.

    ``constant_torque``: else the mechanical power is constant. ``emf_with_speed``: the emf is in proportion to speed,
    as in our phasor models; books and stability programs leave it out. ``unit``: the equations of a machine, by
    default `Unit`.
    """

    buses: int
    branches: tuple[Branch, ...]
    shunts: dict[int, float]
    loads: tuple[Load, ...]
    machines: tuple[Machine, ...]
    slack: int
    exciter: Thyristor | Commutator | None = None
    frequency: float = 60.0
    constant_torque: bool = True
    emf_with_speed: bool = False
    unit: Callable[["System", Machine], "Unit"] = field(default_factory=lambda: Unit, compare=False)

    # -- network ---------------------------------------------------------------------------------------

    def admittance(self) -> np.ndarray:
        Y = np.zeros((self.buses + 1, self.buses + 1), complex)  # bus 0 is none
        for line in self.branches:
            y, c = 1 / complex(line.R, line.X), 0.5j * line.B
            a, b = line.a, line.b
            Y[a, a] += y + c
            Y[b, b] += y + c
            Y[a, b] -= y
            Y[b, a] -= y
        for bus, B in self.shunts.items():
            Y[bus, bus] += 1j * B
        return Y[1:, 1:]

    def power_flow(self) -> np.ndarray:
        """Complex voltages; the machines hold theirs, the slack's angle is 0."""
        Y = self.admittance()
        held = {m.bus - 1: m.V for m in self.machines}
        slack = self.slack - 1
        wanted = np.zeros(self.buses, complex)
        for load in self.loads:
            wanted[load.bus - 1] -= complex(load.P, load.Q)
        for m in self.machines:
            wanted[m.bus - 1] += m.P
        turned = [k for k in range(self.buses) if k != slack]
        free = [k for k in range(self.buses) if k not in held]

        def voltages(x: np.ndarray) -> np.ndarray:
            size, angle = np.ones(self.buses), np.zeros(self.buses)
            for k, value in held.items():
                size[k] = value
            angle[turned], size[free] = x[: len(turned)], x[len(turned) :]
            return size * np.exp(1j * angle)

        def mismatch(x: np.ndarray) -> np.ndarray:
            v = voltages(x)
            s = v * np.conj(Y @ v) - wanted
            return np.concatenate([s.real[turned], s.imag[free]])

        found = root(
            mismatch, np.concatenate([np.zeros(len(turned)), np.ones(len(free))]), tol=1e-13
        )
        assert np.abs(mismatch(found.x)).max() < 1e-9, found.message
        return voltages(found.x)

    # -- modes -----------------------------------------------------------------------------------------

    def eigenvalues(self) -> np.ndarray:
        """Of the equations linearised around the power flow, by central differences."""
        v = self.power_flow()
        motion = _Motion(self, v)
        assert np.abs(motion(motion.start)).max() < 1e-8
        n, h = len(motion.start), 1e-6
        A = np.empty((n, n))
        for k in range(n):
            step = np.zeros(n)
            step[k] = h
            A[:, k] = (motion(motion.start + step) - motion(motion.start - step)) / (2 * h)
        return np.linalg.eigvals(A)

    def swings(self, low: float = 0.3, high: float = 2.5, most: float = 0.4) -> list[complex]:
        """Modes between two frequencies [Hz] below a damping ratio, slowest first [rad/s]."""
        found = [
            z
            for z in self.eigenvalues()
            if low < z.imag / (2 * np.pi) < high and -z.real < most * abs(z)
        ]
        return sorted(found, key=lambda z: z.imag)


def hertz_and_percent(z: complex) -> tuple[float, float]:
    """Frequency and damping of an eigenvalue [rad/s]."""
    return z.imag / (2 * np.pi), -100 * z.real / abs(z)


class _Motion:
    """The rates of all states, in the order δ, w, E'_q, E'_d, ψ_1d, ψ_2q and the exciter's, machine by machine."""

    def __init__(self, system: System, v: np.ndarray) -> None:
        self.system, self.v_0 = system, v
        self.units = [system.unit(system, m) for m in system.machines]
        self.Y = system.admittance()
        i = self.Y @ v + self._load_currents(v)
        parts = [u.begin(v[u.m.bus - 1], i[u.m.bus - 1]) for u in self.units]
        self.sizes = np.cumsum([len(p) for p in parts])[:-1]
        self.start = np.concatenate(parts)

    def _load_currents(self, v: np.ndarray) -> np.ndarray:
        i = np.zeros(len(v), complex)
        for load in self.system.loads:
            k = load.bus - 1
            x = abs(v[k]) / abs(self.v_0[k])
            i[k] += np.conj(complex(load.P * x**load.a, load.Q * x**load.b) / v[k])
        return i

    def __call__(self, x: np.ndarray) -> np.ndarray:
        states = np.split(x, self.sizes)

        def balance(v: np.ndarray) -> np.ndarray:
            i = self.Y @ v + self._load_currents(v)
            for unit, own in zip(self.units, states, strict=True):
                i[unit.m.bus - 1] -= unit.current(own, v[unit.m.bus - 1])[0]
            return i

        v = _newton(balance, self.v_0)
        return np.concatenate(
            [
                unit.rates(own, v[unit.m.bus - 1])
                for unit, own in zip(self.units, states, strict=True)
            ]
        )


def _newton(balance: Callable[[np.ndarray], np.ndarray], v: np.ndarray) -> np.ndarray:
    """Complex v for which the balance is 0; its Jacobian is that of the beginning, by differences."""
    n, h = len(v), 1e-7
    J = np.empty((2 * n, 2 * n))
    for k in range(2 * n):
        step = np.zeros(n, complex)
        step[k % n] = h if k < n else 1j * h
        d = (balance(v + step) - balance(v - step)) / (2 * h)
        J[:, k] = np.concatenate([d.real, d.imag])
    inverse = np.linalg.inv(J)
    for _ in range(30):
        r = balance(v)
        if np.abs(r).max() < 1e-13:
            break
        dv = inverse @ np.concatenate([r.real, r.imag])
        v = v - (dv[:n] + 1j * dv[n:])
    return v


class Unit:
    """One machine with its exciter, per unit on the machine's base; currents at the bus on 100 MVA."""

    def __init__(self, system: System, m: Machine) -> None:
        self.system, self.m, self.x = system, m, system.exciter
        self.scale = m.base / BASE
        self.sixth = m.X_d2 is not None
        self.X_d2 = m.X_d1 if m.X_d2 is None else m.X_d2
        self.X_q2 = m.X_q1 if m.X_d2 is None else m.X_d2
        ratio = np.sqrt(m.S_10 / (1.2 * m.S_12)) if m.S_12 else 0.0
        self.A = (1 - 1.2 * ratio) / (1 - ratio)
        self.B = 1.2 * m.S_12 / (1.2 - self.A) ** 2

    def saturation(self, psi: float) -> float:
        """S of the subtransient flux."""
        return self.B * max(psi - self.A, 0) ** 2 / psi

    def emf(self, s: np.ndarray) -> tuple[float, float]:
        """e''_q and e''_d."""
        m = self.m
        if not self.sixth:
            return s[2], s[3]
        d, q = (self.X_d2 - m.X_l) / (m.X_d1 - m.X_l), (self.X_q2 - m.X_l) / (m.X_q1 - m.X_l)
        return d * s[2] + (1 - d) * s[4], q * s[3] + (1 - q) * s[5]

    def current(self, s: np.ndarray, v: complex) -> tuple[complex, float, float]:
        """Into the bus, and i_d and i_q."""
        turn = np.exp(1j * (s[0] - np.pi / 2))
        u = v / turn  # v_d + j·v_q
        e_q, e_d = self.emf(s)
        w = s[1] if self.system.emf_with_speed else 1.0
        R, X_d, X_q = self.m.R_a, self.X_d2, self.X_q2
        # v_d = w·e''_d − R·i_d + X''_q·i_q, v_q = w·e''_q − R·i_q − X''_d·i_d
        a, b = w * e_d - u.real, w * e_q - u.imag
        det = R * R + X_d * X_q
        i_d, i_q = (R * a + X_q * b) / det, (R * b - X_d * a) / det
        return self.scale * complex(i_d, i_q) * turn, i_d, i_q

    def begin(self, v: complex, i: complex) -> np.ndarray:
        """States of the operating point."""
        m, i = self.m, i / self.scale
        S = 0.0
        if m.S_12:
            S = self.saturation(abs(v + complex(m.R_a, self.X_d2) * i))
        self.S_q_ratio = (m.X_q - m.X_l) / (m.X_d - m.X_l)
        # On the q axis (1 + S·ratio)·ψ''_q = (X_q − X''_q)·i_q, so X_q seen from outside is less.
        seen = self.X_q2 + (m.X_q - self.X_q2) / (1 + S * self.S_q_ratio)
        delta = np.angle(v + complex(m.R_a, seen) * i)
        turn = np.exp(1j * (delta - np.pi / 2))
        u, c = v / turn, i / turn
        i_d, i_q = c.real, c.imag
        e_q = u.imag + m.R_a * i_q + self.X_d2 * i_d
        e_d = u.real + m.R_a * i_d - self.X_q2 * i_q
        self.E_fd = e_q * (1 + S) + (m.X_d - self.X_d2) * i_d
        self.T_m = e_d * i_d + e_q * i_q + (self.X_q2 - self.X_d2) * i_d * i_q
        E_q1, E_d1 = (
            self.E_fd - S * e_q - (m.X_d - m.X_d1) * i_d,
            (m.X_q - m.X_q1) * i_q - S * self.S_q_ratio * e_d,
        )
        own = [delta, 1.0, E_q1, E_d1]
        if self.sixth:
            own += [E_q1 - (m.X_d1 - m.X_l) * i_d, E_d1 + (m.X_q1 - m.X_l) * i_q]
        return self.with_exciter(own, abs(v))

    def with_exciter(self, own: list[float], v_t: float) -> np.ndarray:
        """The machine's states with those of its exciter behind them; E_fd is known."""
        self.first = len(own)
        x = self.x
        if isinstance(x, Thyristor):
            own += [v_t, self.E_fd / x.K_A] + ([0.0] * 3 if x.K_STAB else [])
            self.V_ref = v_t + self.E_fd / x.K_A
        elif isinstance(x, Commutator):
            V_R = (x.K_E + x.saturation(self.E_fd)) * self.E_fd
            own += [self.E_fd, V_R, self.E_fd] + ([v_t] if x.T_R else [])
            self.V_ref = v_t + V_R / x.K_A
        return np.array(own)

    def rates(self, s: np.ndarray, v: complex) -> np.ndarray:
        m, system = self.m, self.system
        _, i_d, i_q = self.current(s, v)
        e_q, e_d = self.emf(s)
        w = s[1]
        T_e = e_d * i_d + e_q * i_q + (self.X_q2 - self.X_d2) * i_d * i_q
        T_m = self.T_m if system.constant_torque else self.T_m / w
        E_fd, others = self.excitation(s, abs(v))
        S = self.saturation(np.hypot(e_q, e_d)) if m.S_12 else 0.0
        if self.sixth:

            def field(E: float, psi: float, i: float, X: float, X1: float, X2: float) -> float:
                near = (X2 - m.X_l) / (X1 - m.X_l)
                far = (X1 - X2) / (X1 - m.X_l) ** 2
                return E + (X - X1) * (near * i + far * (E - psi))

            d_axis = field(s[2], s[4], i_d, m.X_d, m.X_d1, self.X_d2) + S * e_q
            q_axis = field(s[3], s[5], -i_q, m.X_q, m.X_q1, self.X_q2) + S * self.S_q_ratio * e_d
            dampers = [
                (s[2] - s[4] - (m.X_d1 - m.X_l) * i_d) / m.T_d20,
                (s[3] - s[5] + (m.X_q1 - m.X_l) * i_q) / m.T_q20,
            ]
        else:
            d_axis, q_axis = s[2] + (m.X_d - m.X_d1) * i_d, s[3] - (m.X_q - m.X_q1) * i_q
            dampers = []
        own = [
            2 * np.pi * system.frequency * (w - 1),
            (T_m - T_e - m.D * (w - 1)) / (2 * m.H),
            (E_fd - d_axis) / m.T_d10,
            -q_axis / m.T_q10,
        ]
        return np.array([*own, *dampers, *others])

    def excitation(self, s: np.ndarray, v_t: float) -> tuple[float, list[float]]:
        """E_fd, and the rates of the exciter's states."""
        x, k = self.x, self.first
        if isinstance(x, Thyristor):
            signal, rates = 0.0, list[float]()
            if x.K_STAB:
                u = x.K_STAB * (s[1] - 1 - s[k + 2])
                rates.append((s[1] - 1 - s[k + 2]) / x.T_W)
                for number, (lead, lag) in enumerate(x.leads):
                    state = s[k + 3 + number]
                    rates.append((u - state) / lag)
                    u = state + lead / lag * (u - state)
                signal = u
            error = self.V_ref + signal - s[k]
            rate = (error - s[k + 1]) / x.T_B
            return x.K_A * (s[k + 1] + x.T_A / x.T_B * (error - s[k + 1])), [
                (v_t - s[k]) / x.T_R,
                rate,
                *rates,
            ]
        if isinstance(x, Commutator):
            E, V_R, slow = s[k : k + 3]
            measured = s[k + 3] if x.T_R else v_t
            rates = [
                (V_R - (x.K_E + x.saturation(E)) * E) / x.T_E,
                (x.K_A * (self.V_ref - measured - x.K_F / x.T_F * (E - slow)) - V_R) / x.T_A,
                (E - slow) / x.T_F,
            ]
            return E, rates + ([(v_t - measured) / x.T_R] if x.T_R else [])
        return self.E_fd, []
