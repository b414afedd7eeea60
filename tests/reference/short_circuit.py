"""A bolted short circuit in time, with phasors: NumPy alone, nothing of ours.

Machines of sixth order behind X'' on a linear network, SEXS, TGOV1 and STAB1 as TOPS and PowerFactory have them. What
the programs do differently is a choice:

* ``rotor``: ``"tops"`` (e' and e'' one after the other, T''_0·de''/dt = e' − e'' ∓ (X' − X'')·i), ``"classical"``
  (GENROU) or ``"short-circuit"`` (`rotor_circuits.of_short_circuit_data`);
* ``emf_with_speed``: e = w·e'', as our phasor models have it, or e'' at rated speed.

Classical Runge-Kutta steps; the fault begins and ends on a step.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tests.reference.rotor_circuits import Axis, Circuit, of_short_circuit_data, one_after_the_other
from tests.reference.tops_systems import INTERVAL, TopsSystem

Rotor = Literal["tops", "classical", "short-circuit"]
_Pair = tuple[np.ndarray, np.ndarray]
SHORT = 1e6
"""Admittance of the short circuit [pu on 100 MVA]."""
_DELTA, _W, _FLUXES, _LEAD, _E_FD, _VALVE, _REHEAT, _WASHOUT, _STAGE_1, _STAGE_2 = (
    0,
    1,
    slice(2, 6),
    *range(6, 13),
)


@dataclass
class ShortCircuit:
    """The system with its first generator's bus short-circuited from 1 s on."""

    system: TopsSystem
    rotor: Rotor
    X_l: float = 0.1
    emf_with_speed: bool = False
    stabilisers: bool = True
    step: float = INTERVAL

    def __post_init__(self) -> None:
        s, g = self.system, self.system.data
        self.omega_b = 2 * np.pi * s.frequency
        self.scale = g["S_n"] / 100
        self.X2 = g["X_d_st"]
        self.Z = {
            fault: self._between_machines(s.bus[0] if fault else None) for fault in (False, True)
        }
        u = s.v[s.bus]
        i = np.conj(s.S / self.scale / u)
        delta = np.angle(u + 1j * g["X_q"] * i)
        turn = np.exp(1j * (delta - np.pi / 2))
        (u_d, u_q), (i_d, i_q) = _parts(u / turn), _parts(i / turn)
        self.P_m = (u * np.conj(i)).real / g["PF_n"]
        self.v_t = abs(u)
        self.E_fd = u_q + g["X_d"] * i_d
        if self.rotor == "tops":
            fluxes = [
                u_q + g["X_d_t"] * i_d,
                u_d - g["X_q_t"] * i_q,
                u_q + self.X2 * i_d,
                u_d - self.X2 * i_q,
            ]
        else:
            self.d, self.q = self._circuits("d"), self._circuits("q")
            gap = u_q + self.X_l * i_d
            first = gap + self.d[1] * self.E_fd / self.d[0]
            fluxes = [first, gap, -u_d + self.X_l * i_q, -u_d + self.X_l * i_q]
        zero = np.zeros_like(delta)
        self.start = np.array(
            [
                delta,
                zero,
                *fluxes,
                self.E_fd / g["SEXS.K"],
                self.E_fd,
                self.P_m,
                self.P_m,
                zero,
                zero,
                zero,
            ]
        )
        assert np.abs(self.rates(self.start, fault=False)).max() < 1e-7

    def _between_machines(self, short: int | None) -> np.ndarray:
        Y = self.system.Y.copy()
        np.add.at(Y, (self.system.bus, self.system.bus), self.scale / (1j * self.X2))
        if short is not None:
            Y[short, short] += SHORT
        return np.linalg.inv(Y)[np.ix_(self.system.bus, self.system.bus)]

    def _circuits(self, axis: str) -> np.ndarray:
        """X_m, X and R of the slow branch, X and R of the fast one; a column for each machine."""
        g = self.system.data
        convert = one_after_the_other if self.rotor == "classical" else of_short_circuit_data
        found = []
        columns = (
            g[key.format(axis)] for key in ("X_{}", "X_{}_t", "X_{}_st", "T_{}0_t", "T_{}0_st")
        )
        for X, X1, X2, T1, T2 in zip(*columns, strict=True):
            if X1 == X:  # no slow branch
                X_m, seen = X - self.X_l, X2 - self.X_l
                fast = X_m * seen / (X_m - seen)
                c = Circuit(X_m, (1e9, 1e9), (fast, (X_m + fast) / (self.omega_b * T2)))
            else:
                c = convert(Axis(X, X1, X2, self.X_l, T1, T2), self.omega_b)
            found.append((c.X_m, *c.slow, *c.fast))
        return np.array(found).T

    def emf(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """e''_q and e''_d."""
        a, b, c, e = x[_FLUXES]
        if self.rotor == "tops":
            return c, e
        (d, q) = (1 / (1 / k[0] + 1 / k[1] + 1 / k[3]) for k in (self.d, self.q))
        return d * (a / self.d[1] + b / self.d[3]), -q * (c / self.q[1] + e / self.q[3])

    def rates(self, x: np.ndarray, *, fault: bool) -> np.ndarray:
        """Of all states, shape (13, generators)."""
        g = self.system.data
        e_q, e_d = self.emf(x)
        w = 1 + x[_W]
        turn = np.exp(1j * (x[_DELTA] - np.pi / 2))
        E = (e_d + 1j * e_q) * turn * (w if self.emf_with_speed else 1.0)
        u = self.Z[fault] @ (E / (1j * self.X2) * self.scale)
        i_d, i_q = _parts((E - u) / (1j * self.X2) / turn)
        E_fd, P_m, controls = self._controls(x, abs(u))
        torque = g["PF_n"] * P_m / w - e_q * i_q - e_d * i_d
        fluxes = self._flux_rates(x, E_fd, (e_q, e_d), (i_d, i_q))
        return np.array([self.omega_b * x[_W], torque / (2 * g["H"]), *fluxes, *controls])

    def _flux_rates(
        self, x: np.ndarray, E_fd: np.ndarray, emf: _Pair, current: _Pair
    ) -> list[np.ndarray]:
        g, (e_q, e_d), (i_d, i_q) = self.system.data, emf, current
        a, b, c, e = x[_FLUXES]
        if self.rotor == "tops":
            return [
                (E_fd - a - (g["X_d"] - g["X_d_t"]) * i_d) / g["T_d0_t"],
                (-b + (g["X_q"] - g["X_q_t"]) * i_q) / g["T_q0_t"],
                (a - c - (g["X_d_t"] - self.X2) * i_d) / g["T_d0_st"],
                (b - e + (g["X_q_t"] - self.X2) * i_q) / g["T_q0_st"],
            ]
        gap_d, gap_q = e_q - (self.X2 - self.X_l) * i_d, -e_d - (self.X2 - self.X_l) * i_q
        d, q, rate = self.d, self.q, self.omega_b
        return [
            rate * d[2] * (E_fd / d[0] - (a - gap_d) / d[1]),
            -rate * d[4] * (b - gap_d) / d[3],
            -rate * q[2] * (c - gap_q) / q[1],
            -rate * q[4] * (e - gap_q) / q[3],
        ]

    def _controls(
        self, x: np.ndarray, v_t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """E_fd, the turbine's power on P_n, and the rates of both and of the stabiliser."""
        g, w, on = self.system.data, x[_W], self.system.data["controlled"]
        slow, shape = g["STAB1.K"] / g["STAB1.T"] * w - x[_WASHOUT], ("STAB1.T_1", "STAB1.T_3")
        one, d_one = _lead(slow, x[_STAGE_1], *(g[k] for k in shape))
        two, d_two = _lead(one, x[_STAGE_2], g["STAB1.T_2"], g["STAB1.T_4"])
        signal = np.clip(two, -g["STAB1.H_lim"], g["STAB1.H_lim"]) * (on & self.stabilisers)
        error = self.v_t + self.E_fd / g["SEXS.K"] - v_t + signal
        led, d_led = _lead(error, x[_LEAD], g["SEXS.T_a"], g["SEXS.T_b"])
        d_E = _stopped(
            (g["SEXS.K"] * led - x[_E_FD]) / g["SEXS.T_e"],
            x[_E_FD],
            g["SEXS.E_min"],
            g["SEXS.E_max"],
        )
        wanted = self.P_m - w / g["TGOV1.R"]
        d_valve = _stopped(
            (wanted - x[_VALVE]) / g["TGOV1.T_1"], x[_VALVE], g["TGOV1.V_min"], g["TGOV1.V_max"]
        )
        power, d_reheat = _lead(x[_VALVE], x[_REHEAT], g["TGOV1.T_2"], g["TGOV1.T_3"])
        E_fd = np.where(on, np.clip(x[_E_FD], g["SEXS.E_min"], g["SEXS.E_max"]), self.E_fd)
        P_m = np.where(on, power - g["TGOV1.D_t"] * w, self.P_m)
        return (
            E_fd,
            P_m,
            on * np.array([d_led, d_E, d_valve, d_reheat, slow / g["STAB1.T"], d_one, d_two]),
        )

    def eigenvalues(self) -> np.ndarray:
        """Of the equations linearised by central differences [rad/s]; oscillations once, fastest last."""
        n, shape, h = self.start.size, self.start.shape, 1e-6
        A = np.empty((n, n))
        for k in range(n):
            e = np.zeros(n)
            e[k] = h
            off = (
                self.rates(self.start + sign * e.reshape(shape), fault=False) for sign in (1, -1)
            )
            A[:, k] = np.subtract(*off).ravel() / (2 * h)
        values = np.linalg.eigvals(A)
        return np.sort_complex(values[values.imag > 0] / 1j) * 1j

    def speeds(self, duration: float, stop: float = 9.995) -> np.ndarray:
        """Speeds [pu], a row every 5 ms from 0 s on."""
        x, rows, h = self.start.copy(), [], self.step
        every, first, last = (round(t / h) for t in (INTERVAL, 1.0, 1.0 + duration))
        for k in range(round(stop / h) + 1):
            if k % every == 0:
                rows.append(1 + x[_W])
            on = first <= k < last
            k_1 = self.rates(x, fault=on)
            k_2 = self.rates(x + h / 2 * k_1, fault=on)
            k_3 = self.rates(x + h / 2 * k_2, fault=on)
            k_4 = self.rates(x + h * k_3, fault=on)
            x = x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
        return np.array(rows)


def rms_micro(found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Root-mean-square difference of each column [1e-6 pu]."""
    return 1e6 * np.sqrt(np.mean((found - wanted) ** 2, axis=0))


def _parts(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return z.real, z.imag


def _lead(
    u: np.ndarray, state: np.ndarray, T_lead: np.ndarray, T_lag: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Output and rate of (1 + s·T_lead)/(1 + s·T_lag)."""
    rate = (u - state) / T_lag
    return state + T_lead * rate, rate


def _stopped(rate: np.ndarray, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.where(((x >= high) & (rate > 0)) | ((x <= low) & (rate < 0)), 0.0, rate)
