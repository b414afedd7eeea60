"""A DC line's circuit and control by hand: curves that a root search makes meet, and small steps of Euler's method."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

STEP = 1e-4
"""Step of Euler's method [s]."""

NO_LOAD = 3 * math.sqrt(2) / math.pi
LAG = 0.002
"""Time constant of both lags of a measured bus voltage [s], of which 2·once − twice is what the control sees.

What blocks the line is judged by once."""


def drop(p):
    """Voltage lost by commutation, per current [ohm]."""
    return 3 / math.pi * p["N"] * p["X_c"]


def no_load(p, v):
    """DC voltage without a current at an angle of 0 [kV]."""
    return NO_LOAD * p["N"] * p["E_n"] * v


def reactive(p, v, current, kilovolts):
    """Q that a station draws [Mvar]: the first harmonic of its bridges' current, integrated over its waveform."""
    E = v * p["E_n"]
    cosine = (kilovolts / p["N"] + 3 / math.pi * p["X_c"] * current) / (NO_LOAD * E)
    angle = math.acos(cosine)
    end = math.acos(cosine - math.sqrt(2) * p["X_c"] * current / E)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    at = angle + (end - angle) * (nodes + 1) / 2
    rising = (end - angle) / 2 * weights * (math.cos(angle) - np.cos(at)) / (cosine - math.cos(end))
    falling = (end - angle) / 2 * weights - rising
    third = 2 * math.pi / 3
    flat = (np.exp(-1j * end) - np.exp(-1j * (angle + third))) / 1j
    wave = rising @ np.exp(-1j * at) + flat + falling @ np.exp(-1j * (at + third))
    harmonic = 2 / math.pi * current * wave
    power = 1.5 * math.sqrt(2 / 3) * E * np.exp(-1j * math.pi / 3) * harmonic.conj()
    return p["N"] * power.imag


def curve(points, x):
    """Straight lines through points, level beyond them."""
    if x <= points[0][0]:
        return points[0][1]
    for (a, low), (b, high) in pairwise(points):
        if x < b:
            return low + (high - low) / (b - a) * (x - a)
    return points[-1][1]


def meeting(p, most, far, order, ordered):
    """Current [kA] and inverter's voltage [kV] where both ends' curves meet.

    ``most``: of the rectifier at its least angle [kV]; ``far``: the inverter's at its own, and its drop; ``ordered``:
    the inverter's order at no current [kV], None where it holds its angle."""
    R = p["R_dc"]

    def rectifier(current):
        return most - drop(p) * current

    def inverter(current):
        by_angle = far[0] - far[1] * current
        return by_angle if ordered is None else min(by_angle, ordered - p["RCOMP"] * current)

    reduced = (1 - p["DELTI"]) * order
    if inverter(order) + R * order <= rectifier(order):
        current, kilovolts = order, inverter(order)
    elif inverter(reduced) + R * reduced >= rectifier(reduced):
        current, kilovolts = reduced, rectifier(reduced) - R * reduced
    else:
        current = brentq(lambda x: inverter(x) + R * x - rectifier(x), reduced, order, xtol=1e-14)
        kilovolts = inverter(current)
    short = most / (drop(p) + R)
    return (current, max(kilovolts, 0.0)) if current <= short else (short, 0.0)


@dataclass
class Line:
    """A line with its control; it blocks, bypasses and comes back."""

    p: dict
    v_0: float
    I_0: float = field(init=False)

    def __post_init__(self):
        p, P = self.p, -self.p["P_0"] * self.p["S_n"]
        V, R = p["V_dc_0"], p["R_dc"]
        self.I_0 = (-V + math.sqrt(V**2 + 4 * R * P)) / (2 * R)
        self.V_m, self.I_m, self.once, self.twice = V, self.I_0, self.v_0, self.v_0
        self.since = dict.fromkeys(("blocked", "bypassed", "switched"))
        self.share = {"current": 1.0, "voltage": 1.0}
        cosine = (V + R * self.I_0 + drop(p) * self.I_0) / no_load(p, self.v_0)
        self.cosine = max(math.cos(math.radians(p["ALFDY"])), cosine)

    def order(self):
        """Order of the current [kA]."""
        p, V_r = self.p, self.V_m + self.p["R_dc"] * self.I_m
        start = p["V_dc_0"] + (p["R_dc"] * self.I_0 if p["mode"] == 1 else 0.0)
        power, seen = self.I_0 * start, V_r if p["mode"] == 1 else self.V_m
        asked = power / max(seen, 0.01 * start)
        if self.since["switched"] is not None:
            asked = power / p["VSCHD"]
        if p["mode"] == 0:
            asked = self.I_0
        points = [(p[f"V{k}"], p[f"C{k}"] / 1000) for k in (1, 2, 3)]
        most = curve(points, self.V_m) + max(self.I_0 - curve(points, p["V_dc_0"]), 0.0)
        asked = max(min(asked, most), min(p["C0"] / 1000, self.I_0))
        return min(asked, self.share["current"] * self.I_0) if self.share["current"] < 1 else asked

    def step(self, t, v, far, far_v, holds):
        """Return current [kA], inverter's voltage [kV], and α [rad], and go on by a step.

        ``far``: the inverter's voltage at its least angle, and its drop; ``far_v``: of its bus; ``holds``: its
        voltage."""
        p, seen = self.p, abs(2 * self.once - self.twice)
        comes_back = min(self.share.values()) < 1
        ordered = (p["V_dc_0"] + p["RCOMP"] * self.I_0) * min(self.share["voltage"], 1)
        most = no_load(p, seen) * self.cosine
        held = ordered if holds or comes_back else None
        free = meeting(p, most, far, self.order(), held)
        of_once = no_load(p, abs(self.once)) * self.cosine
        judged = meeting(p, of_once, far, self.order(), held)
        blocked, bypassed = (self.since[x] is not None for x in ("blocked", "bypassed"))
        current, kilovolts = free
        if bypassed:
            current, kilovolts = min(self.order(), most / (drop(p) + p["R_dc"])), 0.0
        if blocked:
            current, kilovolts = 0.0, 0.0
        self._switch(t, abs(self.once), far_v, judged[1], comes_back)
        self._ramp()
        self.V_m += STEP / p["TVDC"] * (kilovolts - self.V_m)
        self.I_m += STEP / p["TIDC"] * (current - self.I_m)
        self.twice += STEP / LAG * (self.once - self.twice)
        self.once += STEP / LAG * (v - self.once)
        V_r = kilovolts + p["R_dc"] * current
        cosine = (V_r + drop(p) * current) / max(no_load(p, seen), 1e-3)
        return current, kilovolts, math.acos(min(cosine, 1.0))

    def _switch(self, t, v, far_v, kilovolts, comes_back):
        p, since = self.p, self.since
        in_service = since["blocked"] is None and not comes_back
        changes = (
            ("blocked", v < p["VBLOCK"], v > p["VUNBL"], "TBLOCK"),
            ("bypassed", in_service and kilovolts < p["VBYPAS"], far_v > p["VUNBY"], "TBYPAS"),
            (
                "switched",
                in_service and bool(p["mode"]) and kilovolts < p["VCMOD"],
                kilovolts > p["VCMOD"],
                "TCMODE",
            ),
        )
        for name, sets, ends, least in changes:
            if since[name] is None:
                since[name] = t if sets else None
            elif not sets and ends and t - since[name] >= p[least]:
                since[name] = None
        if since["blocked"] is not None:
            since["bypassed"] = None

    def _ramp(self):
        p = self.p
        blocked, bypassed = (self.since[x] is not None for x in ("blocked", "bypassed"))
        order = p["V_dc_0"] + p["RCOMP"] * self.I_0
        for name, waits, low, rate in (
            ("current", blocked, p["RSCUR"] / 1000 / self.I_0, p["CRAMP"]),
            ("voltage", blocked or bypassed, p["RSVOLT"] / order, p["VRAMP"]),
        ):
            up = 1.0 if rate <= 0 else min(1.0, self.share[name] + STEP * rate)
            self.share[name] = min(low, 1.0) if waits else up


class DelayedLine(Line):
    """A line that waits before it blocks, bypasses and comes back, by the times of its events."""

    def __post_init__(self):
        super().__post_init__()
        self.began = {}  # what lasts, and since when
        self.changes = []  # names of what went on or off, with their times

    def _lasts(self, t, name, holds, wanted):
        if not holds:
            self.began.pop(name, None)
            return False
        return t - self.began.setdefault(name, t) >= wanted

    def _told(self, t, name, now):
        """Whether a message has arrived, which nothing takes back."""
        if now:
            self.began.setdefault(name, t)
        return name in self.began and t - self.began[name] >= self.p["TCOM"]

    def _switch(self, t, v, far_v, kilovolts, comes_back):
        p, since = self.p, self.since
        before = {name: since[name] is not None for name in ("blocked", "bypassed")}
        if since["blocked"] is None:
            low = self._lasts(t, "low", v < p["VRB"], p["TRB"])
            asked = self._told(t, "asks", far_v < p["VIB"])
            if v < p["VBLOCK"] or low or asked:
                since["blocked"], self.began = t, {}
        else:
            high = self._lasts(t, "high", v >= p["VUNBL"], p["TRUB"])
            far_high = self._lasts(t, "far high", far_v >= p["VUNBY"], p["TIUB"])
            told = self._told(t, "permits", far_high)
            if t - since["blocked"] >= p["TBLOCK"] and high and told:
                since["blocked"], self.began = None, {}
        if since["blocked"] is not None:
            since["bypassed"] = None
        elif since["bypassed"] is None:
            in_service = not comes_back
            low = self._lasts(t, "far low", in_service and far_v < p["VIY"], p["TIY"])
            if in_service and (kilovolts < p["VBYPAS"] or low):
                since["bypassed"] = t
        else:
            may_end = t - since["bypassed"] >= p["TBYPAS"] and far_v > p["VUNBY"]
            if self._lasts(t, "ends", may_end, p["TIUY"]):
                since["bypassed"] = None
                self.began.pop("ends")
        self.changes += [(x, t) for x, was in before.items() if was == (since[x] is None)]
