"""Systems of TOPS in its own tables (``tops/*.json``): admittances, power flow and generators' data.

The tables are those of TOPS 0.3.0, ``k2a_val`` and ``ieee39`` (H. Haugdal, MIT, ``tops/LICENSE``), and so are the
speeds that PowerFactory gave for them (``tops/*_powerfactory.csv.gz``). All values here are per unit on 100 MVA.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import root

FOLDER = Path(__file__).parent / "tops"
BASE = 100.0
INTERVAL = 5e-3
"""Between two rows of the recordings [s]."""


@dataclass(frozen=True)
class TopsSystem:
    """Admittances with loads [pu], voltages, and for each generator its bus, power S and its table's columns."""

    frequency: float
    Y: np.ndarray
    v: np.ndarray
    bus: np.ndarray
    S: np.ndarray
    data: dict[str, np.ndarray]
    names: tuple[str, ...]


def recorded_speeds(name: str) -> np.ndarray:
    """PowerFactory's speeds [pu], a row every 5 ms from 0 s, a column for each generator."""
    return 1 + 1e-6 * np.loadtxt(FOLDER / f"{name}_powerfactory.csv.gz", delimiter=",")


@cache
def tops_system(name: str) -> TopsSystem:
    """The system of that name at its power flow."""
    tables = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    V_n = {r["name"]: r["V_n"] for r in _rows(tables, "buses")}
    place = {bus: k for k, bus in enumerate(V_n)}
    Y = np.zeros((len(place), len(place)), complex)
    for r in _rows(tables, "lines"):
        a, b, Z = place[r["from_bus"]], place[r["to_bus"]], r["V_n"] ** 2 / BASE  # Ω
        if r["unit"] == "pf":  # Ω and µS a km
            z, y = complex(r["R"], r["X"]) / Z, 1e-6j * r["B"] * Z
        else:
            z, y = complex(r["R"], r["X"]) * BASE / r["S_n"], 1j * r["B"] * r["S_n"] / BASE
        _branch(Y, a, b, z * r["length"], 1.0, 1.0, 0.5 * y * r["length"])
    for r in _rows(tables, "transformers"):
        z = complex(r["R"], r["X"]) * BASE / r["S_n"] / r.get("N_par", 1)
        a, b = place[r["from_bus"]], place[r["to_bus"]]
        _branch(Y, a, b, z, r.get("ratio_from", 1.0), r.get("ratio_to", 1.0), 0.0)
    for r in _rows(tables, "shunts"):
        Y[place[r["bus"]], place[r["bus"]]] += 1j * r["Q"] / BASE
    drawn = np.zeros(len(place), complex)
    for r in _rows(tables, "loads"):
        drawn[place[r["bus"]]] += complex(r["P"], r["Q"]) / BASE
    data, names = _generators(tables)
    bus = np.array([place[r["bus"]] for r in _rows(tables, "GEN")])
    v = _power_flow(Y, drawn, bus, data["P"] / BASE, data["V"], place[tables["slack_bus"]])
    S = (v * np.conj(Y @ v) + drawn)[bus]
    return TopsSystem(
        float(tables["f"]), Y + np.diag(np.conj(drawn) / abs(v) ** 2), v, bus, S, data, names
    )


def _rows(tables: dict[str, Any], name: str) -> list[dict[str, Any]]:
    head, *rows = tables[name]
    return [dict(zip(head, row, strict=True)) for row in rows]


def _branch(
    Y: np.ndarray, a: int, b: int, z: complex, of_a: float, of_b: float, at_ends: complex
) -> None:
    """π section; the ratios are the numbers by which TOPS multiplies the voltages of its ends."""
    Y[a, a] += of_a**2 / z + at_ends
    Y[b, b] += of_b**2 / z + at_ends
    Y[a, b] -= of_a * of_b / z
    Y[b, a] -= of_a * of_b / z


def _generators(tables: dict[str, Any]) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of generators and of their controls (1 where there are none, and ``controlled`` false)."""
    rows = _rows(tables, "GEN")
    names = tuple(r["name"] for r in rows)
    rows = [{"PF_n": 1.0, "N_par": 1} | r for r in rows]
    columns: dict[str, Any] = {
        key: [r[key] for r in rows] for key in rows[0] if key not in ("name", "bus", "V_n")
    }
    for model in ("TGOV1", "SEXS", "STAB1"):
        own = {r["gen"]: r for r in _rows(tables, model)}
        keys = next(iter(own.values())).keys() - {"name", "gen"}
        columns |= {
            f"{model}.{key}": [own[n][key] if n in own else 1.0 for n in names] for key in keys
        }
        columns["controlled"] = [n in own for n in names]
    data = {key: np.array(values) for key, values in columns.items()}
    for key in ("S_n", "P"):
        data[key] = data[key] * data["N_par"]
    return data, names


def _power_flow(
    Y: np.ndarray, drawn: np.ndarray, bus: np.ndarray, P: np.ndarray, V: np.ndarray, slack: int
) -> np.ndarray:
    n = len(Y)
    fed = -drawn
    fed[bus] += P
    magnitude = np.ones(n)
    magnitude[bus] = V
    turned, free = np.delete(np.arange(n), slack), np.setdiff1d(np.arange(n), bus)

    def voltages(x: np.ndarray) -> np.ndarray:
        angle, size = np.zeros(n), magnitude.copy()
        angle[turned], size[free] = x[: n - 1], x[n - 1 :]
        return size * np.exp(1j * angle)

    def mismatch(x: np.ndarray) -> np.ndarray:
        v = voltages(x)
        off = v * np.conj(Y @ v) - fed
        return np.concatenate([off.real[turned], off.imag[free]])

    found = root(mismatch, np.concatenate([np.zeros(n - 1), np.ones(len(free))]), tol=1e-12)
    assert np.abs(mismatch(found.x)).max() < 1e-8, found.message
    return voltages(found.x)
