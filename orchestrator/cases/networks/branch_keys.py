"""Keys by which another file of the same program names a branch, and the bases of that branch's data."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BranchKey:
    """One branch as its file names it.

    ``buses``: numbers, of a transformer in the order of its windings; ``winding``: 1 to 3 of a transformer with three,
    which is three branches; else 0. ``on_system``: factor from an impedance on the winding's own base to the system's;
    ``square``: what an impedance is multiplied by besides, as the ratio stands at the first winding alone;
    ``kilovolts``: base voltages of the buses, 0 where the file has none."""

    buses: tuple[int, ...]
    circuit: str
    is_transformer: bool = False
    winding: int = 0
    on_system: float = 1.0
    square: float = 1.0
    kilovolts: tuple[float, ...] = ()
