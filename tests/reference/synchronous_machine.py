"""The synchronous machine with transformer, exciter, stabiliser and governor, in winding currents.

Park's equations as printed, generator signs, per unit on the machine's rating: the windings' currents are the
unknowns, flux linkages follow from them, and their derivatives from the currents' derivatives. Data are flat tables
by the names of the README beside this file.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.reference.blocks import lag, lead_lag, washout
from tests.reference.descriptor import Unknowns

Data = dict[str, float]

W_B = 100 * np.pi
"""Base angular frequency [rad/s]."""

_GOVERNOR = {
    f"governor.{k}": 0.0 for k in ("T_1", "T_2", "T_7", "K_2", "K_4", "K_6", "K_7", "K_8")
} | {
    "governor.enabled": True,
    "governor.inverse_R": 20.0,
    "governor.T_3": 0.1,
    "governor.T_4": 0.3,
    "governor.T_5": 7.0,
    "governor.T_6": 0.6,
    "governor.K_1": 0.3,
    "governor.K_3": 0.3,
    "governor.K_5": 0.4,
}
_COMMON = {
    "transformer.R_t": 0.0,
    "transformer.X_t": 0.15,
    "machine.R_s": 0.0025,
    "machine.D": 0.0,
    "machine.exact_conversion": False,
    "machine.saturation": False,
} | _GOVERNOR

SG1: Data = _COMMON | {
    "S_n": 1500.0,
    "machine.H": 6.3,
    "machine.X_l": 0.234,
    "machine.X_d": 2.135,
    "machine.X_d1": 0.34,
    "machine.X_d2": 0.269,
    "machine.T_d10": 6.47,
    "machine.T_d20": 0.022,
    "machine.X_q": 2.046,
    "machine.X_q1": 0.573,
    "machine.X_q2": 0.269,
    "machine.T_q10": 0.61,
    "machine.T_q20": 0.034,
    "machine.s_10": 0.1275,
    "machine.s_12": 0.2706,
    "exciter.T_R": 0.02,
    "exciter.K_PR": 3.15,
    "exciter.K_IR": 3.15,
    "exciter.T_A": 0.02,
    "exciter.K_P": 6.5,
    "exciter.K_C": -0.08,
}
"""ST4B."""

SG2: Data = _COMMON | {
    "S_n": 5000.0,
    "machine.H": 6.175,
    "machine.X_l": 0.2,
    "machine.X_d": 1.8,
    "machine.X_d1": 0.3,
    "machine.X_d2": 0.25,
    "machine.T_d10": 8.0,
    "machine.T_d20": 0.03,
    "machine.X_q": 1.7,
    "machine.X_q1": 0.55,
    "machine.X_q2": 0.25,
    "machine.T_q10": 0.4,
    "machine.T_q20": 0.05,
    "machine.s_10": 0.0392,
    "machine.s_12": 0.2227,
    "exciter.T_R": 0.01,
    "exciter.T_B": 10.0,
    "exciter.T_C": 1.0,
    "exciter.K_A": 200.0,
}
"""ST1."""

PSS2A: Data = {
    "pss.T_w1": 2.0,
    "pss.T_w2": 2.0,
    "pss.T_6": 0.0,
    "pss.T_w3": 2.0,
    "pss.T_w4": 0.0,
    "pss.T_7": 2.0,
    "pss.K_s2": 0.158,
    "pss.K_s3": 1.0,
    "pss.T_8": 0.0,
    "pss.T_9": 0.1,
    "pss.K_s1": 17.069,
    "pss.T_1": 0.28,
    "pss.T_2": 0.04,
    "pss.T_3": 0.28,
    "pss.T_4": 0.12,
}
"""Of SG1 in the grid code's test; M = 5, N = 1."""


@dataclass(frozen=True)
class Axis:
    """Magnetising reactance of one axis, and leakage and resistance of its two rotor windings [pu]."""

    X_m: float
    X_1: float
    R_1: float
    X_2: float
    R_2: float


def classical(X: float, X_1: float, X_2: float, X_l: float, T_10: float, T_20: float) -> Axis:
    """Standard data to branches, one after the other (Kundur 1994, section 4.2): reactances [pu], T [s]."""
    X_m = X - X_l
    first = 1 / (1 / (X_1 - X_l) - 1 / X_m)  # X_1 − X_l is the magnetising branch beside this one
    second = 1 / (1 / (X_2 - X_l) - 1 / X_m - 1 / first)
    parallel = 1 / (1 / X_m + 1 / first)
    return Axis(
        X_m, first, (X_m + first) / (W_B * T_10), second, (second + parallel) / (W_B * T_20)
    )


def exact(X: float, X_1: float, X_2: float, X_l: float, T_10: float, T_20: float) -> Axis:
    """The branches whose operational reactance is X·(1+sT')(1+sT'')/((1+sT'_0)(1+sT''_0)) at every s.

    T' = T'_0·X'/X and T'' = T''_0·X''/X'. What the rotor adds beside X_m, 1/(X(s) − X_l) − 1/X_m, is a sum of two terms
    s/(s + p)/X_k; residues at the poles give X_k, and p = ω_b·R_k/X_k. The slower branch is the field.
    """
    X_m = X - X_l
    below = np.polymul([T_10, 1], [T_20, 1])
    above = X * np.polymul([T_10 * X_1 / X, 1], [T_20 * X_2 / X_1, 1])
    inner = np.polysub(above, X_l * below)  # X(s) − X_l = inner/below
    excess = np.polysub(below, inner / X_m)[:-1]  # s·excess/inner is the rotor's admittance
    branches = []
    for pole in np.sort(np.roots(inner).real)[::-1]:
        reactance = np.polyval(np.polyder(inner), pole) / np.polyval(excess, pole)
        branches += [reactance, -pole * reactance / W_B]
    return Axis(X_m, *branches)


class Machine:
    """Equations of one machine at a bus.

    Parameters
    ----------
    name
        Prefix of its unknowns.
    data
        Its data.
    bus
        Prefix of the bus voltage's unknowns ``<bus>.re`` and ``<bus>.im`` [pu].
    """

    def __init__(self, name: str, data: Data, bus: str) -> None:
        self.name, self.data, self.bus = name, data, bus
        convert = exact if data["machine.exact_conversion"] else classical
        self.d, self.q = (
            convert(
                *(
                    data[f"machine.{k}"]
                    for k in (f"X_{a}", f"X_{a}1", f"X_{a}2", "X_l", f"T_{a}10", f"T_{a}20")
                )
            )
            for a in "dq"
        )

    @property
    def references(self) -> tuple[str, ...]:
        """Unknowns that are held while the rest moves."""
        return (f"{self.name}.V_ref", f"{self.name}.P_ref", f"{self.name}.divisor")

    def start(self, v: complex, power: complex) -> dict[str, float]:
        """A first guess from the phasor diagram, at a bus voltage and a power into the bus [pu on the rating]."""
        X_d, X_q, X_t = (self.data[k] for k in ("machine.X_d", "machine.X_q", "transformer.X_t"))
        i = (power / v).conjugate()
        at = v + 1j * (X_q + X_t) * i
        turned = i * at.conjugate() / abs(at)
        i_d, i_q = -turned.imag, turned.real
        E_fd = abs(at) + (X_d - X_q) * i_d
        v_t = abs(v + 1j * X_t * i)
        values = {
            "i_d": i_d,
            "i_q": i_q,
            "i_f": E_fd / self.d.X_m,
            "i_1d": 0.0,
            "i_1q": 0.0,
            "i_2q": 0.0,
        }
        values |= {
            "w": 1.0,
            "delta": float(np.angle(at)),
            "v_td": 0.0,
            "v_tq": v_t,
            "v_t": v_t,
            "E_fd": E_fd,
        }
        values |= {"v_m": v_t, "regulator": 0.5, "amplifier": 0.5, "p_m": power.real}
        values |= (
            dict.fromkeys(_GOVERNOR_STAGES, power.real) if self.data["governor.enabled"] else {}
        )
        values |= dict.fromkeys(_STABILISER, 0.0) if "pss.K_s1" in self.data else {}
        values |= {"V_ref": v_t, "P_ref": power.real, "divisor": 1.0}
        return {f"{self.name}.{key}": value for key, value in values.items()}

    def equations(self, s: Unknowns) -> None:
        """Add all residuals of the machine."""
        n, d = self.name, self.data
        w, i_d, i_q, v_td, v_tq = (s[f"{n}.{k}"] for k in ("w", "i_d", "i_q", "v_td", "v_tq"))
        X_md, X_mq = self._magnetising(s)
        flux = self._fluxes(X_md, X_mq, lambda k: s[f"{n}.{k}"])
        rate = self._fluxes(X_md, X_mq, lambda k: s.dot(f"{n}.{k}"))
        # Stator and rotor windings
        s.equate(v_td, -d["machine.R_s"] * i_d + rate["d"] / W_B - w * flux["q"])
        s.equate(v_tq, -d["machine.R_s"] * i_q + rate["q"] / W_B + w * flux["d"])
        s.equate(rate["f"] / W_B, self.d.R_1 / X_md * s[f"{n}.E_fd"] - self.d.R_1 * s[f"{n}.i_f"])
        s.equate(rate["1d"] / W_B, -self.d.R_2 * s[f"{n}.i_1d"])
        s.equate(rate["1q"] / W_B, -self.q.R_1 * s[f"{n}.i_1q"])
        s.equate(rate["2q"] / W_B, -self.q.R_2 * s[f"{n}.i_2q"])
        # Transformer, in the rotor's frame
        R_t, X_t = d["transformer.R_t"], d["transformer.X_t"]
        v_d, v_q = self._bus_voltage(s)
        s.equate(v_td - v_d, R_t * i_d - w * X_t * i_q + X_t / W_B * s.dot(f"{n}.i_d"))
        s.equate(v_tq - v_q, R_t * i_q + w * X_t * i_d + X_t / W_B * s.dot(f"{n}.i_q"))
        # Motion
        torque = flux["d"] * i_q - flux["q"] * i_d
        s.equate(
            2 * d["machine.H"] * s.dot(f"{n}.w"),
            s[f"{n}.p_m"] / w - torque - d["machine.D"] * (w - 1),
        )
        s.equate(s.dot(f"{n}.delta"), W_B * (w - 1))
        # Control
        s.equate(s[f"{n}.v_t"] ** 2, v_td**2 + v_tq**2)
        at_terminal = v_d * i_d + v_q * i_q + R_t * (i_d**2 + i_q**2)
        self._excite(s, self._stabilise(s, at_terminal), X_md)
        self._govern(s)

    def conditions(self, s: Unknowns) -> None:
        """Saturation divides the magnetising reactances by 1 + s(ψ) at the steady state's air-gap flux ψ, and stays."""
        divisor = s[f"{self.name}.divisor"]
        if not self.data["machine.saturation"]:
            s.equate(divisor, 1.0)
            return
        at_10, at_12 = self.data["machine.s_10"], self.data["machine.s_12"]
        flux = self._fluxes(*self._magnetising(s), lambda k: s[f"{self.name}.{k}"])
        d, q = (flux[axis] + self.data["machine.X_l"] * s[f"{self.name}.i_{axis}"] for axis in "dq")
        exponent = np.log(at_12 / at_10) / np.log(1.2)
        s.equate(divisor, 1 + at_10 * (d**2 + q**2) ** (exponent / 2))

    def _magnetising(self, s: Unknowns) -> tuple[complex, complex]:
        divisor = s[f"{self.name}.divisor"]
        return self.d.X_m / divisor, self.q.X_m / divisor

    def _fluxes(
        self, X_md: complex, X_mq: complex, i: Callable[[str], complex]
    ) -> dict[str, complex]:
        """Flux linkages of all windings from their currents [pu]; of derivatives from derivatives."""
        mutual_d = X_md * (i("i_f") + i("i_1d") - i("i_d"))
        mutual_q = X_mq * (i("i_1q") + i("i_2q") - i("i_q"))
        return {
            "d": mutual_d - self.data["machine.X_l"] * i("i_d"),
            "q": mutual_q - self.data["machine.X_l"] * i("i_q"),
            "f": mutual_d + self.d.X_1 * i("i_f"),
            "1d": mutual_d + self.d.X_2 * i("i_1d"),
            "1q": mutual_q + self.q.X_1 * i("i_1q"),
            "2q": mutual_q + self.q.X_2 * i("i_2q"),
        }

    def _bus_voltage(self, s: Unknowns) -> tuple[complex, complex]:
        """d and q component: re + j·im turned by −δ is f_q − j·f_d."""
        re, im = s[f"{self.bus}.re"], s[f"{self.bus}.im"]
        cos, sin = np.cos(s[f"{self.name}.delta"]), np.sin(s[f"{self.name}.delta"])
        return re * sin - im * cos, re * cos + im * sin

    def current(self, s: Unknowns) -> tuple[complex, complex]:
        """Into the bus, in the network's frame [pu on 100 MVA]."""
        i_d, i_q = s[f"{self.name}.i_d"], s[f"{self.name}.i_q"]
        cos, sin = np.cos(s[f"{self.name}.delta"]), np.sin(s[f"{self.name}.delta"])
        scale = self.data["S_n"] / 100
        return scale * (i_q * cos + i_d * sin), scale * (i_q * sin - i_d * cos)

    def power(self, s: Unknowns) -> tuple[complex, complex]:
        """P and Q into the bus [pu on the rating]."""
        v_d, v_q = self._bus_voltage(s)
        i_d, i_q = s[f"{self.name}.i_d"], s[f"{self.name}.i_q"]
        return v_d * i_d + v_q * i_q, v_q * i_d - v_d * i_q

    def _excite(self, s: Unknowns, signal: complex, X_md: complex) -> None:
        """ST4B where there is a K_PR; otherwise a transient gain reduction, a gain and, with T_A > 0, a lag."""
        n, e = (
            self.name,
            {
                k.removeprefix("exciter."): v
                for k, v in self.data.items()
                if k.startswith("exciter.")
            },
        )
        error = s[f"{n}.V_ref"] + signal - lag(s, f"{n}.v_m", s[f"{n}.v_t"], e["T_R"])
        if "K_PR" not in e:
            reduced = lead_lag(s, f"{n}.regulator", error, e["T_C"], e["T_B"])
            s.equate(s[f"{n}.E_fd"], lag(s, f"{n}.amplifier", reduced, e.get("T_A", 0.0), e["K_A"]))
            return
        s.equate(s.dot(f"{n}.regulator"), e["K_IR"] * error)
        bridge = lag(s, f"{n}.amplifier", e["K_PR"] * error + s[f"{n}.regulator"], e["T_A"])
        # rectifier: f_ex = 1 − 0.577·K_C·I_fd/source, I_fd = X_md·i_f
        source = e["K_P"] * s[f"{n}.v_t"]
        s.equate(s[f"{n}.E_fd"], bridge * (source - 0.577 * e["K_C"] * X_md * s[f"{n}.i_f"]))

    def _stabilise(self, s: Unknowns, power: complex) -> complex:
        """PSS2A: the integral of accelerating power from speed and electrical power (IEEE 421.5)."""
        if "pss.K_s1" not in self.data:
            return 0.0
        c = {k.removeprefix("pss."): v for k, v in self.data.items()}
        names = dict(zip(_STABILISER, (f"{self.name}.{k}" for k in _STABILISER), strict=True))
        speed = washout(s, names["washout_1"], s[f"{self.name}.w"] - 1, c["T_w1"])
        speed = lag(s, names["speed"], washout(s, names["washout_2"], speed, c["T_w2"]), c["T_6"])
        power = washout(
            s, names["washout_4"], washout(s, names["washout_3"], power, c["T_w3"]), c["T_w4"]
        )
        integral = lag(s, names["integral"], power, c["T_7"], c["K_s2"])
        filtered = lead_lag(s, names["ramp_1"], speed + c["K_s3"] * integral, c["T_8"], c["T_9"])
        for k in range(2, 6):
            filtered = lag(s, names[f"ramp_{k}"], filtered, c["T_9"])
        once = lead_lag(s, names["stage_1"], c["K_s1"] * (filtered - integral), c["T_1"], c["T_2"])
        return lead_lag(s, names["stage_2"], once, c["T_3"], c["T_4"])

    def _govern(self, s: Unknowns) -> None:
        """IEEEG1 without its limits; or constant mechanical power."""
        n, g = self.name, {k.removeprefix("governor."): v for k, v in self.data.items()}
        if not g["enabled"]:
            s.equate(s[f"{n}.p_m"], s[f"{n}.P_ref"])
            return
        controller, gate, *turbine = (f"{n}.{k}" for k in _GOVERNOR_STAGES)
        demanded = lead_lag(s, controller, -g["inverse_R"] * (s[f"{n}.w"] - 1), g["T_2"], g["T_1"])
        steam = lag(s, gate, s[f"{n}.P_ref"] + demanded, g["T_3"])
        power = 0.0
        for k, stage in enumerate(turbine):
            steam = lag(s, stage, steam, g[f"T_{4 + k}"])
            power = power + (g[f"K_{1 + 2 * k}"] + g[f"K_{2 + 2 * k}"]) * steam
        s.equate(s[f"{n}.p_m"], power)


_GOVERNOR_STAGES = ("controller", "gate", "chest", "reheater", "crossover", "last")
_STABILISER = ("washout_1", "washout_2", "speed", "washout_3", "washout_4", "integral")
_STABILISER += ("ramp_1", "ramp_2", "ramp_3", "ramp_4", "ramp_5", "stage_1", "stage_2")
