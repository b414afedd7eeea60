"""The grid-forming converter as the paper draws it, in complex quantities of its own frame, f = f_q − j·f_d."""

from dataclasses import dataclass

import numpy as np

from tests.reference.blocks import lag, lead_lag, washout
from tests.reference.descriptor import Unknowns

Data = dict[str, float]

W_B = 100 * np.pi
"""Base angular frequency [rad/s]."""

GFOR: Data = {
    "S_n": 1500.0,
    "filter.R_c": 0.005,
    "filter.X_c": 0.15,
    "filter.B_c": 0.15,
    "transformer.R_t": 0.002,
    "transformer.X_t": 0.15,
    "droop.R_f": 0.05,
    "droop.R_V": 0.067,
    "droop.tau_P": 0.1,
    "droop.tau_Q": 0.1,
    "feed_forward.tau": 1e-4,
    "voltage_control.tau": 0.05,
    "voltage_control.xi": 0.707,
    "current_control.tau": 1e-3,
    "pod_p.enabled": False,
    "pod_p.K": 200.0,
    "pod_p.T_W": 5.0,
    "pod_p.T_f": 0.1,
    "pod_p.T_S1": 0.20,
    "pod_p.T_S2": 0.37,
    "pod_q.enabled": False,
    "pod_q.K": 200.0,
    "pod_q.T_W": 5.0,
    "pod_q.T_f": 0.1,
    "pod_q.T_S1": 0.26,
    "pod_q.T_S2": 0.29,
}
"""The paper's converter; N_S = 2 stages."""

_STATES = ("i_s", "u_c", "i_g", "u_ff", "i_ff", "x_v", "x_i")
"""Complex: each is two unknowns, its q component and minus its d component."""

_POD = ("washout", "low_pass", "stage_1", "stage_2")


class Converter:
    """Equations of the converter at a bus; parameters as for a machine."""

    def __init__(self, name: str, data: Data, bus: str) -> None:
        self.name, self.data, self.bus = name, data, bus
        self.pods = tuple(kind for kind in "pq" if data[f"pod_{kind}.enabled"])

    @property
    def references(self) -> tuple[str, ...]:
        """Unknowns that are held while the rest moves."""
        return tuple(f"{self.name}.{k}" for k in ("P_ref", "Q_ref", "U_0"))

    def start(self, v: complex, power: complex) -> dict[str, float]:
        """A first guess from the phasor diagram, at a bus voltage and a power into the bus [pu on the rating]."""
        i = (power / v).conjugate()
        u = v + 1j * self.data["transformer.X_t"] * i
        turn = u.conjugate() / abs(u)
        guess = {"u_c": u, "u_ff": u, "i_g": i, "i_ff": i, "i_s": i, "x_v": 0.0, "x_i": 0.0}
        values = {
            f"{k}_{part}": getattr(complex(guess[k] * turn), part)
            for k in _STATES
            for part in ("real", "imag")
        }
        values |= {"theta": float(np.angle(u)), "P_f": power.real, "Q_f": power.imag}
        values |= {f"pod_{kind}_{k}": 0.0 for kind in self.pods for k in _POD}
        values |= {"P_ref": power.real, "Q_ref": power.imag, "U_0": abs(u)}
        return {f"{self.name}.{key}": value for key, value in values.items()}

    def equations(self, s: Unknowns) -> None:
        """Add all residuals of the converter."""
        n, d = self.name, self.data
        i_s, u_c, i_g, u_ff, i_ff, x_v, x_i = (
            Pair(s[f"{n}.{k}_real"], s[f"{n}.{k}_imag"]) for k in _STATES
        )
        rate = {k: Pair(s.dot(f"{n}.{k}_real"), s.dot(f"{n}.{k}_imag")) for k in _STATES}
        X_c, B_c, X_t = d["filter.X_c"], d["filter.B_c"], d["transformer.X_t"]
        u = u_c + (i_s - i_g) * (1 / (30 * B_c))
        P, Q = _power(u, i_g)
        w = 1 + d["droop.R_f"] * (
            s[f"{n}.P_ref"] - self._pod(s, "p") - lag(s, f"{n}.P_f", P, d["droop.tau_P"])
        )
        reactive = s[f"{n}.Q_ref"] + self._pod(s, "q") - lag(s, f"{n}.Q_f", Q, d["droop.tau_Q"])
        u_ref = Pair(s[f"{n}.U_0"] + d["droop.R_V"] * reactive, 0.0)
        s.equate(s.dot(f"{n}.theta"), W_B * (w - 1))
        for kind in self.pods:
            self._filter(s, kind, w - 1)
        # Cascaded control
        tau_v, xi, tau_i = (
            d["voltage_control.tau"],
            d["voltage_control.xi"],
            d["current_control.tau"],
        )
        omega_n, C_c, L_c = 4 / (tau_v * xi), B_c / W_B, X_c / W_B
        error = u_ref - u
        i_ref = error * (2 * xi * omega_n * C_c * 100) + x_v + u.turned(w * B_c) + i_ff
        v_c = (i_ref - i_s) * (L_c / tau_i) + x_i + i_s.turned(w * X_c) + u_ff
        _equate(s, rate["x_v"], error * (omega_n**2 * C_c))
        _equate(s, rate["x_i"], (i_ref - i_s) * (d["filter.R_c"] / tau_i))
        _equate(s, rate["u_ff"] * d["feed_forward.tau"] + u_ff, u)
        _equate(s, rate["i_ff"] * d["feed_forward.tau"] + i_ff, i_g)
        # Filter and transformer
        bus = self._bus_voltage(s)
        _equate(s, rate["i_s"] * (X_c / W_B), v_c - u - i_s * d["filter.R_c"] - i_s.turned(w * X_c))
        _equate(s, rate["u_c"] * (B_c / W_B), i_s - i_g - u_c.turned(w * B_c))
        _equate(
            s, rate["i_g"] * (X_t / W_B), u - bus - i_g * d["transformer.R_t"] - i_g.turned(w * X_t)
        )

    def _pod(self, s: Unknowns, kind: str) -> complex:
        """Output of a damping controller, K times that of its last stage; added to Q's reference, taken from P's."""
        if kind not in self.pods:
            return 0.0
        last = f"{self.name}.pod_{kind}_{_POD[-1]}"
        return self.data[f"pod_{kind}.K"] * (s[last] + self.data[f"pod_{kind}.T_S1"] * s.dot(last))

    def _filter(self, s: Unknowns, kind: str, deviation: complex) -> None:
        """Washout, low-pass filter and both lead/lag stages of a damping controller."""
        at = [f"{self.name}.pod_{kind}_{k}" for k in _POD]
        T_W, T_f, T_1, T_2 = (self.data[f"pod_{kind}.{k}"] for k in ("T_W", "T_f", "T_S1", "T_S2"))
        filtered = lag(s, at[1], washout(s, at[0], deviation, T_W), T_f)
        lead_lag(s, at[3], lead_lag(s, at[2], filtered, T_1, T_2), T_1, T_2)

    def _bus_voltage(self, s: Unknowns) -> "Pair":
        re, im = s[f"{self.bus}.re"], s[f"{self.bus}.im"]
        cos, sin = np.cos(s[f"{self.name}.theta"]), np.sin(s[f"{self.name}.theta"])
        return Pair(re * cos + im * sin, im * cos - re * sin)

    def current(self, s: Unknowns) -> tuple[complex, complex]:
        """Into the bus, in the network's frame [pu on 100 MVA]."""
        a, b = s[f"{self.name}.i_g_real"], s[f"{self.name}.i_g_imag"]
        cos, sin = np.cos(s[f"{self.name}.theta"]), np.sin(s[f"{self.name}.theta"])
        scale = self.data["S_n"] / 100
        return scale * (a * cos - b * sin), scale * (a * sin + b * cos)

    def power(self, s: Unknowns) -> tuple[complex, complex]:
        """P and Q into the bus [pu on the rating]."""
        i = Pair(s[f"{self.name}.i_g_real"], s[f"{self.name}.i_g_imag"])
        return _power(self._bus_voltage(s), i)


@dataclass(frozen=True)
class Pair:
    """A complex quantity as two numbers, each of which may carry a complex step."""

    a: complex
    b: complex

    def __add__(self, other: "Pair") -> "Pair":
        return Pair(self.a + other.a, self.b + other.b)

    def __sub__(self, other: "Pair") -> "Pair":
        return Pair(self.a - other.a, self.b - other.b)

    def __mul__(self, factor: complex) -> "Pair":
        return Pair(self.a * factor, self.b * factor)

    def turned(self, factor: complex) -> "Pair":
        """j·factor times the quantity."""
        return Pair(-self.b * factor, self.a * factor)


def _power(u: Pair, i: Pair) -> tuple[complex, complex]:
    """u·conj(i)."""
    return u.a * i.a + u.b * i.b, u.b * i.a - u.a * i.b


def _equate(s: Unknowns, left: Pair, right: Pair) -> None:
    s.equate(left.a, right.a)
    s.equate(left.b, right.b)
