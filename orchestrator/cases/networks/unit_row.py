"""One generating unit of a case: its figures, and whether they can be."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.core.errors import InputError

_MOST_VOLTAGE = 2.0  # largest voltage [pu] that a unit can hold


class DoubtOfRecord(NamedTuple):
    """A question that a record of a machine raises, about a variable or a part of the machine.

    ``place``: file and line; ``kind``: the question without figures, the same for all machines that raise it."""

    variable: str
    place: str
    text: str
    kind: str


@dataclass(frozen=True, slots=True)
class UnitRow:
    """One generating unit.

    ``q_min_mvar``, ``q_max_mvar``, ``p_min_mw``, ``p_max_mw``: Limits of reactive and of active power; infinite
    without."""

    label: str
    bus: str
    # rating_mva, p_mw, v_pu: rating [MVA], active power [MW] and voltage [pu].
    rating_mva: float
    p_mw: float
    v_pu: float
    alpha: float | None = None  # share of the converter, if the row gives it; otherwise None
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    # file and line of the row; empty where the unit comes from the network's source
    place: str = ""
    parts: Mapping[str, str] = field(default_factory=dict)
    # whether a record of it was left out, for which the case says what stands there
    partial: bool = False
    q_min_mvar: float = -math.inf
    q_max_mvar: float = math.inf
    converter: str | None = None  # model of the converter that the whole unit is by its record
    doubts: tuple[DoubtOfRecord, ...] = ()  # questions about the generator's data
    # lines of records for which the converter's model stands, each with what it leaves out.
    replaced: tuple[tuple[int, str], ...] = ()
    # lines of the records that give parameters, by parameter
    lines: Mapping[str, int] = field(default_factory=dict)
    p_min_mw: float = -math.inf
    p_max_mw: float = math.inf
    # likely rating [MVA] if rating_mva is only the base of the machine's data; otherwise None
    likely_mva: float | None = None
    measured: MeasuredPoint | None = None  # where it measures; None for its own terminal
    is_infinite: bool = (
        False  # whether the source has no such unit, and an infinite bus stands there
    )


def checked(row: UnitRow, place: str, *, is_base: bool = False) -> UnitRow:
    """The row.

    ``is_base``: whether the rating is only the base of the machine's data, as MBASE of PSS/E is: a power above it is
    then a matter for a question.

    Raises `InputError` if a figure cannot be."""
    unit = f"{place}: the unit at bus {row.label}"
    if not row.rating_mva > 0:
        raise InputError(f"{unit} has a rating of {row.rating_mva:g} MVA; it must exceed 0")
    if abs(row.p_mw) > row.rating_mva and not is_base:
        most = f"its rating of {row.rating_mva:g} MVA; raise the rating or lower p_mw"
        raise InputError(f"{unit} feeds {row.p_mw:g} MW, more than {most}")
    if not row.q_min_mvar <= row.q_max_mvar:
        limits = f"q_min_mvar = {row.q_min_mvar:g}, more than its q_max_mvar = {row.q_max_mvar:g}"
        raise InputError(f"{unit} has {limits}; swap them")
    if not 0 < row.v_pu <= _MOST_VOLTAGE:
        rule = f"it is in pu of the nominal voltage, and must lie between 0 and {_MOST_VOLTAGE:g}"
        raise InputError(f"{unit} has v_pu = {row.v_pu:g}; {rule}")
    return row
