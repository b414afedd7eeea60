"""REGCA1, REECB1 and REPCA1 a second time, as plain numbers, at a voltage behind an impedance.

Written from the block diagrams of WECC's specifications; it shares nothing with `fmus.wecc_renewable`. Fields are those
of the DYR records."""

import numpy as np

from orchestrator.cases.networks.psse.dyr_file import read_dyr

NAMES = {
    "REGCA1": "Lvplsw Tg Rrpwr Brkpt Zerox Lvpl1 Volim Lvpnt1 Lvpnt0 Iolim Tfltr Khv Iqrmax Iqrmin Accel",
    "REECB1": "BUSR PF V Q PQ Vdip Vup Trv dbd1 dbd2 Kqv Iqh1 Iql1 Vref0 Tp QMax QMin VMAX VMIN Kqp Kqi Kvp Kvi "
    "Tiq dPmax dPmin PMAX PMIN Imax Tpord",
    "REPCA1": "BUSR BUS1 BUS2 CKT VC Ref F Tfltr Kp Ki Tft Tfv Vfrz Rc Xc Kc emax emin dbd1 dbd2 Qmax Qmin Kpg Kig "
    "Tp fdbd1 fdbd2 femax femin Pmax Pmin Tg Ddn Dup",
}


def fields(path):
    """Values by field, of each record of a plant by its name."""
    return {
        record.name: dict(zip(NAMES[record.name].split(), map(float, record.values), strict=True))
        for record in read_dyr(path)
        if record.name in NAMES
    }


def band(u, low, high):
    return max(u - high, 0.0) + min(u - low, 0.0)


def controller(x, error, gains, limits):
    """Output of a proportional-integral controller, and its integrator's rate."""
    u = gains[0] * error + x
    stopped = (u > limits[1] and error > 0) or (u < limits[0] and error < 0)
    return np.clip(u, *limits), 0.0 if stopped else gains[1] * error


class Plant:
    """A plant at its own terminal, whose frequency stays the rated one, without dips and logic for low voltages."""

    def __init__(self, records, P, Q, v):
        self.g, self.e, self.p = (records[name] for name in NAMES)
        self.start = (P, Q, v)
        controls_voltage = self.e["Q"] and not self.e["V"]
        reference = v if controls_voltage else Q
        self.x = {"Ip": P / v, "Iq": Q / v, "v": v, "P": P, "PIQ": v, "PIV": Q / v}
        self.x |= {
            "Iq_ref": reference / v,
            "Pord": P,
            "V_plant": self.regulated(v, Q),
            "Q_plant": Q,
        }
        self.x |= {"PI": reference, "lead": reference, "P_plant": P, "PIP": P, "Pref": P}

    def regulated(self, v, Q):
        assert self.p["Rc"] == self.p["Xc"] == self.p["Ddn"] * self.p["Dup"] == 0
        assert self.g["Khv"] == self.g["Lvplsw"] == 0
        return v if self.p["VC"] else v + self.p["Kc"] * Q

    def voltage(self, x, source, Z):
        """Magnitude of the terminal voltage behind a source and an impedance."""
        drop = Z * complex(x["Ip"], -x["Iq"])
        return drop.real + np.sqrt(abs(source) ** 2 - drop.imag**2)

    def rates(self, x, source, Z):
        v = self.voltage(x, source, Z)
        P, Q = v * x["Ip"], v * x["Iq"]
        P_ref, Q_ref, rates = self.of_plant(x, v, P, Q)
        return rates | self.of_control(x, (v, P, Q), P_ref, Q_ref)

    def of_plant(self, x, v, P, Q):
        """References that the plant sets, and the rates of its states."""
        p, (P_0, Q_0, v_0), r = self.p, self.start, {}
        r["V_plant"] = (self.regulated(v, Q) - x["V_plant"]) / p["Tfltr"]
        r["Q_plant"] = (Q - x["Q_plant"]) / p["Tfltr"]
        held = self.regulated(v_0, Q_0)
        error = band(held - x["V_plant"] if p["Ref"] else Q_0 - x["Q_plant"], p["dbd1"], p["dbd2"])
        gains, limits = (p["Kp"], p["Ki"]), (p["Qmin"], p["Qmax"])
        y, r["PI"] = controller(x["PI"], np.clip(error, p["emin"], p["emax"]), gains, limits)
        r["lead"] = (y - x["lead"]) / p["Tfv"]
        r["P_plant"] = (P - x["P_plant"]) / p["Tp"]
        error, limits = np.clip(P_0 - x["P_plant"], p["femin"], p["femax"]), (p["Pmin"], p["Pmax"])
        y_P, r["PIP"] = controller(x["PIP"], error, (p["Kpg"], p["Kig"]), limits)
        r["Pref"] = (y_P - x["Pref"]) / p["Tg"]
        return x["Pref"] if p["F"] else P_0, x["lead"] + p["Tft"] * r["lead"], r

    def of_control(self, x, seen, P_ref, Q_ref):
        """Rates of the electrical control and of the currents."""
        g, e, (P_0, Q_0, v_0), (v, P, Q) = self.g, self.e, self.start, seen
        r = {"v": (v - x["v"]) / e["Trv"], "P": (P - x["P"]) / e["Tp"]}
        asked = Q_0 / P_0 * x["P"] if e["PF"] else Q_ref
        error, limits = np.clip(asked, e["QMin"], e["QMax"]) - Q, (e["VMIN"], e["VMAX"])
        of_power, r["PIQ"] = controller(x["PIQ"], error, (e["Kqp"], e["Kqi"]), limits)
        error = (of_power if e["V"] else np.clip(asked, *limits)) - x["v"]
        first = np.clip(x["Pord"] / x["v"], 0, e["Imax"])
        most = np.sqrt(e["Imax"] ** 2 - first**2) if e["PQ"] else e["Imax"]
        of_voltage, r["PIV"] = controller(x["PIV"], error, (e["Kvp"], e["Kvi"]), (-most, most))
        r["Iq_ref"] = (asked / x["v"] - x["Iq_ref"]) / e["Tiq"]
        extra = e["Kqv"] * band((e["Vref0"] or v_0) - x["v"], e["dbd1"], e["dbd2"])
        Iq = (of_voltage if e["Q"] else x["Iq_ref"]) + np.clip(extra, e["Iql1"], e["Iqh1"])
        Iq = np.clip(Iq, -most, most)
        Ip = first if e["PQ"] else np.clip(first, 0, np.sqrt(e["Imax"] ** 2 - Iq**2))
        r["Pord"] = np.clip((P_ref - x["Pord"]) / e["Tpord"], e["dPmin"], e["dPmax"])
        r["Ip"] = min((Ip - x["Ip"]) / g["Tg"], g["Rrpwr"])
        r["Iq"] = (Iq - x["Iq"]) / g["Tg"]
        return r

    def run(self, source, Z, until, step):
        """Magnitude of the voltage at every step, by Heun's method."""
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            found.append(self.voltage(x, source, Z))
            first = self.rates(x, source, Z)
            then = self.rates({name: x[name] + step * first[name] for name in first}, source, Z)
            x = {name: x[name] + step / 2 * (first[name] + then[name]) for name in first}
        return np.array(found)
