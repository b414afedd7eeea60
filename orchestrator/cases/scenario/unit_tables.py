"""Generating units of a case, from rows of a file or generators of the network's source. A generator and a converter
share each unit."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from orchestrator.cases.draft import Draft, UnitOrigin
from orchestrator.cases.form.build_choices import PARTS, chosen_parts
from orchestrator.cases.form.csv_rows import (
    PLACE,
    Row,
    optional_number,
    place_of,
    rows_of,
    seen_from_here,
)
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.schema import ComponentTable, UnitsTable
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.networks.conversion import Generation
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.dyr import machines_without_record
from orchestrator.cases.networks.psse.dyr_counts import with_needed_counts
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, read_dyr
from orchestrator.cases.networks.psse.dyr_mistakes import WITHOUT_RECORD
from orchestrator.cases.networks.psse.dyr_units import (
    at_their_devices,
    completed,
    missing_records,
    named_by_bus,
    refuse_exciters_without_field,
    rows_of_machines,
    with_choices,
    with_infinite_buses,
    with_known_buses,
    with_records,
    without_idle_controls,
)
from orchestrator.cases.networks.psse.dyr_uses import record_uses
from orchestrator.cases.networks.psse.motor_loads import MotorLoad
from orchestrator.cases.networks.psse.raw_network import unit_labels
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.cases.networks.psse.second_records import (
    copies_of,
    question_of_copy,
    question_of_second,
    second_load_models,
    why_a_copy,
    why_a_second,
)
from orchestrator.cases.networks.psse.unused_models import unused_models
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord
from orchestrator.cases.networks.source_changes import Changes, Remark, kind_of
from orchestrator.cases.networks.source_ratings import with_needed_ratings
from orchestrator.cases.networks.unit_row import UnitRow, checked
from orchestrator.cases.questions.plausibility import question
from orchestrator.cases.scenario.dc_lines import dc_components, take_dc_lines
from orchestrator.cases.scenario.motor_components import Motors, motor_components, take_motors
from orchestrator.cases.scenario.plants_of_several import plant_components, take_plants
from orchestrator.cases.scenario.protection_relays import (
    TakenRelays,
    take_relays,
    take_wind_turbines,
)
from orchestrator.cases.scenario.recorded_loads import take_frequency, take_laws
from orchestrator.cases.scenario.removed_parts import without_removed_parts
from orchestrator.core.errors import InputError, Problem, few

UNIT_KINDS = ("sg", "gfor")  # first parts of the names of a unit's generator and converter
_MOST_NAMED = 8  # units or buses that an error lists; the others are counted
_EXCITER = ".exciter"  # end of a scenario's key that names one
_PHASOR = "_phasor"  # end of the names of phasor models
_SOURCES = ("raw", "matpower", "pandapower", "cgmes")  # keys of a network's file of another program
_LIMITS = ("q_min_mvar", "q_max_mvar")
_REMARKS = ("q_mvar", "name", "comment", "source")
"""Columns that say more to a reader; the power flow computes the reactive power."""

_COLUMNS = ("bus", "unit", "rating_mva", "p_mw", "v_pu", "alpha", *_LIMITS)


def unit_components(draft: Draft) -> dict[str, ComponentTable]:
    """Generators ``sg<label>`` with the share 1 − α and converters ``gfor<label>`` with the share α of each unit. A
    share of 0 gives no component.

    All names that any share can give are added to the draft's known names."""
    table = draft.given.case.units
    if table is None or (draft.found.network_failed and table.file is None):
        return {}
    try:
        table = _with_named_units(draft, table)
        rows, motors = _rows(draft, table)
    except InputError as error:
        if draft.found.network_failed:
            return {}  # figures that the source would have given are missing
        key = next((key for key in ("dyr", "file") if getattr(table, key) is not None), None)
        draft.note_unread(
            draft.given.place("units", key) if key else draft.given.place("units"), error
        )
        return {}
    draft.known |= {f"{kind}{row.label}" for row in rows for kind in UNIT_KINDS}
    draft.reactive_limits |= {row.bus: (row.q_min_mvar, row.q_max_mvar) for row in rows}
    for row in rows:
        if draft.data is not None and draft.data.buses and row.bus not in draft.data.buses:
            hint = close_names(
                row.bus, draft.data.buses, f"there are: {few(draft.data.buses, _MOST_NAMED)}"
            )
            text = f"the unit at bus {row.label}: the network has no bus {row.bus!r}; {hint}"
            draft.note_network(row.place or draft.given.place("units"), text)
    alphas = _alphas(draft, table, rows)
    models = (
        (table.generator, "generator_parameters", table.generator_parameters),
        (table.converter, "converter_parameters", table.converter_parameters),
    )
    components = {}
    for kind, (model, key, common) in zip(UNIT_KINDS, models, strict=True):
        for row in rows:
            share = alphas[row.label] if kind == "gfor" else 1 - alphas[row.label]
            if share > 0:
                own = {
                    "S_n": share * row.rating_mva,
                    "P_0": row.p_mw / row.rating_mva,
                    "v_0": row.v_pu,
                }
                values = {**common, **row.parameters.get(kind, {}), **own}
                name = f"{kind}{row.label}"
                parts: dict[str, Any] = {**chosen_parts(table), **row.parts} if kind == "sg" else {}
                if row.converter is not None or row.is_infinite:  # the row says all
                    values = {**row.parameters.get(kind, {}), **own}
                    parts = dict(row.parts)
                components[name] = ComponentTable(
                    model=_of_parts(model) if row.is_infinite else row.converter or model,
                    bus=row.bus,
                    parameters=values,
                    **parts,
                )
                of_row = frozenset((*row.parameters.get(kind, {}), *own))
                likely = None if row.likely_mva is None else share * row.likely_mva
                draft.origins[name] = UnitOrigin(
                    row.place or draft.given.place("units"), of_row, key, row.lines, likely
                )
                if row.measured is not None:
                    draft.measured[name] = row.measured
                draft.active_limits[name] = share * row.p_min_mw, share * row.p_max_mw
    others = motor_components(draft, motors) | plant_components(draft) | dc_components(draft)
    return components | others


def _rows(draft: Draft, table: UnitsTable) -> tuple[list[UnitRow], Sequence[MotorLoad]]:
    """Return the units of the table, and the loads that are motors."""
    generation = _generation(draft, table)
    if table.dyr is not None:
        return _rows_of_dyr(draft, table)
    rows = unit_rows(table, draft.given.directory, generation)
    if table.file is None and draft.data is not None:
        rows = with_infinite_buses(rows, draft.data.machines)
    return rows, ()


def _with_named_units(draft: Draft, table: UnitsTable) -> UnitsTable:
    """Return the table with the units by name where it replaces the machines without a record."""
    if WITHOUT_RECORD not in table.replace:
        return table
    machines = draft.data.machines if draft.data else ()
    units: list[str] = []
    fault = ""
    if table.dyr is None:
        fault = f"{WITHOUT_RECORD!r} is of a file of dynamics data, 'dyr', which is not given; name units"
    elif machines:
        records = read_dyr(seen_from_here(draft.given.directory / table.dyr))
        labels = unit_labels(machines)
        bare = machines_without_record(at_their_devices(records, machines), machines)
        units = [labels[key] for key in bare]
        fault = "" if units else f"{WITHOUT_RECORD!r}, and every machine has a record; take it out"
    if fault:
        draft.note(draft.given.place("units", "replace"), fault)
    others = [label for label in table.replace if label != WITHOUT_RECORD]
    return table.model_copy(update={"replace": [*others, *units]})


def _of_parts(generator: str) -> str:
    """Return the generator of parts in the form of a generator's model."""
    return f"synchronous_generator{_PHASOR if generator.endswith(_PHASOR) else ''}"


def _generation(draft: Draft, table: UnitsTable) -> Mapping[str, Generation]:
    """Return what the network's source has at each bus, without dynamics data with ratings that fit the power flow."""
    data, network, flow = draft.data, draft.given.case.network, draft.given.case.power_flow
    if data is None or network is None:
        return {}
    is_told = network.raw is not None and (bool(table.file) or not data.misfit)
    if flow is None or table.dyr or is_told:
        return data.generation
    wanted = _without_rating(table, draft.given.directory, data.generation)
    if not wanted:
        return data.generation
    slack = flow.slack or data.slack or ""
    slack = slack if slack in data.generation else bus_name(slack.removeprefix("sg"))
    found, texts = with_needed_ratings(
        data, slack, wanted, keep_limits=flow.reactive_limits is True
    )
    source = next(key for key in _SOURCES if getattr(network, key) is not None)
    place = draft.given.place("network", source)
    draft.found.questions += [Problem(place, text) for text in texts]
    return found


def _without_rating(
    table: UnitsTable, directory: Path, generation: Mapping[str, Generation]
) -> Collection[str]:
    """Return the buses whose rating is that of the network's source."""
    if table.file is None:
        return generation
    rows = _known_rows(seen_from_here(directory / table.file))
    return {
        bus_name(row["bus"])
        for row in rows
        if not _name_in(row) and optional_number(row, "rating_mva") is None
    } & generation.keys()


def unit_rows(
    table: UnitsTable, directory: Path, generation: Mapping[str, Generation]
) -> list[UnitRow]:
    """The units of a units table. Figures that its file leaves out come from the network's source."""
    if table.file is None:
        if not generation:
            raise InputError(
                "the key 'file' is missing; without it the units are the generators of the [network] source, "
                "which is not given or has none"
            )
        rows = [
            UnitRow(
                g.label,
                bus,
                g.rating_mva,
                g.p_mw,
                g.v_pu,
                q_min_mvar=g.q_min_mvar,
                q_max_mvar=g.q_max_mvar,
            )
            for bus, g in generation.items()
        ]
        return [checked(row, "the network's source") for row in rows]
    rows = []
    path = seen_from_here(directory / table.file)
    for entry in _known_rows(path):
        bus = bus_name(entry["bus"])
        name = _name_in(entry)
        # the source's figures are those of all units of the bus
        given = None if name else generation.get(bus)
        figures = {
            column: _figure(entry, column, given) for column in ("rating_mva", "p_mw", "v_pu")
        }
        missing = [column for column, value in figures.items() if value is None]
        if missing:
            raise InputError.at(
                place_of(entry),
                f"the unit at bus {entry['bus']} has no {', '.join(missing)}; add the column, "
                "or take the network from a source with a generator at this bus",
            )
        alpha = optional_number(entry, "alpha")
        if alpha is not None and not 0 <= alpha <= 1:
            raise InputError.at(
                place_of(entry), f"alpha = {alpha:g}; it must be a number from 0 to 1"
            )
        own = {kind: _parameters(entry, kind) for kind in UNIT_KINDS}
        limits = {c: value for c in _LIMITS if (value := _figure(entry, c, given)) is not None}
        numbers = {**figures, **limits}
        parts = {part: text.strip() for part in PARTS if (text := entry.get(part) or "").strip()}
        label = f"{entry['bus']}_{name}" if name else entry["bus"]
        unit = UnitRow(
            label,
            bus,
            **numbers,  # type: ignore[arg-type]
            alpha=alpha,
            parameters=own,
            place=place_of(entry),
            parts=parts,
        )
        rows.append(checked(unit, place_of(entry)))
    _require_names(rows, path)
    at_bus = {row.bus: [r for r in rows if r.bus == row.bus] for row in rows}
    least = {bus: sum(u.q_min_mvar for u in units) for bus, units in at_bus.items()}
    most = {bus: sum(u.q_max_mvar for u in units) for bus, units in at_bus.items()}
    reach = {bus: (least[bus], most[bus]) for bus in at_bus}
    return [
        replace(row, q_min_mvar=reach[row.bus][0], q_max_mvar=reach[row.bus][1]) for row in rows
    ]


def _name_in(entry: Row) -> str:
    """The unit's name among those of its bus; empty without one."""
    name = (entry.get("unit") or "").strip()
    if name and not re.fullmatch(r"\w+", name, re.ASCII):
        raise InputError.at(
            place_of(entry),
            f"unit = {name!r}; it becomes part of a name: use letters, digits and _",
        )
    return name


def _require_names(rows: Sequence[UnitRow], path: Path) -> None:
    at_bus = Counter(row.bus for row in rows)
    labels = Counter(row.label for row in rows)
    for row in rows:
        if labels[row.label] > 1 or (at_bus[row.bus] > 1 and bus_name(row.label) == row.bus):
            raise InputError.at(
                f"{path}",
                f"the bus of unit {row.label} has more than one row; give each row of this "
                "bus a name of its own in the column 'unit', or merge the rows",
            )


def _known_rows(path: Path) -> list[Row]:
    """The rows of a units' file; a column that nothing reads may be a misspelt one."""
    rows = rows_of(path, ("bus",))
    known = [*_COLUMNS, *UnitsTable.model_fields]
    for column in rows[0] if rows else ():
        kind = column.partition(".")[0]
        if column not in (*known, *_REMARKS, PLACE) and not ("." in column and kind in UNIT_KINDS):
            similar = [] if "." in column else known
            hint = close_names(
                column,
                similar,
                f"there are {', '.join(_COLUMNS)}, and sg.… and gfor.… with a parameter",
            )
            raise InputError.at(f"{path}, line 1", f"nothing reads the column {column!r}; {hint}")
    return rows


def _rows_of_dyr(draft: Draft, table: UnitsTable) -> tuple[list[UnitRow], Sequence[MotorLoad]]:
    """A unit for each machine of a RAW file, of what the DYR file names, and its loads that are motors.

    A converter alone needs no record."""
    if table.file is not None:
        raise InputError("'dyr' and 'file' both say what the units are; remove one of them")
    machines = draft.data.machines if draft.data else ()
    if (
        not machines
        and draft.given.case.network is not None
        and draft.given.case.network.raw is not None
    ):
        raise InputError.at(
            f"{draft.given.case.network.raw}",
            "no generator is in service (STAT = 0), so 'dyr' is of no machine",
        )
    if not machines:
        raise InputError(
            "'dyr' is for the machines of a network of PSS/E; give it as 'raw' in [network]"
        )
    path = seen_from_here(draft.given.directory / (table.dyr or ""))
    rows = rows_of_machines(machines, str(path))
    alphas = _alphas(draft, table, rows)
    replaced = [row.label for row in rows if alphas[row.label] == 1]
    idle = draft.data.idle_machines if draft.data else ()
    read = with_needed_counts(_without_copies(draft, read_dyr(path)))
    records = named_by_bus(at_their_devices(read, machines), table.dyr_leave_out)
    keys = [(machine.bus, machine.name.strip()) for machine in machines]
    ours = {key for key, row in zip(keys, rows, strict=True) if row.label in table.replace}
    refusals = Refusals()
    with refusals.keep():
        rows = with_records(
            rows,
            machines,
            [record for record in records if (record.bus, record.machine) not in ours],
            table.dyr_leave_out,
            replaced,
            idle,
            approximate=table.dyr_approximate,
        )
        refuse_exciters_without_field(rows, machines, records, replaced)
    if draft.data is not None:
        rows = with_known_buses(rows, draft.data.merged, draft.data.buses)
    motors = _account(draft, table, records, ours, refusals)
    rows = with_choices(rows, replaced, chosen_parts(table))
    rows = without_idle_controls(rows, str(path), _choosing_exciters(draft, rows))
    rows = without_removed_parts(draft, rows)
    machine_rows = [row for row in rows if row.label not in replaced]
    question(
        draft,
        [
            *(
                UnusualValue(
                    f"{_component(row)}.{doubt.variable}", doubt.place, doubt.text, doubt.kind
                )
                for row in machine_rows
                for doubt in row.doubts
            ),
            *missing_records(machine_rows, str(path)),
        ],
    )
    rows = completed(rows, replaced)
    changes = Changes(str(path))
    for row in rows:
        for line, text in row.replaced:
            begin = f"grid-following converter as {row.converter}: "
            changes.note(line, Remark(begin + text, begin + kind_of(text)))
    draft.found.questions += changes.as_problems()
    phasors = [row for row in rows if row.converter is not None]
    if phasors and not table.generator.endswith(_PHASOR):
        raise InputError.at(
            f"{path}",
            f"the unit at bus {phasors[0].label} is the phasor model "
            f"{phasors[0].converter}, and the generator {table.generator!r} is none; "
            "phasor models go together: write generator = 'synchronous_generator_phasor' "
            "in [units], converter = 'gfor_phasor' in [units], and model = 'phasor_grid' "
            "in [components.grid] (`gfor new --models phasor`)",
        )
    return rows, motors


def _component(row: UnitRow) -> str:
    """Return the name of a unit's component before it has one: a machine's, or a converter's."""
    return f"{'gfor' if row.converter else 'sg'}{row.label}"


def _choosing_exciters(draft: Draft, rows: Sequence[UnitRow]) -> set[str]:
    """Return labels of the units whose component, or a scenario, names an exciter."""
    case = draft.given.case
    patterns = [name for name, component in case.components.items() if component.exciter]
    for scenario in case.scenarios.values():
        patterns += [key.removesuffix(_EXCITER) for key in scenario.set if key.endswith(_EXCITER)]
    named = [row.label for row in rows]
    return {label for label in named for p in patterns if fnmatchcase(f"sg{label}", p)}


def _figure(entry: Row, column: str, given: Generation | None) -> float | None:
    """The figure of the file, or otherwise of the source."""
    value = optional_number(entry, column)
    return getattr(given, column, None) if value is None else value


def _parameters(entry: Row, kind: str) -> dict[str, Any]:
    """Values of this row in columns such as ``sg.machine.H``: numbers, truth values or texts with a unit."""
    values: dict[str, Any] = {}
    for column, text in entry.items():
        if column.startswith(f"{kind}.") and (text or "").strip():
            name, plain = column.removeprefix(f"{kind}."), text.strip()
            values[name] = {"true": True, "false": False}.get(plain.lower(), plain)
    return values


def _without_copies(draft: Draft, records: Sequence[DynamicRecord]) -> list[DynamicRecord]:
    """Return records without copies of others, which are accounted for and asked about."""
    copies = copies_of(records)
    for copy, first in copies.items():
        use = RecordUse(
            copy.file, copy.line, copy.name, UseOfRecord.NOT_USED, why=why_a_copy(first)
        )
        draft.found.records.append(use)
        draft.found.questions.append(question_of_copy(copy, first))
    return [record for record in records if record not in copies]


def _account(
    draft: Draft,
    table: UnitsTable,
    records: Sequence[DynamicRecord],
    ours: Collection[tuple[int, str]],
    refusals: Refusals,
) -> Sequence[MotorLoad]:
    """Note what became of each record of a DYR file, and ask about those of no machine that could matter.

    ``ours``: machines that a converter of the case replaces; ``refusals``: of the records of machines, which are told
    with those of others. Returns the loads that are motors."""
    machines = draft.data.machines if draft.data else ()
    uses = record_uses(
        records,
        {(machine.bus, machine.name.strip()) for machine in machines},
        draft.data.idle_machines if draft.data else (),
        table.dyr_leave_out,
        approximate=table.dyr_approximate,
        exciter=table.exciter,
        ours=ours,
    )
    left = {name.upper() for name in table.dyr_leave_out}
    wanted = [record for record in records if record.name not in left]
    motors, relays, taken = Motors(), TakenRelays(), frozenset[tuple[str, int]]()
    file_loads = draft.data.file_loads if draft.data else ()
    with refusals.keep():
        motors = take_motors(draft, table, records)
    taken |= take_laws(draft, wanted) | take_frequency(draft, wanted)
    with refusals.keep():
        taken |= motors.places | take_plants(draft, table, wanted, ours)
    with refusals.keep():
        taken |= take_dc_lines(draft, table, wanted)
    with refusals.keep():
        relays = take_relays(draft, wanted, file_loads)
    take_wind_turbines(draft, records)
    refusals.tell()
    taken |= relays.places
    seconds = {}
    for record, first in second_load_models(wanted, taken).items():
        seconds[record.file, record.line] = why_a_second(record, first)
        draft.found.questions.append(question_of_second(record, first))
    uses = [_as_taken(use, taken, seconds, relays.unused) for use in uses]
    draft.found.records += uses
    network = draft.given.case.network
    said = network.load_model if network else None
    among_phasors = table.generator.endswith(_PHASOR)
    draft.found.questions += unused_models(
        records, uses, said, among_phasors=among_phasors, labels=unit_labels(machines)
    )
    return motors.loads


def _as_taken(
    use: RecordUse,
    taken: Collection[tuple[str, int]],
    seconds: Mapping[tuple[str, int], str],
    unused: Mapping[tuple[str, int], str],
) -> RecordUse:
    """Return the use of a record whose place may be taken, or have a reason why it is not.

    ``seconds``: reasons of further models of loads; ``unused``: of relays."""
    place = use.file, use.line
    if place in taken:
        return replace(use, use=UseOfRecord.USED, why="", of_no_machine=False)
    if place in seconds:
        return replace(use, why=seconds[place], of_no_machine=False)
    return replace(use, why=unused.get(place, use.why))


def _alphas(draft: Draft, table: UnitsTable, rows: Sequence[UnitRow]) -> dict[str, float]:
    """Share of every unit: from the strongest layer that gives one, otherwise from the row, otherwise from the table.

    Within a layer, a choice for this unit goes before the one for all."""
    alphas = {row.label: table.alpha if row.alpha is None else row.alpha for row in rows}
    for label in table.replace:
        if label not in alphas:
            known = [*alphas, WITHOUT_RECORD] if table.dyr else [*alphas]
            hint = close_names(label, known, f"there are: {few(alphas, _MOST_NAMED)}")
            draft.note(draft.given.place("units", "replace"), f"there is no unit {label!r}; {hint}")
            continue
        alphas[label] = 1.0
    converters = {row.label: row.converter for row in rows if row.converter is not None}
    for choice in (choice for layer in draft.given.layers for choice in layer.shares):
        label = choice.label
        if label and label not in alphas:
            hint = close_names(label, alphas, f"there are: {few(alphas, _MOST_NAMED)}")
            draft.note(choice.place, f"there is no unit {label!r}; {hint}")
            continue
        try:
            alphas |= {label: choice.share} if label else dict.fromkeys(alphas, choice.share)
        except ValueError as error:
            draft.note(choice.place, str(error))
            continue
        if label in converters and choice.share != 1:
            text = f"the unit {label!r} is a converter by its record ({converters[label]}); alpha is 1 there"
            draft.note(choice.place, text)
    return alphas | dict.fromkeys(converters, 1.0)
