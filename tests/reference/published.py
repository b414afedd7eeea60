"""The two published examples as their books have them: Kundur's 12.6, and the WSCC system of Sauer and Pai."""

import math
from dataclasses import replace

from tests.reference.multi_machine import Branch, Commutator, Load, Machine, System, Thyristor

KUNDUR_EXCITERS = {
    "manual": None,
    "thyristor": Thyristor(),
    "tgr": Thyristor(T_A=1.0, T_B=10.0),
    "pss": Thyristor(K_STAB=20.0),
    "tgr_pss": Thyristor(T_A=1.0, T_B=10.0, K_STAB=20.0),
}


def kundur(
    scenario: str, *, active: float = 1.0, saturation: bool = True, stray_B: float = 0.0, **more
) -> System:
    """Example 12.6; active power in proportion to |v|^active (the book: constant current), reactive to |v|²."""
    short, long = (0.0025, 0.025, 0.04375), (0.001, 0.01, 0.0175)
    tie = (0.011, 0.11, 0.1925)
    lines = [
        (5, 6, short),
        (6, 7, long),
        (7, 8, tie),
        (7, 8, tie),
        (8, 9, tie),
        (8, 9, tie),
        (9, 10, long),
        (10, 11, short),
    ]
    transformers = [(1, 5), (2, 6), (3, 11), (4, 10)]
    data = {
        "base": 900.0,
        "X_d": 1.8,
        "X_q": 1.7,
        "X_d1": 0.3,
        "X_q1": 0.55,
        "X_d2": 0.25,
        "X_l": 0.2,
        "R_a": 0.0025,
        "T_d10": 8.0,
        "T_q10": 0.4,
        "T_d20": 0.03,
        "T_q20": 0.05,
    }
    if saturation:
        data |= {"S_10": 0.0392, "S_12": 0.2227}
    return System(
        buses=11,
        branches=(
            *(Branch(a, b, 0.0, 0.15 / 9) for a, b in transformers),
            *(Branch(a, b, *values) for a, b, values in lines),
        ),
        shunts={7: 2.0, 9: 3.5} | (dict.fromkeys((1, 2, 3, 4), stray_B) if stray_B else {}),
        loads=(Load(7, 9.67, 1.0, active), Load(9, 17.67, 1.0, active)),
        machines=tuple(
            Machine(bus=bus, P=P, V=V, H=H, **data)
            for bus, P, V, H in (
                (1, 7.0, 1.03, 6.5),
                (2, 7.0, 1.01, 6.5),
                (3, 7.19, 1.03, 6.175),
                (4, 7.0, 1.01, 6.175),
            )
        ),
        slack=3,
        exciter=KUNDUR_EXCITERS[scenario],
        **more,
    )


def exponential(E: float) -> float:
    """S_E of the WSCC system's exciters."""
    return 0.0039 * math.exp(1.555 * E)


def quadratic(E: float) -> float:
    """The same through E = 1 and 2, as S_E·E = B·(E − A)², which stability programs have."""
    low, high = exponential(1.0), 2 * exponential(2.0)
    ratio = math.sqrt(low / high)
    A = (1 - 2 * ratio) / (1 - ratio)
    return high / (2 - A) ** 2 * max(E - A, 0) ** 2 / E


def wscc9(*, exponent: float = 0.0, saturation=exponential, stray_B: float = 0.0, **more) -> System:
    """Three machines of fourth order; loads in proportion to |v|^exponent (the book: constant power)."""
    data = (
        (1, 0.7164, 1.04, 23.64, 0.146, 0.0969, 0.0608, 0.0969, 8.96, 0.31),
        (2, 1.63, 1.025, 6.4, 0.8958, 0.8645, 0.1198, 0.1969, 6.0, 0.535),
        (3, 0.85, 1.025, 3.01, 1.3125, 1.2578, 0.1813, 0.25, 5.89, 0.6),
    )
    return System(
        buses=9,
        branches=(
            Branch(1, 4, 0, 0.0576),
            Branch(2, 7, 0, 0.0625),
            Branch(3, 9, 0, 0.0586),
            Branch(4, 5, 0.01, 0.085, 0.176),
            Branch(4, 6, 0.017, 0.092, 0.158),
            Branch(5, 7, 0.032, 0.161, 0.306),
            Branch(6, 9, 0.039, 0.17, 0.358),
            Branch(7, 8, 0.0085, 0.072, 0.149),
            Branch(8, 9, 0.0119, 0.1008, 0.209),
        ),
        shunts=dict.fromkeys((1, 2, 3), stray_B) if stray_B else {},
        loads=tuple(
            Load(k, P, Q, exponent, exponent)
            for k, P, Q in ((5, 1.25, 0.5), (6, 0.9, 0.3), (8, 1.0, 0.35))
        ),
        machines=tuple(
            Machine(bus, 100.0, P, V, H, X_d, X_q, X_d1, X_q1, T_d10, T_q10)
            for bus, P, V, H, X_d, X_q, X_d1, X_q1, T_d10, T_q10 in data
        ),
        slack=1,
        exciter=Commutator(saturation),
        **more,
    )


def with_subtransients(system: System) -> System:
    """The WSCC system with machines of sixth order, X'' = 0.8·X'_d and X_l = 0.5·X'_d: to compare programs with."""
    machines = tuple(
        replace(m, X_d2=0.8 * m.X_d1, X_l=0.5 * m.X_d1, T_d20=0.03, T_q20=0.05)
        for m in system.machines
    )
    return replace(system, machines=machines)
