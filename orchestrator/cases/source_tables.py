"""MATPOWER's tables, the form in which networks of other programs are read."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Matrix


@dataclass(frozen=True)
class SourceTables:
    """MATPOWER's tables of a network, its columns in MATPOWER's order."""

    name: str
    base_mva: float
    bus: Matrix
    branch: Matrix
    gen: Matrix
    # conductance and susceptance to earth at both ends of every branch [pu]: g + jb behind the ratio at the from side,
    # and at the to side
    branch_to_earth: NDArray[np.complex128]
    labels: dict[int, str]  # number of a bus → what people call it
    frequency: float | None = None  # rated frequency [Hz], where the source knows it
    # number of a bus → what its loads draw as constant impedance and as constant current [MW, Mvar], where the source
    # tells them apart; the rest of the bus' load is as the case says
    load_parts: dict[int, tuple[complex, complex]] = field(default_factory=dict)
