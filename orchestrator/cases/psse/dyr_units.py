"""Units of a case from the machines of a RAW file and their records in a DYR file."""

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.cases.network_data import bus_name
from orchestrator.cases.psse.dyr import machine_models
from orchestrator.cases.psse.dyr_records import read_dyr
from orchestrator.cases.psse.raw import Machine
from orchestrator.cases.unit_row import UnitRow, checked


def rows_of_machines(machines: Sequence[Machine], place: str) -> list[UnitRow]:
    """A unit for each machine, in their order, without what it is made of."""
    at_bus: dict[int, list[Machine]] = {}
    for machine in machines:
        at_bus.setdefault(machine.bus, []).append(machine)
    rows = []
    for machine in machines:
        here = at_bus[machine.bus]
        name = re.sub(r"\W", "_", machine.name.strip())
        row = UnitRow(
            str(machine.bus) if len(here) == 1 else f"{machine.bus}_{name}",
            bus_name(str(machine.bus)), machine.rating_mva, machine.p_mw, machine.v_pu, place=place,
            q_min_mvar=sum(m.q_min_mvar for m in here), q_max_mvar=sum(m.q_max_mvar for m in here),
            p_min_mw=machine.p_min_mw, p_max_mw=machine.p_max_mw,
        )  # fmt: skip
        rows.append(checked(row, place))
    return rows


def with_records(
    rows: Sequence[UnitRow], machines: Sequence[Machine], path: Path, leaving_out: Sequence[str],
    without: Collection[str], idle: Collection[tuple[int, str]] = (), *, approximate: bool = False,
) -> list[UnitRow]:  # fmt: skip
    """The units with what the records say of them."""
    keys = [(machine.bus, machine.name.strip()) for machine in machines]
    replaced = {key for key, row in zip(keys, rows, strict=True) if row.label in without}
    models = machine_models(read_dyr(path), machines, leaving_out, replaced, idle, approximate=approximate)
    found = []
    for key, row in zip(keys, rows, strict=True):
        model = models.get(key)
        if model is None:
            found.append(row)
        elif model.converter is None:
            own = {"sg": model.parameters}
            of_records = replace(row, parameters=own, parts=model.parts, partial=model.partial)
            found.append(replace(of_records, doubts=model.doubts, lines=model.lines))
        else:
            own = {"gfor": model.parameters}
            found.append(
                replace(row, parameters=own, converter=model.converter, replaced=model.replaced, lines=model.lines)
            )
    return found
