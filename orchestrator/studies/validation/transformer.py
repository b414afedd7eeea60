"""An impedance between the meter and a device's port, as a user writes it."""

import re
from dataclasses import dataclass
from enum import StrEnum

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option

_PART = re.compile(r"([RX])\s*=?\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?:pu)?[\s,;]*", re.IGNORECASE)
_ALONE = re.compile(r"\s+of\s+(V|PQ)\s*$", re.IGNORECASE)


class Beyond(StrEnum):
    """Which meters are at the other side of the transformer; the others are at the port."""

    ALL = ""
    VOLTAGE = "V"
    POWER = "PQ"


@dataclass(frozen=True)
class Between:
    """An impedance between meters and port [pu of the rating], and which meters it is between."""

    impedance: complex = 0j
    beyond: Beyond = Beyond.ALL


AT_PORT = Between()
"""Meters that are at the port, all of them."""


def read_transformer(text: str | None) -> Between:
    """``R 0.005 X 0.12`` [pu of the rating]; a negative X where the port is on the grid's side of the meter.

    ``X 0.12 of V`` stands for a voltage alone that is measured beyond it, ``X 0.12 of PQ`` for P and Q alone.

    Raises an `InputError` if it is not of that form."""
    if text is None:
        return AT_PORT
    alone = _ALONE.search(text)
    beyond = Beyond(alone[1].upper()) if alone else Beyond.ALL
    parts = text[: alone.start()] if alone else text
    found = _PART.findall(parts)
    names = [name.upper() for name, _ in found]
    rest = _PART.sub("", parts).strip()
    if rest or not found or len(set(names)) < len(names):
        raise InputError(
            Option.TRANSFORMER
            + f" {text!r}: write its reactance in pu of the rating, and perhaps its "
            "resistance, such as 'X 0.12' or 'R 0.005 X 0.12'; 'X 0.12 of V' if the "
            "voltage alone is measured beyond it, 'X 0.12 of PQ' if P and Q alone are"
        )
    values = dict(zip(names, (float(value) for _, value in found), strict=True))
    return Between(complex(values.get("R", 0.0), values.get("X", 0.0)), beyond)
