"""Scans in the CSV form of Energinet's IMTB: impedances [Ω] in dq, or in αβ at the frequency of the network.

One file may hold a device (Zdut) and a network (Znet). The αβ form has the sequences as rows and columns: the second
is the mirrored one, two rated frequencies lower."""

import csv
import math
from io import StringIO
from pathlib import Path

import numpy as np

from orchestrator.arrays import Complex, Numbers
from orchestrator.errors import InputError
from orchestrator.immittance.scan import Scan, checked, in_own_form

_ELEMENTS = ("11", "12", "21", "22")
_SEQUENCES = np.array([[1, 1j], [1, -1j]]) / math.sqrt(2)


def is_imtb(first_line: str) -> bool:
    return first_line.startswith("f,") and any(f"_{frame}_11_re" in first_line for frame in ("dq", "ab"))


def read_imtb(path: Path, text: str, rated_hz: float, *, network: bool) -> Scan:
    """The device of a file, or its network; rows of negative dq frequencies are left out, they mirror the others."""
    rows = list(csv.DictReader(StringIO(text)))
    frame = "dq" if "_dq_11_re" in text.partition("\n")[0] else "ab"
    quantities = list(dict.fromkeys(n.partition(f"_{frame}_")[0] for n in rows[0] if f"_{frame}_" in n)) if rows else []
    wanted = [q for q in quantities if ("net" in q) == network] or quantities
    if len(wanted) != 1:
        raise InputError(f"{path.name}: it holds {', '.join(quantities) or 'no rows'}; one of Zdut and Znet is needed")
    frequencies, Z = _numbers(path, rows, f"{wanted[0]}_{frame}")
    if frame == "ab":
        frequencies = frequencies - rated_hz
        Z = np.linalg.inv(_SEQUENCES) @ Z @ _SEQUENCES
    kept = frequencies > 0
    frequencies, Z = frequencies[kept], Z[kept]
    questions = checked(path.name, frequencies, Z)
    own = in_own_form(path.name, frequencies, np.linalg.inv(Z), rated_hz, q_leads=True)
    return Scan(path.name, frequencies, own, (wanted[0],), questions=questions)


def _numbers(path: Path, rows: list[dict[str, str]], name: str) -> tuple[Numbers, Complex]:
    found = []
    for number, row in enumerate(rows, start=2):
        try:
            values = [complex(float(row[f"{name}_{e}_re"]), float(row[f"{name}_{e}_im"])) for e in _ELEMENTS]
            found.append((float(row["f"]), values))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path.name}, line {number}: {name} is no row of numbers ({error})") from error
    return np.array([f for f, _ in found]), np.array([v for _, v in found]).reshape(-1, 2, 2)
