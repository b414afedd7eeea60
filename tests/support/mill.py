"""A case of a plant with its load behind a line to a stiff bus, with records of relays and with events."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase

RAW = """0, 100.0, 33, 0, 1, 60.0 / TWO BUSES
A STIFF BUS
AND A PLANT
1, 'GRID', 138.0, 3, 1, 1, 1, 1.0, 0.0
2, 'MILL', 138.0, 2, 1, 1, 1, 1.0, 0.0
0 / END OF BUS DATA, BEGIN LOAD DATA
2, '1', 1, 1, 1, 60.0, 15.0, 0.0, 0.0, 0.0, 0.0, 1
2, '2', 1, 1, 1, 20.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
1, '1', 40.0, 10.0, 500.0, -300.0, 1.0, 0, 1000.0, 0.0, 0.2, 0.0, 0.0, 1.0, 1, 100.0, 900.0, 0.0
2, '1', 40.0, 10.0, 100.0, -100.0, 1.0, 0, 100.0, 0.0, 0.2, 0.0, 0.0, 1.0, 1, 100.0, 90.0, 0.0
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
1, 2, '1', 0.01, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
0 / END OF TRANSFORMER DATA
Q
"""
MACHINES = "1 'GENCLS' 1 0 0 /\n2 'GENCLS' 1 4 2 /\n"


def mill_case(
    folder: Path,
    records: Sequence[str] = (),
    events: Sequence[Mapping[str, object]] = (),
    units: str = "",
    raw: str = RAW,
    replace: Sequence[str] = (),
    machines: str = MACHINES,
) -> Path:
    """Write the case, whose scenario ``tried`` has the events, and return its path.

    ``records``: of dynamics data, without their ends; ``units``: lines for the table ``[units]``; ``replace``: units
    whose machines converters replace; ``machines``: records of both units."""
    (folder / "mill.raw").write_text(raw)
    (folder / "mill.dyr").write_text(machines + "".join(f"{text} /\n" for text in records))
    out = folder / "case.toml"
    files = (folder / "mill.raw", folder / "mill.dyr")
    text = write_case(WantedCase(files, out, models="phasor", replace=tuple(replace))).text
    text = text.replace('dyr = "mill.dyr"', f'{units}\ndyr = "mill.dyr"')
    name = "gfor2" if "2" in replace or machines != MACHINES else "sg2"
    text = text.replace('"grid.line_*.p"', f'"grid.line_*.p", "grid.{name}*.p"')
    tables = "".join(
        "[[scenarios.tried.events]]\n" + "".join(f"{k} = {v!r}\n" for k, v in e.items())
        for e in events
    )
    out.write_text(f"{text}\n[scenarios.tried]\ntitle = 'tried'\n{tables}", encoding="utf-8")
    return out
