"""The network of a case: written out in tables and files, taken from another program's data, or both."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from fmus.grid.network import Line, Load, Shunt, ThreeWinding
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import inner_buses
from orchestrator.cases.flow.beside_file import FileVoltages, complete_voltages
from orchestrator.cases.form.csv_rows import (
    Row,
    number,
    optional_number,
    place_of,
    rows_of,
    seen_from_here,
)
from orchestrator.cases.form.remedies import with_frequency
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.branch_keys import BranchKey
from orchestrator.cases.networks.branch_limits import FileLimits
from orchestrator.cases.networks.cgmes.network import read_cgmes
from orchestrator.cases.networks.controls import Control, with_controls
from orchestrator.cases.networks.conversion import (
    Generation,
    ImportedNetwork,
    branch_names,
    bus_of,
    import_network,
)
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.imported_flow import imported_equations
from orchestrator.cases.networks.load_models import (
    FlowLaws,
    device_laws,
    flow_laws,
    is_told,
    with_laws,
)
from orchestrator.cases.networks.psse.dc_line_models import SolvedLine, solved_lines
from orchestrator.cases.networks.psse.device_flow import SolvedDevices, solved_devices
from orchestrator.cases.networks.psse.device_notes import device_notes
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.networks.psse.raw_network import FileLoad, Machine, RawNetwork, bus_of_unit
from orchestrator.cases.networks.psse.raw_uses import BY_MODEL
from orchestrator.cases.networks.psse.sequence_elements import CaseElements, SequenceReading
from orchestrator.cases.networks.psse.sequence_records import read_sequence_file
from orchestrator.cases.networks.psse.solution import half_digit, stated_voltages
from orchestrator.cases.networks.psse.static_vars import Modelled
from orchestrator.cases.networks.psse.studied_parts import (
    StudiedPart,
    choose_part,
    part_notes,
    reference_note,
)
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord
from orchestrator.cases.networks.regions import Regions
from orchestrator.cases.networks.sequence_data import SequenceData
from orchestrator.cases.networks.sources import SourceTables, read_matpower, read_pandapower
from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import InputError, Problem

_REFERENCE = 3  # code of a reference in the table of buses
_FREQUENCY = 60.0  # of a RAW file that does not say it, as PSS/E's own default [Hz]
_IN_OHMS = ("kv", "R_ohm", "X_ohm", "B_us")  # of a file of lines, in the place of R, X, B


@dataclass(frozen=True)
class _Source:
    """The network of another program, what was taken over in another form, and its machines."""

    network: ImportedNetwork
    changes: tuple[Problem, ...] = ()
    machines: tuple[Machine, ...] = ()
    idle: frozenset[tuple[int, str]] = frozenset()
    misfit: str = ""
    file_voltages: FileVoltages = field(default_factory=FileVoltages)
    records: tuple[RecordUse, ...] = ()
    device_loads: tuple[Load, ...] = ()  # in the place of DC lines and the like
    file_loads: tuple[FileLoad, ...] = ()
    controls: tuple[Control, ...] = ()  # taps and shunts that move after an outage
    counted_controls: str = ""  # how many could move, in words
    raw: RawNetwork | None = None  # what another file of the same program may name
    dc_lines: tuple[SolvedLine, ...] = ()  # DC lines with a model of their own


@dataclass(frozen=True)
class NetworkData:
    buses: tuple[str, ...] = ()
    lines: tuple[Line, ...] = ()
    loads: tuple[Load, ...] = ()
    shunts: tuple[Shunt, ...] = ()
    # power and voltage of the units at each bus
    generation: dict[str, Generation] = field(default_factory=dict)
    slack: str | None = None  # reference bus of the source
    frequency: float | None = None  # rated frequency [Hz]; None leaves every model's own
    stray_B: float = 0.0
    # file and line of the lines that a file holds, by name
    places: dict[str, str] = field(default_factory=dict)
    transformers: tuple[ThreeWinding, ...] = ()
    changes: tuple[Problem, ...] = ()
    # machines, idle_machines: machines in service, one by one, where the source is of PSS/E; bus and identifier of
    # those out of service
    machines: tuple[Machine, ...] = ()
    idle_machines: frozenset[tuple[int, str]] = frozenset()
    # feeding, capacitors: by bus, as the source has them: loads below zero [MW] and capacitors [Mvar]
    feeding: dict[str, float] = field(default_factory=dict)
    capacitors: dict[str, float] = field(default_factory=dict)
    misfit: str = ""  # what is wrong with the voltages that the source has as its solution
    file_voltages: FileVoltages = field(default_factory=FileVoltages)  # of a solved source
    # loads of which the source tells constant impedances and currents, by name: they follow the
    # voltage in a power flow that starts from another, as that of an outage does
    flow_laws: Mapping[str, FlowLaws] = field(default_factory=dict)
    records: tuple[RecordUse, ...] = ()  # what became of the records of the source
    device_loads: tuple[str, ...] = ()  # names of the loads in the place of DC lines and the like
    # ratings and bands of a RAW or MATPOWER file; those of other sources are not meant
    limits: FileLimits = field(default_factory=FileLimits)
    titles: Mapping[str, str] = field(default_factory=dict)  # names in the source's file, by bus
    branch_names: Mapping[str, BranchName] = field(default_factory=dict)  # as the source has them
    unit_names: Mapping[str, str] = field(default_factory=dict)  # of the generators, by bus
    regions: Regions = field(default_factory=Regions)  # area, zone, … of the buses
    # file_loads: loads one by one, where the source is of PSS/E; recorded_loads: names of those whose laws are of
    # records of dynamics data
    file_loads: tuple[FileLoad, ...] = ()
    recorded_loads: frozenset[str] = frozenset()
    told_loads: frozenset[str] = (
        frozenset()
    )  # names of those that the source's parts tell as a whole
    controls: tuple[Control, ...] = ()  # taps and shunts that move in the power flow of an outage
    counted_controls: str = ""  # how many could move, in words
    sequences: SequenceData | None = None  # of the negative and the zero sequence, from a file
    dc_lines: tuple[SolvedLine, ...] = ()  # DC lines with a model of their own
    merged: Mapping[int, int] = field(default_factory=dict)  # bus → the one that stands for both


def network_data(
    table: NetworkTable,
    directory: Path,
    slack: str | None = None,
    modelled: Modelled = (),
    *,
    modelled_lines: Collection[str] = (),
) -> NetworkData:
    """Buses, lines, loads and shunts of a network table, its files and its source included.

    ``slack``: the unit or bus that the case names as the reference. ``modelled``: see `read_raw`.
    ``modelled_lines``: names of DC lines with a record of dynamics data.

    Raises an `InputError` if a file is missing, lacks a column, holds something that is not a number, or a source holds
    something that the grid model does not have."""
    asking = (slack, modelled, frozenset(modelled_lines))
    found = _source(table, directory, asking)
    source = found.network
    lines = [
        Line(n, t.from_bus, t.to_bus, t.X, t.R, B=t.B, tap=t.tap, shift=t.shift, X_C=t.X_C)
        for n, t in table.lines.items()
    ]
    loads = [with_laws(Load(n, t.bus, t.p, t.q), table, t) for n, t in table.loads.items()]
    shunts = [Shunt(n, t.bus, t.g, t.b) for n, t in table.shunts.items()]
    transformers = [
        ThreeWinding(
            n, t.buses, _star(t.X_12, t.X_13, t.X_23), _star(t.R_12, t.R_13, t.R_23), t.tap, t.shift
        )
        for n, t in table.three_winding_transformers.items()
    ]
    in_file = _lines_of_file(directory / table.lines_file) if table.lines_file is not None else []
    lines += [line for line, _ in in_file]
    loads += _loads_of_file(table, directory)
    sequences = _sequences(found, table, directory, [*source.lines])
    buses = dict.fromkeys((*source.buses, *table.buses)) or _ends_of(lines, transformers)
    of_source = [
        with_laws(x, table, parts=source.load_parts.get(x.name, (0j, 0j))) for x in source.loads
    ]
    of_devices = [with_laws(x, table, device_laws(table)) for x in found.device_loads]
    places = {line.name: place for line, place in in_file}
    merged = found.raw.same if found.raw else {}
    device_loads = tuple(load.name for load in found.device_loads)
    changes, records = [*found.changes], [*found.records]
    if sequences is not None:
        changes += sequences.questions
        records += sequences.records
    return NetworkData(
        tuple(buses),
        (*source.lines, *lines),
        loads=(*of_source, *of_devices, *loads),
        shunts=(*source.shunts, *shunts),
        generation=source.generation,
        slack=source.slack,
        frequency=source.frequency if table.frequency is None else table.frequency,
        stray_B=table.stray_B,
        places=places,
        transformers=(*source.transformers, *transformers),
        changes=tuple(changes),
        machines=found.machines,
        idle_machines=found.idle,
        feeding=source.feeding,
        capacitors=source.capacitors,
        misfit=found.misfit,
        file_voltages=found.file_voltages,
        flow_laws=_laws_of_flow(source),
        told_loads=_told_loads(source),
        limits=_limits(table, source),
        records=tuple(records),
        titles=source.titles,
        branch_names=source.branch_names,
        unit_names=source.unit_names,
        regions=Regions.telling(source.regions, buses),
        device_loads=device_loads,
        file_loads=found.file_loads,
        controls=found.controls,
        counted_controls=found.counted_controls,
        sequences=_without_file(found) if sequences is None else sequences.data,
        dc_lines=found.dc_lines,
        merged=merged,
    )


def _loads_of_file(table: NetworkTable, directory: Path) -> list[Load]:
    """Return the loads of the table's file; none without one."""
    if table.loads_file is None:
        return []
    rows = rows_of(directory / table.loads_file, ("bus", "p_mw", "q_mvar"))
    loads = (
        Load(f"load_{row['bus']}", bus_name(row["bus"]), number(row, "p_mw"), number(row, "q_mvar"))
        for row in rows
    )
    return [with_laws(load, table) for load in loads]


def _ends_of(lines: Sequence[Line], transformers: Sequence[ThreeWinding]) -> dict[str, None]:
    """The buses at the ends of branches, which a network has that lists none."""
    ends = [bus for line in lines for bus in (line.from_bus, line.to_bus)]
    return dict.fromkeys([*ends, *(bus for x in transformers for bus in x.buses)])


def _told_loads(source: ImportedNetwork) -> frozenset[str]:
    """Names of the loads that the source tells part by part."""
    parts = source.load_parts
    return frozenset(x.name for x in source.loads if is_told(x, parts.get(x.name, (0j, 0j))))


def _laws_of_flow(source: ImportedNetwork) -> dict[str, FlowLaws]:
    """Laws of the loads of which a source tells constant impedances and currents."""
    parts = source.load_parts
    return {x.name: flow_laws(x, parts[x.name]) for x in source.loads if x.name in parts}


def _limits(table: NetworkTable, source: ImportedNetwork) -> FileLimits:
    """Ratings and bands of a RAW or MATPOWER file; those of other sources are not meant."""
    return source.limits if table.raw or table.matpower else FileLimits()


def _sequences(
    found: _Source, table: NetworkTable, directory: Path, lines: list[Line]
) -> SequenceReading | None:
    """Read the file of sequence data; None without one."""
    if table.seq is None:
        return None
    if found.raw is None:
        raise InputError(
            "seq is for networks of PSS/E: give the network as 'raw', or write ratios in [network.sequences]"
        )
    raw, buses = found.raw, set(found.network.buses)

    def bus_of_number(number: int) -> str | None:
        label = raw.tables.labels.get(raw.same.get(number, number))
        name = None if label is None else bus_of(label)
        return name if name in buses else None

    elements = CaseElements(
        _keys(raw),
        {line.name: line for line in lines},
        found.machines,
        raw.tables.base_mva,
        bus_of_number,
        frozenset({*raw.tables.labels, *raw.same}),
    )
    return SequenceReading(read_sequence_file(seen_from_here(directory / table.seq)), elements)


def _keys(raw: RawNetwork) -> dict[str, BranchKey]:
    """Return the keys of branches by the names of their lines."""
    named = zip(branch_names(raw.tables), raw.tables.branch_keys, strict=True)
    return {name: key for name, key in named if name is not None and key is not None}


def _without_file(found: _Source) -> SequenceData | None:
    """Return which branches are transformers, where the source tells."""
    if found.raw is None:
        return None
    keys = _keys(found.raw).items()
    return SequenceData(transformers=frozenset(name for name, key in keys if key.is_transformer))


def _star(one_two: float, one_three: float, two_three: float) -> tuple[float, float, float]:
    """Impedances of the windings in the star, from those between two windings each."""
    half = (one_two + one_three + two_three) / 2
    return half - two_three, half - one_three, half - one_two


def bus_name(label: str) -> str:
    """Name of a bus in FMU variables, which cannot begin with a digit: ``12`` → ``bus_12``."""
    return f"bus_{label}" if label[:1].isdigit() else label


_Asking = tuple[str | None, Modelled, frozenset[str]]
"""The unit or bus that the case names as the reference, and what has records of dynamics data: units, and DC lines."""


def _source(table: NetworkTable, directory: Path, asking: _Asking) -> _Source:
    imported = ImportedNetwork()
    if table.raw is not None:
        return _from_raw(directory / table.raw, table, asking)
    if table.keep_load_parts:
        raise InputError(
            "keep_load_parts is for networks of PSS/E; remove the key, or give the file as 'raw'"
        )
    if table.move_controls:
        raise InputError(
            "move_controls is for networks of PSS/E; remove the key, or give the file as 'raw'"
        )
    if table.cgmes is not None:
        return _from_cgmes(directory / table.cgmes, table)
    if table.leave_out:
        raise InputError(
            "leave_out is for networks of PSS/E and CGMES; remove the key, or give 'raw' or 'cgmes'"
        )
    if table.matpower is not None:
        path = seen_from_here(directory / table.matpower)
        tables = read_matpower(path)
        imported = import_network(tables)
        misfit = misfit_of(imported, tables.bus, tables.labels)
        stated = file_voltages(tables.bus, tables.labels)
        if table.frequency is None:
            text = "MATPOWER's cases hold no frequency: every model keeps its own, usually 50 Hz"
            text += f"; write it, such as {with_frequency(_FREQUENCY)}"
            changes = (Problem(str(path), text),)
            return _Source(imported, changes, misfit=misfit, file_voltages=stated)
        return _Source(imported, misfit=misfit, file_voltages=stated)
    if table.pandapower is not None:
        imported = import_network(read_pandapower(table.pandapower, directory))
    return _Source(imported)


@dataclass(frozen=True)
class _Asked:
    """A question to a RAW file: the file as it is now, and all that a case says of the network."""

    path: Path
    version: tuple[int, int]  # time of its last change [ns], and size [bytes]
    slack: str | None
    text: str  # the case's table as JSON, by which it is told from others
    modelled: Modelled
    modelled_lines: frozenset[str]
    table: NetworkTable = field(compare=False)


def _from_raw(path: Path, table: NetworkTable, asking: _Asking) -> _Source:
    """A network of PSS/E, which every scenario of a case asks for."""
    path = seen_from_here(path)
    state = path.stat() if path.is_file() else None
    version = (state.st_mtime_ns, state.st_size) if state else (0, 0)
    text = table.model_dump_json()
    slack, modelled, lines = asking
    asked = _Asked(
        path,
        version,
        slack,
        text,
        modelled=frozenset(modelled),
        modelled_lines=lines,
        table=table,
    )
    return _read_from_raw(asked)


@lru_cache(maxsize=2)
def _read_from_raw(asked: _Asked) -> _Source:
    """A network of PSS/E; the ratings of the machines are those of the file."""
    table = asked.table
    raw = read_raw(
        asked.path,
        table.leave_out,
        keep_load_parts=table.keep_load_parts,
        slack=asked.slack,
        modelled=asked.modelled,
    )
    if not raw.machines:
        raise InputError.at(
            f"{raw.tables.name}",
            "no generator is in service, so nothing feeds the network and nothing can "
            "swing; give a case with generators",
        )
    changes = [*raw.changes, *_doubts_on_frequency(raw.tables, table.frequency)]
    # the machines are those of the file
    needed = {bus for device in raw.devices for bus in device.places}
    imported = import_network(raw.tables, joined=False, needed=needed)
    imported = replace(imported, frequency=imported.frequency or _FREQUENCY)
    slack = bus_of_unit(asked.slack, raw.machines) if asked.slack else None
    part = _choose_part(raw, imported, slack)
    imported = part.network
    left = {x for x in raw.machines if bus_name(str(x.bus)) in part.left_buses}
    machines = tuple(x for x in raw.machines if x not in left)
    ratings = _ratings(machines, raw.tables.labels)
    changes += [Problem(raw.tables.name, text) for text in part_notes(part)]
    if imported.slack is None and slack is None and ratings:
        largest = max((bus for bus in ratings if bus in part.buses), key=ratings.__getitem__)
        imported = replace(imported, slack=largest)
        changes.append(Problem(raw.tables.name, reference_note(largest)))
    moving = with_controls(raw, imported)
    if table.move_controls:
        imported = moving.network
        text = (
            moving.in_words if moving.counts_in_words else "no tap and no switched shunt can move"
        )
        changes.append(Problem(raw.tables.name, text))
    solved = solved_devices(raw.devices, imported, stated_voltages(raw.tables.bus))
    lines = solved_lines(solved, asked.modelled_lines)
    modelled = [line.device for line in lines]
    changes += device_notes(solved, table, raw.tables.name, modelled)
    with_devices = replace(imported, loads=(*imported.loads, *solved.loads))
    misfit = misfit_of(with_devices, raw.tables.bus, raw.tables.labels, NOT_SOLVED)
    generation = {
        bus: replace(g, rating_mva=ratings[bus], is_rated=True)
        for bus, g in imported.generation.items()
    }
    by_model = {(own.section, own.line) for own in modelled}
    records = tuple(_with_words(x, solved, by_model) for x in raw.records)
    return _Source(
        replace(imported, generation=generation),
        tuple(changes),
        machines,
        raw.idle | {(x.bus, x.name.strip()) for x in left},
        misfit,
        file_voltages(raw.tables.bus, raw.tables.labels),
        records=records,
        device_loads=tuple(solved.loads_without(modelled)),
        dc_lines=tuple(lines),
        file_loads=raw.loads,
        controls=moving.controls if table.move_controls else (),
        counted_controls=moving.counts_in_words,
        raw=raw,
    )


def _doubts_on_frequency(file: SourceTables, given: float | None) -> list[Problem]:
    """Ask about a rated frequency [Hz] that the file does not say, or of which the case says another."""
    own, place = file.frequency, f"{file.name}, line 1"
    if own is None and given is None:
        text = f"BASFRQ, the sixth value, is missing or 0: {_FREQUENCY:g} Hz are taken"
        remedy = f"if it is another, write it, such as {with_frequency(50.0)}"
        return [Problem(place, f"{text}; {remedy}")]
    if given is not None and own is not None and own != given:
        text = f"BASFRQ is {own:g} Hz, and the case's frequency = {given:g} Hz counts; one of them is wrong"
        return [Problem(place, text)]
    return []


def _ratings(machines: Iterable[Machine], labels: Mapping[int, str]) -> dict[str, float]:
    """Likely ratings of machines [MVA], together by bus."""
    ratings: dict[str, float] = {}
    for machine in machines:
        bus = bus_name(labels[machine.bus])
        ratings[bus] = ratings.get(bus, 0.0) + machine.likely_mva
    return ratings


def _with_words(
    record: RecordUse, solved: SolvedDevices, by_model: Collection[tuple[str, int]]
) -> RecordUse:
    """Return a record's use with what its devices feed; ``by_model``: section and line of those with a model."""
    if (record.kind, record.line) in by_model:
        return replace(record, use=UseOfRecord.USED, why=BY_MODEL)
    return replace(record, why=solved.words_of(record.kind, record.line) or record.why)


def _choose_part(raw: RawNetwork, network: ImportedNetwork, slack: str | None) -> StudiedPart:
    """Return the part of a network that is studied; ``slack``: the bus that the case names."""
    references = [
        bus_of(raw.tables.labels[int(row[0])]) for row in raw.tables.bus if row[1] == _REFERENCE
    ]
    return choose_part(network, raw.devices, references, slack)


def _from_cgmes(path: Path, table: NetworkTable) -> _Source:
    """A network of CGMES; the ratings of the units are those of the model where it knows them."""
    model = read_cgmes(seen_from_here(path), table.leave_out)
    imported = import_network(model.tables)
    ratings = {bus_of(label): rating for label, rating in model.ratings.items()}
    generation = {
        bus: replace(g, rating_mva=ratings.get(bus, g.rating_mva), is_rated=bus in ratings)
        for bus, g in imported.generation.items()
    }
    # balances SV's losses
    slack = imported.slack or max(generation, key=lambda bus: generation[bus].p_mw)
    misfit = misfit_of(replace(imported, slack=slack), model.tables.bus, model.tables.labels)
    return _Source(
        replace(imported, generation=generation),
        model.changes,
        misfit=misfit,
        file_voltages=file_voltages(model.tables.bus, model.tables.labels),
    )


def _lines_of_file(path: Path) -> list[tuple[Line, str]]:
    lines = []
    ohms = "X_ohm" in next(iter(rows_of(path, ("from", "to"))), ())
    for row in rows_of(path, ("from", "to", *(_IN_OHMS if ohms else ("R", "X", "B")))):
        if not (row["from"] and row["to"]):
            raise InputError.at(
                place_of(row),
                f"from = {row['from']!r}, to = {row['to']!r}; name the bus at each end",
            )
        circuit = (row.get("circuit") or "").strip()
        if circuit and not (circuit.isascii() and circuit.isalnum()):
            raise InputError.at(
                place_of(row),
                f"circuit = {circuit!r}; it becomes part of a name: use letters and digits",
            )
        name = "_".join(
            ["line", row["from"], row["to"], *([circuit] if circuit not in ("", "1") else [])]
        )
        ends = bus_name(row["from"]), bus_name(row["to"])
        tap, shift = optional_number(row, "tap") or 1.0, optional_number(row, "shift") or 0.0
        X, R, B = _impedance(row)
        lines.append((Line(name, *ends, X, R, B, tap, shift), place_of(row)))
    return lines


def _impedance(row: Row) -> list[float]:
    """X, R and B [pu on 100 MVA], which a row gives so or in ohms and µS at its voltage."""
    given = [key for key in ("X", "X_ohm") if (row.get(key) or "").strip()]
    if len(given) == 2:
        raise InputError.at(place_of(row), "X and X_ohm are both given; leave one of them empty")
    if "X_ohm" not in row or given == ["X"]:
        return [number(row, key) for key in ("X", "R", "B")]
    kv, R, X, B = (number(row, key) for key in _IN_OHMS)
    if kv <= 0:
        raise InputError.at(
            place_of(row), f"kv = {kv:g}; ohms need the line's rated voltage, above 0"
        )
    z = kv**2 / SYSTEM_BASE_MVA
    return [X / z, R / z, B * 1e-6 * z]


_VM = 7  # columns of MATPOWER's table
_VA = 8
_SMALL = 1e-3  # part of the file's load that may be out of balance at a bus
_SHOWN = 3  # buses that are named; the others are counted
_COARSE = 5e-4
"""Half of the third digit of a magnitude [pu], which files give at least: 1.0 at every bus may be a round number."""
_COARSE_ANGLE = 0.05  # half of the first digit of an angle [degrees]

NOT_SOLVED = (
    "the file is not solved: every bus has VA = 0. The power flow is computed here, and what PSS/E takes from VM "
    "(parts of loads, some generators' voltages) is that of the file; export the solved case"
)


def file_voltages(bus: Matrix, labels: Mapping[int, str]) -> FileVoltages:
    """Return the voltages of a source; none if it is not solved, that is if all angles are 0.

    ``bus``, ``labels``: see `misfit_of`."""
    if not bus[:, _VA].any():
        return FileVoltages()
    stated = stated_voltages(bus)
    return FileVoltages({bus_of(labels[k]): v for k, v in stated.items()}, _rounding(bus))


def _rounding(bus: Matrix) -> float:
    """Return what the digits of a source's voltages leave open [pu]."""
    magnitudes, angles = half_digit(bus[:, _VM]), half_digit(bus[:, _VA])
    return float(min(magnitudes, _COARSE) + np.radians(min(angles, _COARSE_ANGLE)))


def misfit_of(
    network: ImportedNetwork, bus: Matrix, labels: Mapping[int, str], unsolved: str = ""
) -> str:
    """Return what does not fit; "" where all does, and ``unsolved`` where the file has no solution.

    ``bus``: MATPOWER's table with the voltages [pu, degrees]; ``labels``: names of its buses by number."""
    stated = file_voltages(bus, labels).at
    if network.slack is None or network.slack not in stated:
        return "" if bus[:, _VA].any() else unsolved
    places = [place for place in network.buses if place in stated]
    # of transformers with an open winding
    stars = [place for place in network.buses if place not in stated]
    buses = [*places, *stars, *(inner for x in network.transformers for inner in inner_buses(x))]
    equations = imported_equations(network, buses, {}, network.slack)
    known, matrix = len(places), equations.matrix
    voltages = complete_voltages(equations, {place: stated[place] for place in places})
    left = SYSTEM_BASE_MVA * (equations.fed - equations.powers(voltages))
    units = [k for k, place in enumerate(places) if place in network.generation]
    left[units], left[[equations.slack, *range(known, len(buses))]] = left[units].real, 0
    noise = SYSTEM_BASE_MVA * _rounding(bus) * abs(voltages) * (abs(matrix) @ np.ones(len(buses)))
    load = sum(x.p_mw for x in network.loads if x.p_mw > 0)
    found = [int(k) for k in np.argsort(-abs(left)) if abs(left[k]) > noise[k] + _SMALL * load]
    return _sentence({buses[k]: left[k] for k in found}, known) if found else ""


def _sentence(left: Mapping[str, complex], buses: int) -> str:
    shown = [
        f"{p.real:+.4g} MW {p.imag:+.4g} Mvar at {place}" for place, p in [*left.items()][:_SHOWN]
    ]
    more = f" and less at {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
    if len(left) == 1:
        likely = "its load, its shunt, its unit's power or a branch to a bus with a unit"
    elif 2 * len(left) > buses:
        likely = "voltages of another case, or angles that are not in degrees"
    else:
        likely = "a branch between these buses (its status, ratio, shift, impedance and base), or a load at the other"
    return (
        "the file's own solution (VM, VA) does not fit its data, so the power flow computed here is another: with "
        f"these voltages its data feed, beyond what the network takes away, {', '.join(shown)}{more}; look at {likely}"
    )
