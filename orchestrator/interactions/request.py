"""What is asked of a study of interactions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.cases.schema import Value

THRESHOLD = 0.05
"""Share of a mode from which on a vendor takes part in it."""

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
    """What is studied.

    Attributes
    ----------
    threshold
        Share of a mode from which on a vendor takes part in it.
    frequency_range
        Of the modes [Hz].
    stand_in
        Model of the catalogue at the places of the vendors that a system does without; None for the neutral one.
    swap
        Whether all devices are tried at all places.
    devices
        That are tried beside those of the case.
    swapped
        Places that are swapped; all where empty.
    black_box
        Whether components that hide their states are identified.
    """

    threshold: float = THRESHOLD
    frequency_range: tuple[float, float] = RANGE_HZ
    stand_in: str | None = None
    swap: bool = False
    devices: tuple[GivenDevice, ...] = ()
    swapped: tuple[str, ...] = ()
    black_box: bool = False
