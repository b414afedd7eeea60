"""What an applicant declares of a converter, for codes that compare it with its own declaration."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from orchestrator.errors import InputError


@dataclass(frozen=True, slots=True)
class Declaration:
    # name, meaning, unit: as ``--declare`` takes it, and what it is.
    name: str
    meaning: str
    unit: str
    # least, most: range in which a value makes sense, in its unit.
    least: float
    most: float


def checked(wanted: Sequence[Declaration], given: Mapping[str, object], code: str) -> dict[str, float]:
    names = [declaration.name for declaration in wanted]
    if unknown := [name for name in given if name not in names]:
        takes = f"it takes {', '.join(names)}" if names else "it takes none; leave it out"
        raise InputError(f"--declare {unknown[0]}: --code {code} knows no such value; {takes}")
    if missing := [d for d in wanted if d.name not in given]:
        said = "; ".join(f"{d.name} ({d.meaning}) [{d.unit}]" for d in missing)
        example = " ".join(f"--declare {d.name}=…" for d in missing)
        raise InputError(f"--code {code} compares the converter with what is declared of it; missing: {said}. "
                         f"Add {example}")  # fmt: skip
    values = {}
    for declaration in wanted:
        value = given[declaration.name]
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not (math.isfinite(value) and declaration.least <= value <= declaration.most)
        ):
            raise InputError(
                f"--declare {declaration.name}={value}: the {declaration.meaning} is a number from "
                f"{declaration.least:g} to {declaration.most:g} [{declaration.unit}]; give it so"
            )
        values[declaration.name] = float(value)
    return values
