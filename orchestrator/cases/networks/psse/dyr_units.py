"""Units of a case from the machines of a RAW file and their records in a DYR file.

Parts of machines without a record are what [units] chooses for them, else what PSS/E assumes."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from fmus.synchronous_generator.dyr_records import DYR_RECORDS, MACHINE_VARIANTS
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import OF_FACTS, DynamicRecord
from orchestrator.cases.networks.psse.dyr_mistakes import exciter_without_field, share_of_power
from orchestrator.cases.networks.psse.dyr_unit_records import COMPENSATORS
from orchestrator.cases.networks.psse.limiter_records import LIMITERS
from orchestrator.cases.networks.psse.machine_model import (
    CLASSICAL,
    COMPENSATION,
    MANUAL,
    STATIC,
    WITHOUT_INERTIA,
)
from orchestrator.cases.networks.psse.plant_points import HELD_BUS
from orchestrator.cases.networks.psse.raw_network import Machine, unit_labels
from orchestrator.cases.networks.unit_row import DoubtOfRecord, UnitRow, checked
from orchestrator.core.errors import InputError

_WITHOUT = {"exciter": MANUAL, "governor": "constant_power", "stabilizer": "none"}
"""What PSS/E assumes where there is no record."""

_ON_EXCITERS = ("stabilizer", *LIMITERS)
"""Parts that act on a voltage regulator."""

_IDLE = {"stabiliser": ("pss",), "limiter": LIMITERS}
"""Scopes of what acts on nothing at a machine without an exciter, by its kind; a compensator is the exciter's own."""

# what is constant without the part
_CONSTANT = {"exciter": "field voltage", "governor": "mechanical power"}
_OTHERS = 2  # machines with a record from which on a machine without one is questioned
_CONDENSER = 0.01  # active power [pu of the rating] below which a machine needs no governor


def refuse_exciters_without_field(
    rows: Sequence[UnitRow],
    machines: Sequence[Machine],
    records: Sequence[DynamicRecord],
    without: Collection[str],
) -> None:
    """Refuse records of exciters at classical machines, all together.

    ``rows``: with what the records say; ``without``: labels of units that a converter replaces."""
    classical = {
        (machine.bus, machine.name.strip())
        for machine, row in zip(machines, rows, strict=True)
        if row.parts.get("machine") == CLASSICAL
        and row.parts.get("exciter", MANUAL) != MANUAL
        and row.label not in without
    }
    known = [one for one in records if one.name in DYR_RECORDS]
    exciters = [
        one
        for one in known
        if (one.bus, one.machine) in classical and DYR_RECORDS[one.name].kind == "exciter"
    ]
    if exciters:
        raise exciter_without_field(exciters, known)


def with_choices(
    rows: Sequence[UnitRow], replaced: Collection[str], chosen: Mapping[str, str]
) -> list[UnitRow]:
    """The units with the parts that ``[units]`` chooses: the machine's variant, and what has no record."""
    found, acted = [], set[str]()
    for row in rows:
        own = (
            {}
            if row.label in replaced or row.converter
            else {k: n for k, n in chosen.items() if _fits(k, n, row)}
        )
        acted |= {*own}
        found.append(replace(row, parts={**row.parts, **own}) if own else row)
    machines = [row for row in rows if row.label not in replaced and not row.converter]
    for kind in (kind for kind in chosen if kind not in acted and machines):
        raise InputError(
            f"{kind} = {chosen[kind]!r} in [units] acts on no machine: {_reason(kind, machines)}"
        )
    return found


def _fits(kind: str, name: str, row: UnitRow) -> bool:
    """Return whether a choice is for this machine: no record says otherwise, and the machine can have the part."""
    if kind == "machine":
        return row.parts.get("machine") == MACHINE_VARIANTS.get(name, name)
    classical = row.parts.get("machine") == "classical" and kind in ("exciter", *_ON_EXCITERS)
    return kind not in row.parts and not classical


def _reason(kind: str, machines: Sequence[UnitRow]) -> str:
    if kind != "machine":
        return "the DYR file has a record of it for every machine that can have one; remove the key"
    names = sorted({row.parts["machine"] for row in machines})
    variants = [variant for variant, of in MACHINE_VARIANTS.items() if of in names]
    there = (
        f"; beside its own name a record may become {', '.join(map(repr, variants))}"
        if variants
        else ""
    )
    known = ", ".join(names)
    return f"the records of the DYR file say what each machine is ({known}){there}; correct or remove the key"


def without_idle_controls(
    rows: Sequence[UnitRow], place: str, choosing: Collection[str] = ()
) -> list[UnitRow]:
    """The units without a stabiliser or a compensator where there is no exciter, with a question for each.

    PSS/E leaves them idle. ``place``: of a record whose line is not known; ``choosing``: labels of units for which the
    case names an exciter elsewhere than in [units]."""
    return [row if row.label in choosing else _without_idle_controls(row, place) for row in rows]


def _without_idle_controls(row: UnitRow, place: str) -> UnitRow:
    own = row.parameters.get("sg", {})
    if row.parts.get("exciter", MANUAL) != MANUAL or row.converter is not None:
        return row
    kinds = {
        kind: [name for name in own if name.partition(".")[0] in scopes]
        for kind, scopes in _IDLE.items()
    }
    kinds["compensator"] = [name for name in own if name in COMPENSATION]
    doubts = [
        DoubtOfRecord(
            names[0],
            f"{place}, line {row.lines[names[0]]}" if names[0] in row.lines else place,
            f"a {kind} at a machine without an exciter acts on nothing, as in PSS/E, and is left out; add the "
            "exciter's record, or choose one in [units], such as exciter = 'sexs'",
            f"a {kind} without an exciter",
        )
        for kind, names in kinds.items()
        if names
    ]
    idle = {name for names in kinds.values() for name in names}
    return replace(
        row,
        parts={kind: part for kind, part in row.parts.items() if kind not in _ON_EXCITERS},
        parameters={**row.parameters, "sg": {k: x for k, x in own.items() if k not in idle}},
        doubts=(*row.doubts, *doubts),
    )


def missing_records(rows: Sequence[UnitRow], place: str) -> Iterator[UnusualValue]:
    """Ask about machines without an exciter or a governor where others have one, or all have the other of both."""
    for (kind, quantity), other in zip(_CONSTANT.items(), reversed(_CONSTANT), strict=True):
        able = [row for row in rows if _can_have(kind, row)]
        without = [row for row in able if kind not in row.parts and not row.partial]
        having = len(able) - len(without)
        all_other = (
            kind == "governor" and len(able) >= _OTHERS and all(other in row.parts for row in able)
        )
        if not without or not (having >= _OTHERS or (not having and all_other)):
            continue
        where = (
            f"{having} of {len(able)} machines have one"
            if having
            else f"every machine has its {other}'s"
        )
        chosen = next(
            (row.parts[kind] for row in able if kind in row.parts),
            {"governor": "tgov1"}.get(kind, "sexs"),
        )
        text = (
            f"no record of {'an' if kind == 'exciter' else 'a'} {kind}, where {where}: the {quantity} is constant; add "
            f"the record, or choose a part in [units], such as {kind} = {chosen!r}"
        )
        asked = f"no record of the {kind}"
        yield from (UnusualValue(f"sg{row.label}.{kind}", place, text, asked) for row in without)


def _can_have(kind: str, row: UnitRow) -> bool:
    if row.converter is not None or row.parts.get("machine") == "classical":
        return False
    return kind != "governor" or abs(row.p_mw) > _CONDENSER * row.rating_mva


def completed(rows: Sequence[UnitRow], replaced: Collection[str]) -> list[UnitRow]:
    """The units with what PSS/E assumes for every part that nothing says, also where a record of it is left out."""
    return [
        row
        if row.converter or row.label in replaced
        else replace(row, parts={**_WITHOUT, **row.parts})
        for row in rows
    ]


def rows_of_machines(machines: Sequence[Machine], place: str) -> list[UnitRow]:
    """A unit for each machine, in their order, without what it is made of."""
    at_bus: dict[int, list[Machine]] = {}
    for machine in machines:
        at_bus.setdefault(machine.bus, []).append(machine)
    labels = unit_labels(machines)
    rows = []
    for machine in machines:
        here = at_bus[machine.bus]
        row = UnitRow(
            labels[machine.bus, machine.name.strip()],
            bus_name(str(machine.bus)),
            machine.rating_mva,
            machine.p_mw,
            machine.v_pu,
            place=place,
            q_min_mvar=sum(m.q_min_mvar for m in here),
            q_max_mvar=sum(m.q_max_mvar for m in here),
            p_min_mw=machine.p_min_mw,
            p_max_mw=machine.p_max_mw,
            likely_mva=machine.likely_mva,
        )
        rows.append(checked(row, place, is_base=True))
    return rows


def with_infinite_buses(rows: Sequence[UnitRow], machines: Sequence[Machine]) -> list[UnitRow]:
    """The units of a network without dynamics data, those in the place of missing machines as infinite buses."""
    infinite = {bus_name(str(machine.bus)): machine for machine in machines if machine.is_infinite}
    return [
        replace(
            row,
            is_infinite=True,
            parts={"machine": CLASSICAL, **_WITHOUT},
            parameters={"sg": {**WITHOUT_INERTIA, "machine.X_d1": infinite[row.bus].source.imag}},
        )
        if row.bus in infinite
        else row
        for row in rows
    ]


def at_their_devices(
    records: Sequence[DynamicRecord], machines: Sequence[Machine]
) -> list[DynamicRecord]:
    """The records, those that name a FACTS device as of the unit that stands for it."""
    units = {machine.name: machine.bus for machine in machines}
    return [
        replace(record, bus=units[record.machine], line_of_dc="")
        if record.name in OF_FACTS and record.machine in units
        else record
        for record in records
    ]


def with_known_buses(
    rows: Sequence[UnitRow], same: Mapping[int, int], known: Collection[str]
) -> list[UnitRow]:
    """The units with compensators that hold the voltage of a bus of the network; else their own, which is asked about.

    ``same``: bus → the one that stands for both; ``known``: names of the buses of the network."""
    return [_with_known_bus(row, same, known) for row in rows]


def _with_known_bus(row: UnitRow, same: Mapping[int, int], known: Collection[str]) -> UnitRow:
    point = row.measured
    if point is None or not point.of_voltage:
        return row
    bus = same.get(point.bus, point.bus)
    name = bus_name(str(bus))
    is_own = name == row.bus
    if name in known and not is_own:
        return replace(row, measured=replace(point, bus=bus))
    text = (
        f"{point.record} has {HELD_BUS} = {point.bus}, a bus that the network has not, or has out of service: it holds "
        "the voltage of its own bus instead; correct it, or write 0"
    )
    kind = f"{point.record} that holds a bus that is not there"
    doubt = DoubtOfRecord("held", point.place, text, kind)
    return replace(
        row, parts={}, measured=None, doubts=row.doubts if is_own else (*row.doubts, doubt)
    )


def _without_active_power(row: UnitRow) -> UnitRow:
    """Return a compensator's unit, which has no part in what an outage takes away, whatever PT and PB say."""
    return replace(row, p_min_mw=0.0, p_max_mw=0.0)


def named_by_bus(
    records: Sequence[DynamicRecord], leaving_out: Sequence[str]
) -> list[DynamicRecord]:
    """Give records that a name such as ``WSIEG1 at 3106`` leaves out that name as their model's.

    What leaves out a model by its name then leaves out the records of one bus alone."""
    named = {name.upper() for name in leaving_out}
    return [
        replace(one, name=one.name_at_bus) if one.name_at_bus in named else one for one in records
    ]


def with_records(
    rows: Sequence[UnitRow],
    machines: Sequence[Machine],
    records: Sequence[DynamicRecord],
    leaving_out: Sequence[str],
    without: Collection[str],
    idle: Collection[tuple[int, str]] = (),
    *,
    approximate: bool = False,
) -> list[UnitRow]:
    """The units with what the records say of them."""
    keys = [(machine.bus, machine.name.strip()) for machine in machines]
    replaced = {key for key, row in zip(keys, rows, strict=True) if row.label in without}
    models = machine_models(records, machines, leaving_out, replaced, idle, approximate=approximate)
    found = []
    static = {key for key, model in models.items() if model.converter == STATIC}
    powers = {key: machine.p_mw for key, machine in zip(keys, machines, strict=True)}
    share = share_of_power(sum(powers[key] for key in static), sum(powers.values()))
    for key, row in zip(keys, rows, strict=True):
        model = models.get(key)
        if model is None:
            found.append(row)
        elif model.converter is None:
            own = {"sg": model.parameters}
            of_records = replace(row, parameters=own, parts=model.parts, partial=model.partial)
            found.append(replace(of_records, doubts=model.doubts, lines=model.lines))
        else:
            of_converter = dict(model.parameters)
            rating = of_converter.pop(
                "S_n", row.rating_mva
            )  # of a record that says its base itself
            found.append(
                replace(
                    _without_active_power(row) if model.converter in COMPENSATORS else row,
                    rating_mva=rating,
                    parameters={"gfor": of_converter},
                    parts=model.parts,
                    converter=model.converter,
                    replaced=model.replaced,
                    measured=model.measured,
                    doubts=(_doubt_of_static(row, share),) if key in static else model.doubts,
                    lines=model.lines,
                )
            )
    return found


def _doubt_of_static(row: UnitRow, share: str) -> DoubtOfRecord:
    """Ask about a machine without a record; ``share``: what all of them feed, in words."""
    fed = f"; all such machines feed {share}" if share else ""
    text = (
        "no record of the machine, whose power is taken as a constant current (static generation): it holds no voltage "
        f"and adds no inertia{fed}; add its records, or name it in [units] replace for a converter of ours"
    )
    return DoubtOfRecord("machine", row.place, text, "a machine without a record")
