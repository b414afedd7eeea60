"""Usual ranges of machines, exciters, stabilisers, governors and turbines, by the parameter's full name."""

from fmus.toolchain.port_variables import TRANSFORMER
from fmus.toolchain.variables import Usual

_KUNDUR_H = "Kundur 1994, table 3.2: 2 to 10 s, widened"
_KUNDUR = "Kundur 1994, table 4.2, widened"
_421 = "IEEE 421.5, typical data, widened"
_PSS = "IEEE 421.5, stabilisers, widened"
_GOVERNORS = "IEEE PES-TR1, turbine-governor models, widened"
_DROOP = "governors' droops: 2 to 12 %, widened"
_SATURATION = "usual saturation of machines: 0.02 to 0.3 at 1 pu, 0.1 to 1 at 1.2 pu, widened"

MACHINE = {
    **TRANSFORMER, "machine.D": Usual(-1, 5, "damping torques: 0 to 3 pu, as more stands for what is modelled here"),
    "machine.H": Usual(0.5, 15, _KUNDUR_H), "machine.R_s": Usual(0, 0.05, _KUNDUR),
    "machine.X_l": Usual(0.02, 0.5, _KUNDUR), "machine.X_d": Usual(0.3, 4, _KUNDUR),
    "machine.X_d1": Usual(0.05, 1, _KUNDUR), "machine.X_d2": Usual(0.04, 1, _KUNDUR),
    "machine.X_q": Usual(0.2, 4, _KUNDUR), "machine.X_q1": Usual(0.05, 4, _KUNDUR),
    "machine.X_q2": Usual(0.04, 4, _KUNDUR), "machine.T_d10": Usual(1, 20, _KUNDUR),
    "machine.T_d20": Usual(0.005, 0.3, _KUNDUR), "machine.T_q10": Usual(0.05, 10, _KUNDUR),
    "machine.T_q20": Usual(0.005, 0.4, _KUNDUR), "exciter.K_A": Usual(1, 2000, _421),
    "exciter.T_A": Usual(0.001, 15, f"{_421}; a lead of SEXS, or an amplifier", or_zero=True),
    "exciter.T_R": Usual(0.001, 0.2, _421, or_zero=True),
    "exciter.T_B": Usual(0.005, 60, _421, or_zero=True), "exciter.T_C": Usual(0.005, 60, _421, or_zero=True),
    "exciter.K_PR": Usual(0.01, 300, _421, or_zero=True), "exciter.K_IR": Usual(0.01, 300, _421),
    "exciter.T_E": Usual(0.001, 5, _421, or_zero=True), "exciter.K_P": Usual(0.5, 20, _421),
    **{f"pss.{T}": Usual(0.5, 50, _PSS, or_zero=True) for T in ("T_w1", "T_w2", "T_w3", "T_w4", "T_7")},
    **{f"pss.T_{k}": Usual(0.005, 10, _PSS, or_zero=True) for k in (1, 2, 3, 4, 6, 8, 9)},
    "pss.K_s1": Usual(0.01, 100, _PSS, or_zero=True), "pss.limit": Usual(0.005, 0.5, _PSS, or_zero=True),
    "exciter.K": Usual(1, 2000, _421), "exciter.K_C": Usual(-1, 1, _421), "exciter.K_D": Usual(0, 2, _421),
    "exciter.K_E": Usual(-0.5, 2, _421), "exciter.K_F": Usual(0, 1, _421), "exciter.K_G": Usual(0, 2, _421),
    "exciter.K_LR": Usual(0, 100, _421), "exciter.K_PM": Usual(0.01, 300, _421, or_zero=True),
    "exciter.K_IM": Usual(0.01, 300, _421, or_zero=True), "pss.K_S": Usual(0.01, 100, _PSS, or_zero=True),
    "pss.K_s2": Usual(0.005, 5, _PSS, or_zero=True), "pss.K_s3": Usual(0.1, 10, _PSS, or_zero=True),
    "governor.inverse_R": Usual(5, 100, _GOVERNORS, or_zero=True), "governor.R": Usual(0.01, 0.3, _DROOP),
    "governor.K": Usual(3, 200, f"{_DROOP}; K is 1/droop", or_zero=True),
    **{f"governor.{q}_MAX": Usual(0.1, 3, "a turbine's most power is about its rating") for q in "VPG"},
    "governor.r": Usual(0.05, 5, "usual temporary droops of hydro governors"),
    "governor.K_T": Usual(0.2, 10, _GOVERNORS), "governor.A_T": Usual(0.3, 3, _GOVERNORS),
    "governor.A_t": Usual(0.5, 3, _GOVERNORS), "governor.D_t": Usual(0, 5, _GOVERNORS),
    "governor.D_turb": Usual(0, 5, _GOVERNORS), "governor.q_NL": Usual(0, 0.5, _GOVERNORS),
    "governor.T_r": Usual(0.1, 60, _GOVERNORS), "governor.T_f": Usual(0.005, 10, _GOVERNORS),
    "governor.T_g": Usual(0.01, 60, _GOVERNORS), "governor.T_W": Usual(0.1, 15, _GOVERNORS),
    "machine.s_10": Usual(0, 1, _SATURATION), "machine.s_12": Usual(0, 3, _SATURATION),
    **{f"governor.T_{k}": Usual(0.005, 60, _GOVERNORS, or_zero=True) for k in range(1, 8)},
}  # fmt: skip
