"""A PSS/E RAW file of revision 23 to 36 as tables of a network source."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from orchestrator.cases.networks.psse.device_records import (
    Places,
    read_devices,
    series_impedances,
)
from orchestrator.cases.networks.psse.raw_branches import read_lines, read_transformers
from orchestrator.cases.networks.psse.raw_buses import leave_out_bare_buses, merge_buses, read_buses
from orchestrator.cases.networks.psse.raw_file import read_file
from orchestrator.cases.networks.psse.raw_loads import named_loads, read_loads, read_shunts
from orchestrator.cases.networks.psse.raw_machines import infinite_buses, read_machines
from orchestrator.cases.networks.psse.raw_network import RawNetwork
from orchestrator.cases.networks.psse.raw_records import leave_out
from orchestrator.cases.networks.psse.raw_regions import regions_of
from orchestrator.cases.networks.psse.raw_tables import (
    BRANCH_COLUMNS,
    BUS_COLUMNS,
    GENERATOR_COLUMNS,
    RawTables,
)
from orchestrator.cases.networks.psse.raw_uses import record_uses
from orchestrator.cases.networks.psse.static_vars import Modelled, units_of_devices, units_of_shunts
from orchestrator.cases.networks.source_changes import Changes
from orchestrator.cases.networks.sources import SourceTables


def read_raw(
    path: Path,
    leaving_out: Sequence[str] = (),
    *,
    keep_load_parts: bool = False,
    slack: str | None = None,
    modelled: Modelled = (),
) -> RawNetwork:
    """Read a file.

    ``slack``: the unit or bus that a case names as the reference: nothing then stands at the file's own one where no
    machine is in service. ``modelled``: bus and identifier of records of static var compensators, which may be of FACTS
    devices and switched shunts."""
    raw = read_file(path)
    net = RawTables(raw, Changes(raw.place), keep_load_parts)
    return _network(net, leaving_out, slack, modelled)


def _read_devices(net: RawTables, leaving_out: Sequence[str]) -> None:
    """Read DC lines, FACTS devices and the like; series parts of FACTS devices may be branches."""
    places = Places(net.standing, net.kilovolts)
    net.devices = read_devices(net.raw, leaving_out, places)
    for line, text in net.devices.remarks:
        net.changes.note(line, text)
    for record, z in series_impedances(net.raw, leaving_out):
        start, end = (net.standing(net.own_bus(record, k)) for k in (1, 2))
        if start is not None and end is not None and start != end:
            net.add_branch(start, end, z, 1)


def _network(
    net: RawTables, leaving_out: Sequence[str], slack: str | None, modelled: Modelled
) -> RawNetwork:
    for line, section in net.raw.guessed.items():
        text = f"does not say which data begin, as other lines do: taken as {section} data, which are next in order"
        net.changes.note(line, text)
    for line, text in net.raw.remarks:
        net.changes.note(line, text)
    leave_out(net.raw, leaving_out, net.changes)
    for line, text in net.dropped.items():
        net.changes.note(line, text)
    read_buses(net)
    merge_buses(net, modelled)
    read_loads(net)
    read_shunts(net, modelled)
    read_lines(net)
    read_transformers(net)
    _read_devices(net, leaving_out)
    machines = read_machines(net)
    machines = (*machines, *units_of_devices(net, machines, modelled))
    machines = (*machines, *units_of_shunts(net, modelled))
    machines = (*machines, *infinite_buses(net, machines, slack))
    leave_out_bare_buses(net, machines)
    gen = np.zeros((len(machines), GENERATOR_COLUMNS))
    for row, m in zip(gen, machines, strict=True):
        row[[0, 1, 3, 4, 5, 7, 8]] = (
            m.bus,
            m.p_mw,
            m.q_max_mvar,
            m.q_min_mvar,
            m.v_pu,
            1,
            m.rating_mva,
        )
    at_buses = {bus: x.apart() for bus, x in net.at_buses.items()}
    tables = SourceTables(
        name=net.raw.place,
        base_mva=net.raw.base_mva,
        bus=np.array(list(net.rows.values())).reshape(-1, BUS_COLUMNS),
        branch=np.array(net.branches).reshape(-1, BRANCH_COLUMNS),
        gen=gen,
        branch_to_earth=np.array(net.to_earth, dtype=complex).reshape(-1, 2),
        labels=net.labels,
        frequency=net.raw.frequency,
        load_parts={bus: x.drawing.parts for bus, x in at_buses.items() if any(x.drawing.parts)},
        titles=net.titles,
        feeding={bus: x.feeding for bus, x in at_buses.items() if x.feeding.power},
        branch_names=tuple(net.names),
        branch_keys=tuple(net.keys),
        regions=regions_of(net.raw),
    )
    of_devices = net.devices.unused
    records = record_uses(
        net.file, net.merged, leaving_out, of_devices, net.dropped, modelled=net.modelled
    )
    return RawNetwork(
        tables,
        machines,
        tuple(net.changes.as_problems()),
        frozenset(net.idle),
        records=records,
        devices=net.devices.devices,
        loads=tuple(named_loads(net, tables)),
        taps=net.taps,
        shunts=tuple(net.stepping),
        same=dict(net.same),
    )
