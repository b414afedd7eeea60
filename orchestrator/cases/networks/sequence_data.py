"""Data of the negative and the zero sequence, element by element, and what is taken where a source has none."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

_GROUP = re.compile(r"(yn|y|d)(yn|y|d)\d{0,2}((yn|y|d)\d{0,2})?")
EARTHED = "yn"  # connection of a winding: a star with its neutral to earth
DELTA = "d"  # the same: a delta

LINE_Z0 = 3.0
"""Z0 by Z1 of a line: overhead lines have 2 to 4, with earth wires the less of it."""
LINE_B0 = 0.6  # zero-sequence charging of a line by that of the positive sequence
TRANSFORMER_X0 = 1.0  # X0 by X1 of a transformer: 0.85 to 1 with three limbs, 1 else
MACHINE_X2 = 1.0
"""X2 by X''d of a machine: 1 to 1.1 with dampers in both axes."""
EXTERNAL_Z0 = 1.0  # Z0 by Z1 of an external grid
STEP_UP = "ynd"  # of a transformer at a unit, its network side first
NETWORK_TRANSFORMER = "ynyn"
THREE_WINDINGS = "ynynd"


@dataclass(frozen=True, slots=True)
class ZeroLine:
    """A line in the zero sequence [pu, 100 MVA]: impedance, charging of the whole line, shunts at both ends."""

    z: complex
    b: float
    y_from: complex = 0j
    y_to: complex = 0j


@dataclass(frozen=True, slots=True)
class ZeroTransformer:
    """A transformer with two windings, or one leg of one with three.

    ``windings``: connections of both, of a leg its own alone; ``z``: impedance through it, or of the leg, on the side
    of the second winding [pu, 100 MVA]; ``earthing``: from each neutral to earth [pu, 100 MVA]."""

    windings: tuple[str, ...]
    z: complex
    earthing: tuple[complex, ...] = (0j, 0j)


@dataclass(frozen=True, slots=True)
class MachineSequences:
    """Impedances of a machine in the negative and the zero sequence [pu of its own base]; None if not earthed."""

    negative: complex
    zero: complex | None


@dataclass(frozen=True)
class SequenceData:
    """Data of both sequences as a file has them, by the names of our elements.

    ``transformers``: branches that the network's file has among its transformers, None where it does not tell;
    ``negative``, ``zero``: admittances to earth by bus [pu, 100 MVA], the negative ones in the place of its loads;
    ``mutuals``: impedance between two lines [pu, 100 MVA], from the first to the second end of both."""

    source: str = ""
    lines: Mapping[str, ZeroLine] = field(default_factory=dict)
    branches: Mapping[str, ZeroTransformer] = field(default_factory=dict)
    machines: Mapping[str, MachineSequences] = field(default_factory=dict)
    negative: Mapping[str, complex] = field(default_factory=dict)
    zero: Mapping[str, complex] = field(default_factory=dict)
    mutuals: Mapping[tuple[str, str], complex] = field(default_factory=dict)
    transformers: frozenset[str] | None = None


def windings_of(group: str) -> tuple[str, ...]:
    """Return the connections of a vector group's windings: ``YNd5`` → ``yn``, ``d``.

    Raises a `ValueError` for what is none."""
    found = _GROUP.fullmatch(group.strip().lower())
    if found is None:
        raise ValueError(
            f"{group!r} is no vector group: write it like 'YNd5', the winding at the from bus first; "
            "YN is a star with its neutral to earth, Y one without, D a delta"
        )
    return tuple(x for x in (found[1], found[2], found[4]) if x)
