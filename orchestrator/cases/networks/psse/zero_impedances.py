"""Buses that PSS/E takes as one, because a line of (nearly) no impedance joins them.

PSS/E treats a branch that is no transformer as a zero impedance line if its reactance is not above the threshold
THRSHZ, 1e-4 pu unless the record GENERAL of a revision from 34 on says otherwise, and it has no charging (PSS/E's
Program Operation Manual, "Zero impedance lines").  Its resistance does not count: in cases that PSS/E solved, such as
NREL-Sienna/PowerSystemsTestData, psse_raw/case8_voltage_wind_correction.raw, the voltages at both ends of such lines
are alike to the last digit with R = 0.012 pu, and they are not where the line has charging."""

import re
from collections.abc import Collection, Iterable, Mapping

from orchestrator.cases.networks.psse.raw_records import RawFile, Record

USUAL_THRESHOLD = 1e-4  # THRSHZ of a file that does not say it [pu of the system]
_SMALLEST = (
    2e-5  # impedance that a line with charging may have [pu]: twice the least of our network
)


def threshold(raw: RawFile) -> float:
    """THRSHZ of a file [pu of the system]."""
    for record in raw.of("system-wide"):
        for text in record.fields:
            found = re.fullmatch(r"THRSHZ\s*=\s*([\d.eEdD+-]+)", text, re.IGNORECASE)
            if found:
                return float(found[1].replace("D", "E").replace("d", "e"))
    return USUAL_THRESHOLD


def is_joining(record: Record, least: float) -> bool:
    """Return whether a branch makes one bus of its two.

    One with charging does so only if its whole impedance is too small for a branch of ours.  ``least``: THRSHZ [pu]."""
    z = complex(record.number(3, "R", 0.0), record.number(4, "X", 0.0))
    if record.number(5, "B", 0.0):
        return abs(z) < min(least, _SMALLEST)
    return abs(z.imag) <= least


def merged_buses(
    joins: Iterable[tuple[Record, int, int]], kinds: Mapping[int, int], held: Collection[int]
) -> tuple[dict[int, int], list[Record], list[Record]]:
    """Buses that others stand for.

    ``joins``: record and both buses of each line without impedance; ``kinds``: IDE by bus; ``held``: buses with a
    machine in service. Two of these are not merged, because each machine keeps its bus.

    Returns the bus that stands for each, the lines that are no more, and those that stay."""
    standing = {bus: bus for bus in kinds}

    def root_of(bus: int) -> int:
        while standing[bus] != bus:
            bus = standing[bus]
        return bus

    gone, kept = [], []
    for record, start, end in joins:
        one, other = root_of(start), root_of(end)
        if one == other:
            gone.append(record)
        elif one in held and other in held:
            kept.append(record)
        else:
            first, second = sorted(
                (one, other), key=lambda bus: (bus not in held, -kinds[bus], bus)
            )
            standing[second] = first
            gone.append(record)
    return {bus: root_of(bus) for bus in kinds if root_of(bus) != bus}, gone, kept
