"""What is asked of a study of interactions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.asked import FLAG, FREQUENCIES, NAME, NAMES, SHARE, asked
from orchestrator.cases.schema import Value

RANGE_HZ = (0.1, 100.0)
"""Frequencies of the modes that are compared [Hz]: swings, and what converters' controls do up to twice the rated
frequency, as their network's frame turns with it."""


@dataclass(frozen=True)
class GivenDevice:
    """A device that is tried at the places of a case."""

    name: str
    file: Path
    binding: Path | None = None
    values: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class InteractionsRequest:
    """What is studied; ``devices`` are tried beside those of the case."""

    threshold: float = asked(SHARE, 0.05, "share of a mode from which on a vendor takes part in it (default: 5)")
    frequency_range: tuple[float, float] = asked(
        FREQUENCIES, RANGE_HZ, "frequencies [Hz] (default: 0.1:100)", option="--range", keyword="frequencies"
    )
    stand_in: str | None = asked(
        NAME, None, "model at the places of the vendors that a system does without (default: static_generation, a "
        "current without dynamics; gfor is the reference converter)", "MODEL",
    )  # fmt: skip
    swap: bool = asked(FLAG, False, "each vendor's device at each place, in all ways")
    devices: tuple[GivenDevice, ...] = ()
    swapped: tuple[str, ...] = asked(
        NAMES, (), "swap only at this place (repeatable)", "COMPONENT", option="--place", keyword="places"
    )
    black_box: bool = asked(FLAG, False, "identify the components that hide their states from their inputs and outputs")
