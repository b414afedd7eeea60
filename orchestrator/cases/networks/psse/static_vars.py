"""FACTS devices whose bus has a record of a static var compensator: they are units with that model.

PSS/E's CSVGN1 is of a generator; where the RAW file has a FACTS device in its place, the unit feeds what that does."""

from collections.abc import Collection, Iterator
from dataclasses import replace

from orchestrator.cases.networks.psse.facts_devices import FactsDevice
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.psse.raw_tables import RawTables
from orchestrator.cases.networks.source_changes import Remark

RECORDS = ("CSVGN1",)
"""Names of records that are of a static var compensator at a bus."""

_SOURCE = 1j  # ZSORCE where a record does not say it [pu of the rating]
_NO_LIMIT = 9999.0  # MVA by which PSS/E says that a device has no limit

Modelled = Collection[tuple[int, str]]
"""Bus and identifier of such records."""


def units_of_devices(
    net: RawTables, machines: Collection[Machine], modelled: Modelled
) -> Iterator[Machine]:
    """Yield a unit for each FACTS device with a model, which then is no device any more.

    Parameters
    ----------
    net
        Tables of the RAW file with its devices, of which those with a model are taken.
    machines
        Machines in service: a record of one of them is of no device.
    modelled
        Bus and identifier of the records.
    """
    there = {(machine.bus, machine.name.strip()) for machine in machines} | net.idle
    of_bus = {bus: name for bus, name in modelled if (bus, name) not in there}
    kept = []
    for device in net.devices.devices:
        is_shunt = isinstance(device, FactsDevice) and not device.terminal and not device.is_remote
        if not isinstance(device, FactsDevice) or not is_shunt or device.sending not in of_bus:
            kept.append(device)
            continue
        bus = device.sending
        most = device.most_mva if device.most_mva < _NO_LIMIT else net.raw.base_mva
        text = (
            f"FACTS device with a record of its model at bus {bus}: a unit of 0 MW that holds VSET, with that model on "
            f"{most:g} MVA (SHMX, in the place of a generator's MBASE)"
        )
        net.changes.note(device.line, Remark(text, "a FACTS device with a record of its model"))
        yield Machine(
            bus,
            of_bus.pop(bus),
            device.line,
            p_mw=0.0,
            v_pu=device.v_pu,
            rating_mva=most,
            source=_SOURCE,
            q_min_mvar=-most,
            q_max_mvar=most,
        )
    net.devices = replace(net.devices, devices=tuple(kept))
