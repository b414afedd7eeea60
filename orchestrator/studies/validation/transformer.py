"""An impedance between the meter and a device's port, as a user writes it."""

import re

from orchestrator.core.errors import InputError

_PART = re.compile(r"([RX])\s*=?\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?:pu)?[\s,;]*", re.IGNORECASE)


def read_impedance(text: str | None) -> complex:
    """``R 0.005 X 0.12`` [pu of the rating]; a negative X where the port is on the grid's side of the meter.

    Raises an `InputError` if it is not of that form."""
    if text is None:
        return 0j
    found = _PART.findall(text)
    names = [name.upper() for name, _ in found]
    rest = _PART.sub("", text).strip()
    if rest or not found or len(set(names)) < len(names):
        raise InputError(
            f"--transformer {text!r}: write its reactance in pu of the rating, and perhaps its resistance, such as "
            "'X 0.12' or 'R 0.005 X 0.12'"
        )
    values = dict(zip(names, (float(value) for _, value in found), strict=True))
    return complex(values.get("R", 0.0), values.get("X", 0.0))
