"""Records of WECC's generic plants a second time, as plain numbers, at a source behind an impedance.

Written from the block diagrams that the leaflet names; it shares nothing with `fmus.wecc_renewable`, and knows the
terminal voltage of the same instant. Values are by record and field, as DYR files name them. Dips, tables and limits
do not act here."""

import numpy as np

from tests.models import by_hand


class Hand:
    """A plant of some records.

    ``values``: by record, then field; ``flow``: P, Q and |v| at the operating point [pu]; ``Z``: the network's [pu]."""

    def __init__(self, values, flow, Z):
        self.values, self.Z = values, Z
        self.P_0, self.Q_0, self.v_0 = self.flow = flow
        self.converter = next(name for name in values if name.startswith("REGC"))
        self.control = next(name for name in values if name.startswith("REEC"))
        i = (self.P_0 - 1j * self.Q_0) / self.v_0
        self.source = abs(self.v_0 - Z * i)
        self.frame_0 = -np.angle(self.v_0 - Z * i)  # of the terminal, to the source
        self.x = self.start(i)

    def start(self, i):
        g, e = self.values[self.converter], self.values[self.control]
        x = {"Ip": i.real, "Iq": -i.imag, "v": self.v_0, "Pord": self.P_0, "PIV": -i.imag}
        x |= {"PIQ": self.held(self.v_0, self.P_0, self.Q_0), "Iq_ref": self.Q_0 / self.v_0}
        if g.get("RateFlag"):
            x |= {"Ip": self.P_0, "v_rate": self.v_0}
        if self.converter != "REGCA1":
            emf = self.v_0 + complex(g["Re"], g["Xe"]) * i
            x |= {"Ed": emf.real, "Eq": emf.imag}
        if self.converter == "REGCC1":
            x |= {"delta": self.frame_0, "pll": 0.0, "loop_p": i.real, "loop_q": -i.imag}
        if self.control == "REECC1":
            x |= {"soc": e["SOCini"]}
        if self.control == "REECD1":
            x |= {"v_comp": self.held(self.v_0, self.P_0, self.Q_0)}
        if "WTDTA1" in self.values:
            w = self.speed_of(self.P_0)
            x |= {"w_t": w, "w_g": w, "twist": self.P_0 / w, "P_f": self.P_0, "w_ref": w}
            x |= {"torque": self.P_0 / w, "pitch_w": self.values["WTARA1"]["Theta0"]}
            x |= {"theta": self.values["WTARA1"]["Theta0"]}
        return x

    def speed_of(self, P):
        t = self.values["WTTQA1"]
        points = [1, 2, 3, 4]
        return np.interp(P, [t[f"P{k}"] for k in points], [t[f"Spd{k}"] for k in points])

    def held(self, v, P, Q):
        """Voltage that is controlled."""
        e = self.values[self.control]
        if self.control != "REECD1":
            return v
        if e["VCMPFLAG"]:
            return abs(v - complex(e["Rc"], e["Xc"]) * (P - 1j * Q) / v)
        return v + e["Kc"] * Q

    def at_network(self, x, source):
        """|v|, P, Q; in the PLL's frame the voltage, and the current there."""
        g, Z = self.values[self.converter], self.Z
        if self.converter == "REGCA1":
            drop = Z * complex(x["Ip"], -x["Iq"])
            v = drop.real + np.sqrt(source**2 - drop.imag**2)
            return v, v * x["Ip"], v * x["Iq"], v, None
        emf, inner = complex(x["Ed"], x["Eq"]), complex(g["Re"], g["Xe"])
        if self.converter == "REGCC1":
            turn = np.exp(1j * x["delta"])
            v = (source / Z + emf * turn / inner) / (1 / Z + 1 / inner)
            i = (emf * turn - v) / inner
            s = v * np.conj(i)
            return abs(v), s.real, s.imag, v / turn, i / turn
        a, b = 1 + Z / inner, Z * emf / inner  # |a·|v| − b| = |source|
        middle = (a.conjugate() * b).real / abs(a) ** 2
        v = middle + np.sqrt(middle**2 - (abs(b) ** 2 - source**2) / abs(a) ** 2)
        i = (emf - v) / inner
        return v, v * i.real, -v * i.imag, v, i

    def rates(self, x, source=None):
        v, P, Q, inside, i = self.at_network(x, self.source if source is None else source)
        r = self.of_turbine(x, P) if "WTDTA1" in self.values else {}
        Ip, Iq, more = self.of_control(x, v, P, Q)
        return r | more | self.of_converter(x, Ip, Iq, inside, i)

    def of_converter(self, x, Ip, Iq, inside, i):
        g = self.values[self.converter]
        r, by = {}, 1.0
        if g.get("RateFlag"):
            r["v_rate"], by = (abs(inside) - x["v_rate"]) / g["Tfltr"], x["v_rate"]
        r |= {"Ip": (Ip * by - x["Ip"]) / g["Tg"], "Iq": (Iq - x["Iq"]) / g["Tg"]}
        if self.converter == "REGCA1":
            return r
        active, reactive = x["Ip"] / by, x["Iq"]
        if self.converter == "REGCC1":
            errors = active - i.real, reactive + i.imag
            active, reactive = (
                g["Kip"] * error + x[loop]
                for error, loop in zip(errors, ("loop_p", "loop_q"), strict=True)
            )
            r |= {"loop_p": g["Kii"] * errors[0], "loop_q": g["Kii"] * errors[1]}
            r |= {"pll": inside.imag, "delta": g["Kppll"] * inside.imag + g["Kipll"] * x["pll"]}
        emf = inside + complex(g["Re"], g["Xe"]) * complex(active, -reactive)
        return r | {
            "Ed": (emf.real - x["Ed"]) / g["Te"],
            "Eq": (emf.imag - x["Eq"]) / g["Te"],
        }

    def of_control(self, x, v, P, Q):
        e = self.values[self.control]
        r = {"v": (v - x["v"]) / e["Trv"]}
        seen = x["v"]
        if self.control == "REECD1":
            r["v_comp"] = (self.held(v, P, Q) - x["v_comp"]) / e["Tr1"]
            seen = x["v_comp"]
        if self.control == "REECC1":
            r["soc"] = -(P - self.P_0) / e["T"]
        held = self.held(self.v_0, self.P_0, self.Q_0)
        r["PIQ"] = e["Kqi"] * (self.Q_0 - Q) if e["QFLAG"] and e["VFLAG"] else 0.0
        wanted = x["PIQ"] + e["Kqp"] * (self.Q_0 - Q) if e["VFLAG"] else held
        r["PIV"] = e["Kvi"] * (wanted - seen) if e["QFLAG"] else 0.0
        r["Iq_ref"] = 0.0 if e["QFLAG"] else (self.Q_0 / x["v"] - x["Iq_ref"]) / e["Tiq"]
        Iq = x["PIV"] + e["Kvp"] * (wanted - seen) if e["QFLAG"] else x["Iq_ref"]
        Iq += e["Kqv"] * (self.v_0 - x["v"])
        r["Pord"] = (self.asked(x, P) - x["Pord"]) / e["Tpord"]
        return x["Pord"] / x["v"], Iq, r

    def asked(self, x, P):
        """Power that is asked for."""
        if "WTDTA1" not in self.values:
            return self.P_0
        t = self.values["WTTQA1"]
        return (x["torque"] + t["Kpp"] * self.torque_error(x)) * x["w_g"]

    def torque_error(self, x):
        by_power = (self.P_0 - x["P_f"]) / x["w_g"]
        return by_power if self.values["WTTQA1"]["Tflag"] else x["w_g"] - x["w_ref"]

    def of_turbine(self, x, P):
        d, a = self.values["WTDTA1"], self.values["WTARA1"]
        p, t = self.values["WTPTA1"], self.values["WTTQA1"]
        Ht = d["Htfrac"] * d["H"]
        Hg = d["H"] - Ht
        between, w_0 = x["w_t"] - x["w_g"], self.speed_of(self.P_0)
        P_m = self.P_0 - a["Ka"] * x["theta"] * (x["theta"] - a["Theta0"])
        through = x["twist"] + d["Dshaft"] * between
        braking = P / x["w_g"] + d["DAMP"] * (x["w_g"] - w_0)
        error = x["w_t"] - x["w_ref"] + p["Kcc"] * (x["Pord"] - self.P_0)
        wanted = x["pitch_w"] + p["Kpw"] * error
        return {
            "w_t": (P_m / x["w_t"] - through) / (2 * Ht),
            "w_g": (through - braking) / (2 * Hg),
            "twist": 2 * Ht * Hg / d["H"] * (2 * np.pi * d["Freq1"]) ** 2 * between,
            "P_f": (P - x["P_f"]) / t["Tp"],
            "w_ref": (self.speed_of(x["P_f"]) - x["w_ref"]) / t["Twref"],
            "torque": t["Kip"] * self.torque_error(x),
            "pitch_w": p["Kiw"] * error,
            "theta": (wanted - x["theta"]) / p["Tp"],
        }

    def eigenvalues(self, h=1e-7):
        """Of the plant at its source [1/s]."""
        return by_hand.eigenvalues(self.rates, self.x, h)

    def run(self, source, until, step):
        """|v| at every step after the source has jumped, by Runge and Kutta's method."""
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            found.append(self.at_network(x, source)[0])
            x = by_hand.stepped(lambda at: self.rates(at, source), x, step)
        return np.array(found)
