"""Compensators' equations written out by hand, with small steps of Euler's method: no block of ours is in them."""

import math

STEP = 4e-5
"""Step of Euler's method [s]."""


LAG = 0.002
"""Time constant of both lags of the measured voltage [s], of which 2·once − twice is what the control sees."""


class _Measured:
    """The bus voltage as the models measure it."""

    def __init__(self, voltage):
        self.voltage = voltage
        self.once = self.twice = voltage(0.0)

    def at(self, step):
        seen = 2 * self.once - self.twice
        self.twice += STEP / LAG * (self.once - self.twice)
        self.once += STEP / LAG * (self.voltage(step * STEP) - self.once)
        return seen


class _LeadLag:
    """(1+s·T_lead)/(1+s·T_lag) by the state x = u − y·(…), as textbooks have it; T_lag > 0."""

    def __init__(self, lead, lag, start):
        self.ratio, self.lag = lead / lag, lag
        self.x = (1 - self.ratio) * start

    def output(self, u):
        y = self.x + self.ratio * u
        self.x += STEP / self.lag * ((1 - self.ratio) * u - self.x)
        return y


def sampled(values, times):
    """Values, one a step, at times [s]."""
    return [values[round(time / STEP) - 1] for time in times]


def csvgn5(p, voltage, times):
    """Susceptance [pu] at times [s], rising; ``voltage``: of the bus [pu] by time."""
    B = p["Q_0"] / p["v_0"] ** 2
    reference = p["v_0"] + B / p["Ksvs"]
    seen = p["v_0"]
    first, second = (
        _LeadLag(p[lead], p[lag], B / p["Ksvs"]) for lead, lag in (("Ts2", "Ts3"), ("Ts4", "Ts5"))
    )
    measured, found = _Measured(voltage), []
    for k in range(round(times[-1] / STEP)):
        error = reference - seen
        seen += STEP / p["Ts1"] * (measured.at(k) - seen)
        within = min(max(error, -p["Vemax"]), p["Vemax"])
        asked = p["Ksvs"] * second.output(first.output(within))
        if error > p["DV"]:
            asked = p["Bpmax"] + p["Ksd"] * (error - p["DV"])
        elif error < -p["DV"]:
            asked = p["Bpmin"]
        B = min(max(B + STEP / p["Ts6"] * (asked - B), p["Bmin"]), p["Bmax"])
        found.append(B)
    return sampled(found, times)


def cstatt(p, voltage, times):
    """Current [pu, above 0 capacitive] at times [s], rising."""
    current = p["Q_0"] / p["v_0"]
    E = p["v_0"] + p["Xt"] * current
    reference = p["v_0"] + p["DROOP"] * current
    first, second = (_LeadLag(p[lead], p[lag], 0) for lead, lag in (("T1", "T3"), ("T2", "T4")))
    measured, found = _Measured(voltage), []
    for k in range(round(times[-1] / STEP)):
        v = measured.at(k)
        share = min(v / p["VCUTOFF"], 1)
        high = min(v + p["Xt"] * p["ICMAX"] * share, p["ELIMIT"])
        low = v - p["Xt"] * p["ILMAX"] * share
        E = min(max(E, low), high)
        current = (E - v) / p["Xt"]
        found.append(current)
        moved = second.output(first.output(reference - v - p["DROOP"] * current))
        E += STEP * p["K"] * min(max(moved, p["VMIN"]), p["VMAX"])
    return sampled(found, times)


def svsmo1(p, voltage, times):
    """Susceptance [pu] at times [s], rising; without the slow control and with one slope."""
    B = p["Q_0"] / p["v_0"] ** 2
    reference = p["v_0"] + p["Xc1"] * B * p["v_0"]
    seen, x, acts, near, above = p["v_0"], B, False, 0.0, 0.0
    measured, found = _Measured(voltage), []
    for k in range(round(times[-1] / STEP)):
        v = measured.at(k)
        raw = reference - seen - p["Xc1"] * B * v
        seen += STEP / p["Tb1"] * (v - seen)
        if p["Vdbd1"]:
            near = near + STEP if acts and abs(raw) < p["Vdbd2"] else 0.0
            acts = abs(raw) > p["Vdbd1"] or (acts and near < p["Tdbd"])
        error = raw if acts or not p["Vdbd1"] else 0.0
        error = min(max(error, p["Vemin"]), p["Vemax"])
        wanted = p["Kpv"] * error + x
        above = above + STEP if wanted > p["Bmax"] else 0.0
        high = p["Bmax"] if above >= p["Tshrt"] else p["Bshrt"]
        if p["Bmin"] <= wanted <= high or (wanted - high) * error < 0:
            x += STEP * p["Kiv"] * error
        asked = min(max(wanted, p["Bmin"]), high)
        B = min(max(B + STEP / p["T2"] * (asked - B), p["Bmin"]), high)
        found.append(B)
    return sampled(found, times)


def swell(size, before, rate, begin):
    """A voltage that moves from ``before`` to ``size`` [pu], at a rate [pu/s] from a time on [s]."""

    def at(time):
        moved = min(max(time - begin, 0.0) * rate, abs(size - before))
        return before + math.copysign(moved, size - before)

    return at
