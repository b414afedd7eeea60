"""Usual ranges of a power system's data. A value outside is questioned, not refused.

The ranges are wide: they find a wrong unit (ms for s, kVA for MVA) or a wrong base, and do not judge data.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Plausible:
    """A range, both ends included."""

    low: float
    high: float
    unit: str  # Unit of the variable. The range does not apply to a variable of the same name in another unit.
    why: str
    or_zero: bool = False  # whether 0 is usual as well, because it switches a part off
    slip: str = ""  # the likely mistake behind a value outside; found from the value where empty

    def fits(self, value: float) -> bool:
        return self.low <= value <= self.high or (self.or_zero and value == 0)


_KUNDUR_H = "Kundur 1994, table 3.2: 2 to 10 s, widened"
_KUNDUR = "Kundur 1994, table 4.2, widened"
_421 = "IEEE 421.5, typical data, widened"
_PSS = "IEEE 421.5, stabilisers, widened"
_GOVERNORS = "IEEE PES-TR1, turbine-governor models, widened"
_DROOP = "governors' droops: 2 to 12 %, widened"
_SATURATION = "usual saturation of machines: 0.02 to 0.3 at 1 pu, 0.1 to 1 at 1.2 pu, widened"
_FILTER = "usual LC filters and transformers of converters"
_CONTROL = "usual time scales of converter control"

_MACHINE = {
    "machine.D": Plausible(-1, 5, "pu", "damping torques: 0 to 3 pu, as more stands for what is modelled here"),
    "machine.H": Plausible(0.5, 15, "s", _KUNDUR_H),
    "machine.R_s": Plausible(0, 0.05, "pu", _KUNDUR),
    "machine.X_l": Plausible(0.02, 0.5, "pu", _KUNDUR),
    "machine.X_d": Plausible(0.3, 4, "pu", _KUNDUR),
    "machine.X_d1": Plausible(0.05, 1, "pu", _KUNDUR),
    "machine.X_d2": Plausible(0.04, 1, "pu", _KUNDUR),
    "machine.X_q": Plausible(0.2, 4, "pu", _KUNDUR),
    "machine.X_q1": Plausible(0.05, 4, "pu", _KUNDUR),
    "machine.X_q2": Plausible(0.04, 4, "pu", _KUNDUR),
    "machine.T_d10": Plausible(0.5, 20, "s", _KUNDUR),
    "machine.T_d20": Plausible(0.005, 0.3, "s", _KUNDUR),
    "machine.T_q10": Plausible(0.05, 10, "s", _KUNDUR),
    "machine.T_q20": Plausible(0.005, 0.4, "s", _KUNDUR),
    "exciter.K_A": Plausible(1, 2000, "pu", _421),
    "exciter.T_A": Plausible(0.001, 1, "s", _421, or_zero=True),
    "exciter.T_R": Plausible(0.001, 0.2, "s", _421, or_zero=True),
    "exciter.T_B": Plausible(0.005, 60, "s", _421, or_zero=True),
    "exciter.T_C": Plausible(0.005, 60, "s", _421, or_zero=True),
    "exciter.K_PR": Plausible(0.01, 300, "pu", _421, or_zero=True),
    "exciter.K_IR": Plausible(0.01, 300, "1/s", _421),
    "exciter.K_P": Plausible(0.5, 20, "pu", _421),
    **{f"pss.{T}": Plausible(0.5, 50, "s", _PSS, or_zero=True) for T in ("T_w1", "T_w2", "T_w3", "T_w4", "T_7")},
    **{f"pss.T_{k}": Plausible(0.005, 10, "s", _PSS, or_zero=True) for k in (1, 2, 3, 4, 6, 8, 9)},
    "pss.K_s1": Plausible(0.01, 100, "pu", _PSS, or_zero=True),
    "pss.limit": Plausible(0.005, 0.5, "pu", _PSS, or_zero=True),
    "exciter.K": Plausible(1, 2000, "pu", _421),
    "exciter.K_C": Plausible(-1, 1, "pu", _421),
    "exciter.K_D": Plausible(0, 2, "pu", _421),
    "exciter.K_E": Plausible(-0.5, 2, "pu", _421),
    "exciter.K_F": Plausible(0, 1, "pu", _421),
    "exciter.K_G": Plausible(0, 2, "pu", _421),
    "exciter.K_LR": Plausible(0, 100, "pu", _421),
    "exciter.K_PM": Plausible(0.01, 300, "pu", _421, or_zero=True),
    "exciter.K_IM": Plausible(0.01, 300, "1/s", _421, or_zero=True),
    "pss.K_S": Plausible(0.01, 100, "pu", _PSS, or_zero=True),
    "pss.K_s2": Plausible(0.005, 5, "pu", _PSS, or_zero=True),
    "pss.K_s3": Plausible(0.1, 10, "pu", _PSS, or_zero=True),
    "governor.inverse_R": Plausible(5, 100, "pu", _GOVERNORS, or_zero=True),
    "governor.R": Plausible(0.005, 0.3, "pu", _DROOP),
    "governor.K": Plausible(3, 200, "pu", f"{_DROOP}; K is 1/droop", or_zero=True),
    **{f"governor.{q}_MAX": Plausible(0.1, 3, "pu", "a turbine's most power is about its rating") for q in "VPG"},
    "governor.r": Plausible(0.05, 5, "pu", "usual temporary droops of hydro governors"),
    "governor.K_T": Plausible(0.2, 10, "1", _GOVERNORS),
    "governor.A_T": Plausible(0.3, 3, "pu", _GOVERNORS),
    "governor.A_t": Plausible(0.5, 3, "1", _GOVERNORS),
    "governor.D_t": Plausible(0, 5, "pu", _GOVERNORS),
    "governor.D_turb": Plausible(0, 5, "pu", _GOVERNORS),
    "governor.q_NL": Plausible(0, 0.5, "pu", _GOVERNORS),
    "governor.T_r": Plausible(0.1, 60, "s", _GOVERNORS),
    "governor.T_f": Plausible(0.005, 10, "s", _GOVERNORS),
    "governor.T_g": Plausible(0.01, 60, "s", _GOVERNORS),
    "governor.T_W": Plausible(0.1, 15, "s", _GOVERNORS),
    "machine.s_10": Plausible(0, 1, "1", _SATURATION),
    "machine.s_12": Plausible(0, 3, "1", _SATURATION),
    **{f"governor.T_{k}": Plausible(0.005, 60, "s", _GOVERNORS, or_zero=True) for k in range(1, 8)},
}

_CONVERTER = {
    "filter.R_c": Plausible(0, 0.1, "pu", _FILTER),
    "filter.X_c": Plausible(0.01, 0.6, "pu", _FILTER),
    "filter.B_c": Plausible(0.01, 0.6, "pu", _FILTER),
    "transformer.R_t": Plausible(0, 0.1, "pu", _FILTER),
    "transformer.X_t": Plausible(0.01, 0.6, "pu", _FILTER, or_zero=True),
    "droop.R_f": Plausible(0.001, 0.3, "pu", "grid codes: 2 to 12 % of rated frequency at rated power", or_zero=True),
    "droop.R_V": Plausible(0.001, 0.5, "pu", "usual voltage droops: 2 to 10 %", or_zero=True),
    "droop.tau_P": Plausible(0.002, 2, "s", _CONTROL),
    "droop.tau_Q": Plausible(0.002, 2, "s", _CONTROL),
    "voltage_control.tau": Plausible(0.002, 0.5, "s", _CONTROL),
    "voltage_control.i_q_max": Plausible(0.5, 5, "pu", "usual current limits: 1 to 3 of the rated current"),
    "voltage_control.i_d_max": Plausible(0.5, 5, "pu", "usual current limits: 1 to 3 of the rated current"),
    "current_control.tau": Plausible(0.0002, 0.02, "s", _CONTROL),
    "feed_forward.tau": Plausible(1e-5, 0.02, "s", _CONTROL),
}

_FOLLOWING = {
    "pll.f_0": Plausible(0.5, 100, "Hz", "PLLs of 1 to 50 Hz, widened"),
    "pll.xi": Plausible(0.2, 3, "1", "PLLs of usual damping"),
    "measurement.tau": Plausible(0.001, 0.2, "s", _CONTROL),
    "active_power.tau": Plausible(0.005, 5, "s", _CONTROL),
    "reactive_power.tau": Plausible(0.005, 5, "s", _CONTROL),
    "reactive_power.R_V": Plausible(0.001, 0.5, "pu", "usual voltage droops: 2 to 10 %"),
    "reactive_power.X_s": Plausible(0.05, 2, "pu", "short-circuit ratios of 0.5 to 20"),
    "frequency_droop.R_f": Plausible(0.002, 0.3, "pu", "grid codes: 2 to 12 % of rated frequency at rated power"),
    "current_limit.I_max": Plausible(0.5, 5, "pu", "usual current limits: 1 to 3 of the rated current"),
}

_REGFM_A1 = {
    "mp": Plausible(0.001, 0.3, "pu", "droops of 0.5 to 10 % of rated frequency; rad/s would be 314 times as much"),
    "mq": Plausible(0.001, 0.5, "pu", "usual voltage droops: 2 to 10 %", or_zero=True),
    "XL": Plausible(0.02, 0.6, "pu", _FILTER),
    "ImaxF": Plausible(0.5, 10, "pu", "usual fault currents: 1 to 3 of the rated current"),
}

_POD = {
    "T_W": Plausible(0.3, 50, "s", "a washout passes 0.1 to 2 Hz"),
    "T_f": Plausible(0.001, 2, "s", "a filter that passes 0.1 to 2 Hz"),
    "T_S1": Plausible(0.001, 10, "s", "a lead that turns 0.1 to 2 Hz", or_zero=True),
    "T_S2": Plausible(0.001, 10, "s", "a lag that turns 0.1 to 2 Hz", or_zero=True),
    "K": Plausible(0, 10_000, "pu", "50 times the paper's 200"),
    "limit": Plausible(0.002, 1.5, "pu", "up to the rating", or_zero=True),
}

_PORT = {
    "S_n": Plausible(0.05, 20_000, "MVA", "from a distribution converter to a whole area"),
    "V_n": Plausible(0.1, 1500, "kV", "from low voltage to 1500 kV"),
    "f_n": Plausible(45, 65, "Hz", "grids have 50 or 60 Hz"),
    "v_0": Plausible(0.8, 1.2, "pu", "operation within 20 % of the rated voltage"),
}

RANGES: dict[str, Plausible] = {
    **_PORT,
    **_MACHINE,
    **_CONVERTER,
    **_FOLLOWING,
    **_REGFM_A1,
    **{f"{pod}.{name}": wanted for pod in ("pod_p", "pod_q") for name, wanted in _POD.items()},
}
"""Ranges by the variable's name inside a component."""

_LINE = "lines and transformers on 100 MVA, from 20 kV cables to tie lines"
LINE_X = Plausible(1e-5, 10, "pu", _LINE, slip="in ohms or in percent")
LINE_B = Plausible(0, 10, "pu", _LINE)
LINE_RATIO = Plausible(0.6, 1.6, "1", "tap changers and off-nominal ratios")
COMPENSATION = Plausible(0.05, 0.9, "1", "series capacitors take 20 to 80 % of a line's reactance, widened")
STRAY_B = Plausible(0, 1, "pu", "a stray capacitance is small")
MOST_R_OVER_X = 5.0  # largest usual R/X of a line; low-voltage cables come near it
SMALLEST_SHARE = 1e-3  # smallest usual rating of a unit, as a part of the largest unit's rating in the same network
