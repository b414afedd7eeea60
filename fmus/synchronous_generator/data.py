"""Data of the machines of both case studies, used as defaults of the models."""

from dataclasses import dataclass

NTS631 = "Norma técnica de supervisión 631 v2.0 (2020), sections 5.9-5.10"
PAPER = "Mateu-Barriendos et al. 2024, appendix, synchronous generator parameters"
STAMP = "STAMP toolbox of the paper's group"


@dataclass(frozen=True)
class MachineData:
    """Standard data on the machine's own rating; times in seconds, everything else per unit but S_n [MVA].

    A digit after the axis counts the primes: ``X_d1`` is X'_d, ``T_d20`` is T''_d0."""

    S_n: float
    P_0: float
    H: float
    X_d: float
    X_q: float
    X_d1: float
    X_q1: float
    X_d2: float
    X_q2: float
    X_l: float
    T_d10: float
    T_d20: float
    T_q10: float
    T_q20: float
    s_10: float
    s_12: float
    R_t: float
    X_t: float
    source: str


SG1 = MachineData(
    S_n=1500, P_0=0.9, H=6.3,
    X_d=2.135, X_q=2.046, X_d1=0.34, X_q1=0.573, X_d2=0.269, X_q2=0.269, X_l=0.234,
    T_d10=6.47, T_d20=0.022, T_q10=0.61, T_q20=0.034,
    s_10=0.1275, s_12=0.2706, R_t=0.0, X_t=0.15, source=NTS631,
)  # fmt: skip

SG2 = MachineData(
    S_n=5000, P_0=0.78, H=6.175,
    X_d=1.8, X_q=1.7, X_d1=0.3, X_q1=0.55, X_d2=0.25, X_q2=0.25, X_l=0.2,
    T_d10=8.0, T_d20=0.03, T_q10=0.4, T_q20=0.05,
    s_10=0.0392, s_12=0.2227, R_t=0.0, X_t=0.15, source=NTS631,
)  # fmt: skip

IEEE118 = MachineData(
    S_n=100, P_0=0.8, H=6.5,
    X_d=1.8, X_q=1.7, X_d1=0.3, X_q1=0.55, X_d2=0.25, X_q2=0.25, X_l=0.2,
    T_d10=8.0, T_d20=0.03, T_q10=0.4, T_q20=0.05,
    s_10=0.0392, s_12=0.2227, R_t=0.002, X_t=0.1,
    source=f"{PAPER}; H: {STAMP}",
)  # fmt: skip


@dataclass(frozen=True)
class GovernorData:
    """IEEEG1: inverse droop [pu], time constants [s] and turbine fractions."""

    inverse_droop: float
    T: tuple[float, float, float, float, float, float, float]
    K: tuple[float, float, float, float, float, float, float, float]
    source: str


IEEEG1_NTS631 = GovernorData(20.0, (0, 0, 0.1, 0.3, 7.0, 0.6, 0), (0.3, 0, 0.3, 0, 0.4, 0, 0, 0), NTS631)
IEEEG1_STAMP = GovernorData(
    20.0, (7.5, 2.8, 0.1, 0.25, 7.5, 7.5, 0.4), (0.22, 0, 0, 0.22, 0.14, 0.14, 0.14, 0.14), STAMP
)
