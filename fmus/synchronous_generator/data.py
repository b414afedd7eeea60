"""Data of the machines of both case studies, used as defaults of the models."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


@dataclass(frozen=True)
class GovernorData:
    """IEEEG1: inverse droop [pu], time constants [s] and turbine fractions."""

    inverse_droop: float
    T: tuple[float, float, float, float, float, float, float]
    K: tuple[float, float, float, float, float, float, float, float]
    source: str


def _data(name: str) -> dict[str, Any]:
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))[name]
    return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}


SG1, SG2, IEEE118 = (MachineData(**_data(name)) for name in ("SG1", "SG2", "IEEE118"))
IEEEG1_NTS631, IEEEG1_STAMP = (
    GovernorData(**_data(name)) for name in ("IEEEG1_NTS631", "IEEEG1_STAMP")
)
