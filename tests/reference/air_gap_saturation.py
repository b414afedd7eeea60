"""A machine whose air gap saturates as in Kundur, Power System Stability and Control, chapters 3 and 12.

The flux linkage of the air gap ψ_at takes ψ_I = A_sat·exp(B_sat·(ψ_at − ψ_T1)) more excitation than without iron.
Both mutual inductances saturate alike: at the operating point by the total factor ψ_at/(ψ_at + ψ_I), and around it by
the incremental factor 1/(1 + B_sat·ψ_I), the slope of the curve there. Neither axis feels the flux of the other.
Leakages and resistances of the windings are those of the standard data without saturation.
"""

import numpy as np

from tests.reference.multi_machine import Machine, System, Unit

A_SAT, B_SAT, PSI_T1 = 0.015, 9.6, 0.9
"""Of example 12.6 [pu]."""


class AirGapUnit(Unit):
    """One machine with its exciter, in windings' flux linkages: δ, w, ψ_fd, ψ_1q, ψ_1d, ψ_2q."""

    def __init__(self, system: System, m: Machine) -> None:
        super().__init__(system, m)
        self.omega_b = 2 * np.pi * system.frequency
        self.L_ad, self.L_aq = m.X_d - m.X_l, m.X_q - m.X_l
        self.leakage_d, self.resistance_d = self._windings(
            self.L_ad, m.X_d1, self.X_d2, m.T_d10, m.T_d20
        )
        self.leakage_q, self.resistance_q = self._windings(
            self.L_aq, m.X_q1, self.X_q2, m.T_q10, m.T_q20
        )

    def _windings(
        self, L_a: float, X1: float, X2: float, T1: float, T2: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Leakages and resistances [pu] of an axis's two windings, from its standard data."""
        X_l = self.m.X_l
        first = 1 / (1 / (X1 - X_l) - 1 / L_a)
        second = 1 / (1 / (X2 - X_l) - 1 / (X1 - X_l))
        resistances = (L_a + first) / T1, (second + X1 - X_l) / T2
        return np.array([first, second]), np.array(resistances) / self.omega_b

    def factors(self, flux: float) -> tuple[float, float]:
        """Total and incremental saturation factor at a flux linkage of the air gap [pu]."""
        lost = A_SAT * np.exp(B_SAT * (flux - PSI_T1))
        return flux / (flux + lost), 1 / (1 + B_SAT * lost)

    def begin(self, v: complex, i: complex) -> np.ndarray:
        m, i = self.m, i / self.scale
        flux = abs(v + complex(m.R_a, m.X_l) * i)
        total, incremental = self.factors(flux)
        delta = np.angle(v + complex(m.R_a, m.X_l + total * self.L_aq) * i)
        turn = np.exp(1j * (delta - np.pi / 2))
        u, c = v / turn, i / turn
        i_d, i_q = c.real, c.imag
        self.at_start = u.imag + m.R_a * i_q + m.X_l * i_d, -u.real - m.R_a * i_d + m.X_l * i_q
        psi_d, psi_q = self.at_start
        field = psi_d / (total * self.L_ad) + i_d
        self.magnetising = field - i_d, -i_q
        self.slopes = incremental * self.L_ad, incremental * self.L_aq
        self.E_fd = self.L_ad * field
        self.T_m = psi_d * i_q - psi_q * i_d
        own = [delta, 1.0, psi_d + self.leakage_d[0] * field, psi_q, psi_d, psi_q]
        return self.with_exciter(own, abs(v))

    def air_gap(self, s: np.ndarray, i_d: float, i_q: float) -> tuple[float, float]:
        """ψ_ad and ψ_aq, on the curve's tangent at the operating point."""

        def of_axis(k: int, leakages: np.ndarray, fluxes: np.ndarray, i: float) -> float:
            without = self.at_start[k] + self.slopes[k] * (
                (fluxes / leakages).sum() - i - self.magnetising[k]
            )
            return float(without / (1 + self.slopes[k] * (1 / leakages).sum()))

        return (
            of_axis(0, self.leakage_d, s[[2, 4]], i_d),
            of_axis(1, self.leakage_q, s[[3, 5]], i_q),
        )

    def current(self, s: np.ndarray, v: complex) -> tuple[complex, float, float]:
        R, X_l = self.m.R_a, self.m.X_l
        turn = np.exp(1j * (s[0] - np.pi / 2))
        u = v / turn
        (d_0, q_0), (d_1, q_1) = self.air_gap(s, 0, 0), self.air_gap(s, 1, 1)
        X_d, X_q = X_l + d_0 - d_1, X_l + q_0 - q_1
        # v_d = −ψ_q − R·i_d and v_q = ψ_d − R·i_q; stator fluxes are the air gap's less X_l·i
        a, b = -q_0 - u.real, d_0 - u.imag
        det = R * R + X_d * X_q
        i_d, i_q = (R * a + X_q * b) / det, (R * b - X_d * a) / det
        return self.scale * complex(i_d, i_q) * turn, i_d, i_q

    def rates(self, s: np.ndarray, v: complex) -> np.ndarray:
        m = self.m
        _, i_d, i_q = self.current(s, v)
        psi_d, psi_q = self.air_gap(s, i_d, i_q)
        E_fd, others = self.excitation(s, abs(v))
        T_m = self.T_m if self.system.constant_torque else self.T_m / s[1]
        in_d = self.resistance_d * (psi_d - s[[2, 4]]) / self.leakage_d
        in_q = self.resistance_q * (psi_q - s[[3, 5]]) / self.leakage_q
        in_d[0] += self.resistance_d[0] * E_fd / self.L_ad
        torque = T_m - psi_d * i_q + psi_q * i_d - m.D * (s[1] - 1)
        windings = self.omega_b * np.array([in_d[0], in_q[0], in_d[1], in_q[1]])
        return np.array([self.omega_b * (s[1] - 1), torque / (2 * m.H), *windings, *others])
