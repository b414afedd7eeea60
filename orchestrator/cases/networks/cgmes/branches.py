"""Branches of pypowsybl in ohm and siemens as branches of MATPOWER in pu.

pypowsybl's branch has an ideal ratio ρ·e^{jα} = V'/V at its first side; what lies behind it, in ohm, is a π section. In
pu of the second side's nominal voltage the ratio of MATPOWER's convention, v' = v/t, is t = (Vn2/Vn1)/(ρ·e^{jα}). A
line is the same with ρ = 1. A transformer of three windings is three such branches to a star bus at its rated_u0."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

BASE_MVA = 100.0  # power base [MVA] of the tables that are made


@dataclass(frozen=True, slots=True)
class Branch:
    name: str
    start: str
    end: str
    z: complex  # series impedance [pu]
    # admittances behind the ratio at the first side, and at the second side [pu]
    to_earth: tuple[complex, complex]
    # tap, shift: MATPOWER's ratio, and its angle [degrees]
    tap: float
    shift: float


def branch(
    name: str,
    ends: tuple[str, str],
    nominal: tuple[float, float],
    z: complex,
    to_earth: tuple[complex, complex] = (0j, 0j),
    rho: float = 1.0,
    alpha: float = 0.0,
) -> Branch:
    first, second = nominal
    base = second**2 / BASE_MVA
    return Branch(
        name,
        *ends,
        z / base,
        (to_earth[0] * base, to_earth[1] * base),
        second / first / rho,
        -alpha if alpha else 0.0,
    )


def lines(network: Any, nominal: dict[str, float]) -> Iterator[Branch]:
    for row in network.get_lines(all_attributes=True).itertuples():
        ends = row.bus1_id, row.bus2_id
        if row.connected1 and row.connected2 and all(end in nominal for end in ends):
            y = complex(row.g1, row.b1), complex(row.g2, row.b2)
            yield _shorter(
                branch(
                    row.Index, ends, (nominal[ends[0]], nominal[ends[1]]), complex(row.r, row.x), y
                )
            )


def _shorter(line: Branch) -> Branch:
    """A line between two nominal voltages has a ratio in pu. Where the same two-port without a ratio has smaller
    admittances to earth, the line stands for a transformer in pu, and that is what it is."""
    if line.tap == 1.0 or not line.z:
        return line
    y, t = 1 / line.z, line.tap
    to_earth = (y + line.to_earth[0]) / t**2 - y / t, y + line.to_earth[1] - y / t
    plain = Branch(
        line.name, line.start, end=line.end, z=t * line.z, to_earth=to_earth, tap=1.0, shift=0.0
    )
    return plain if sum(map(abs, to_earth)) < sum(map(abs, line.to_earth)) else line


def transformers(network: Any, nominal: dict[str, float]) -> Iterator[Branch]:
    """Transformers of two windings that are closed at both ends; parameters as `lines`."""
    for row in network.get_2_windings_transformers(all_attributes=True).itertuples():
        ends = row.bus1_id, row.bus2_id
        if row.connected1 and row.connected2 and all(end in nominal for end in ends):
            z = complex(row.r_at_current_tap, row.x_at_current_tap)
            y = complex(row.g_at_current_tap, row.b_at_current_tap), 0j
            yield branch(
                row.Index,
                ends,
                nominal=(nominal[ends[0]], nominal[ends[1]]),
                z=z,
                to_earth=y,
                rho=row.rho,
                alpha=row.alpha,
            )


def stars(network: Any, nominal: dict[str, float]) -> Iterator[tuple[str, list[Branch]]]:
    """Transformers of three windings: the star bus, and the branches of the windings in service to it."""
    for _, row in network.get_3_windings_transformers(all_attributes=True).iterrows():
        bus, legs = f"{row.name}_star", []
        for k in "123":
            end = row[f"bus{k}_id"]
            if row[f"connected{k}"] and end in nominal:
                z, y = (
                    complex(row[f"{re}{k}_at_current_tap"], row[f"{im}{k}_at_current_tap"])
                    for re, im in ("rx", "gb")
                )
                volts = nominal[end], float(row.rated_u0)
                legs.append(
                    branch(
                        str(row.name),
                        (end, bus),
                        nominal=volts,
                        z=z,
                        to_earth=(y, 0j),
                        rho=row[f"rho{k}"],
                        alpha=row[f"alpha{k}"],
                    )
                )
        if len(legs) > 1:
            yield bus, legs


def finite(value: float, limit: float = 1e6) -> float:
    """A limit, infinite where the source means that there is none."""
    return value if math.isfinite(value) and abs(value) < limit else math.copysign(math.inf, value)
