"""FACTS devices and switched shunts with a record of a static var compensator: they are units with that model.

PSS/E's CSVGN1 and its like are of generators; where the RAW file has a FACTS device in its place, the unit feeds what
that does. SVSMO1T2 is of a switched shunt."""

from collections.abc import Collection, Iterator
from dataclasses import replace

from fmus.static_var.dyr_records import STATIC_VAR_RECORDS
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.cases.networks.psse.dyr_file import facts_name
from orchestrator.cases.networks.psse.facts_devices import FactsDevice
from orchestrator.cases.networks.psse.raw_loads import switched_shunts
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.psse.raw_tables import RawTables
from orchestrator.cases.networks.source_changes import Remark

RECORDS = (*STATIC_VAR_RECORDS,)
"""Names of records that are of a static var compensator at a bus."""

_SOURCE = 1j  # ZSORCE where a record does not say it [pu of the rating]
_NO_LIMIT = 9999.0  # MVA by which PSS/E says that a device has no limit

Modelled = Collection[tuple[int, str]]
"""Bus and identifier of such records; 0 and the name of its unit of one that names its FACTS device."""


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
    shunts = {(shunt.record.whole(0, "I"), shunt.name) for shunt in switched_shunts(net)}
    of_bus = {bus: name for bus, name in modelled if (bus, name) not in there | shunts}
    kept = []
    for device in net.devices.devices:
        name = _unit_of(device, of_bus, modelled)
        if not isinstance(device, FactsDevice) or name is None:
            kept.append(device)
            continue
        bus = device.sending
        held = net.magnitudes[bus] if device.is_remote else device.v_pu
        what = "the file's voltage" if device.is_remote else "VSET"
        most = device.most_mva if device.most_mva < _NO_LIMIT else net.raw.base_mva
        text = (
            f"FACTS device with a record of its model at bus {bus}: a unit of 0 MW that holds {what}, with "
            f"that model on {_base_of(name, most)}"
        )
        net.modelled.add(device.line)
        net.changes.note(device.line, Remark(text, "a FACTS device with a record of its model"))
        yield Machine(
            bus,
            name,
            device.line,
            p_mw=0.0,
            v_pu=held,
            rating_mva=most,
            source=_SOURCE,
            q_min_mvar=-most,
            q_max_mvar=most,
        )
    net.devices = replace(net.devices, devices=tuple(kept))


def _unit_of(device: HeldDevice, of_bus: dict[int, str], modelled: Modelled) -> str | None:
    """Return the name of the unit that a device's record makes of it, by the device's name or its bus; None for none.

    ``of_bus``: records at buses that are of no machine, of which one is taken."""
    if not isinstance(device, FactsDevice) or device.terminal:
        return None
    own = facts_name(device.name)
    if (0, own) in modelled:
        return own
    return None if device.is_remote else of_bus.pop(device.sending, None)


def _base_of(unit: str, most: float) -> str:
    if unit.startswith(facts_name("")):
        return "STBASE of that record"
    return f"{most:g} MVA (SHMX, in the place of a generator's MBASE)"


def units_of_shunts(net: RawTables, modelled: Modelled) -> Iterator[Machine]:
    """Yield a unit for each switched shunt with a model; `read_shunts` leaves it out.

    It holds the voltage of the file's solution, so that it feeds BINIT where that is solved."""
    for shunt in switched_shunts(net):
        place = net.own_bus(shunt.record)
        if (place, shunt.name) not in modelled or net.is_out(shunt.bus):
            continue
        v = net.magnitudes[shunt.bus]
        least, most = min(shunt.least, shunt.initial), max(shunt.most, shunt.initial)
        text = (
            f"switched shunt with a record of its model at bus {place}: a unit of 0 MW that holds {v:g} pu, the file's "
            f"voltage, between {least * v**2:.4g} and {most * v**2:.4g} Mvar (BINIT = {shunt.initial:g}), with that "
            f"model on {net.raw.base_mva:g} MVA"
        )
        kind = "a switched shunt with a record of its model"
        net.modelled.add(shunt.record.line)
        net.changes.note(shunt.record.line, Remark(text, kind))
        yield Machine(
            shunt.bus,
            shunt.name,
            shunt.record.line,
            p_mw=0.0,
            v_pu=v,
            rating_mva=net.raw.base_mva,
            source=_SOURCE,
            q_min_mvar=least * v**2,
            q_max_mvar=most * v**2,
            q_mvar=shunt.initial * v**2,
        )
