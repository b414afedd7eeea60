"""A CGMES model as tables of a network source."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.bus_loads import BusLoads
from orchestrator.cases.networks.cgmes.branches import (
    BASE_MVA,
    Branch,
    branch,
    finite,
    lines,
    stars,
    transformers,
)
from orchestrator.cases.networks.cgmes.files import load_cgmes, profiles_of
from orchestrator.cases.networks.cgmes.reference import Reference, dynamics_of, reference_of
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.regions import Region
from orchestrator.cases.networks.source_changes import Changes
from orchestrator.cases.networks.sources import SourceTables
from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import InputError, Problem, few
from orchestrator.core.foreign_files import one_line

_TABLES = {
    "static var compensator": "get_static_var_compensators",
    "hvdc line": "get_hvdc_lines",
    "dc line": "get_dc_lines",
    "battery": "get_batteries",
}
LEFT_OUT = (*_TABLES, "island")
"""Elements that our network does not have, and parts of it that nothing joins to the largest; `leave_out` of the case
names those that may go."""

_NAMED = (
    "get_lines",
    "get_2_windings_transformers",
    "get_3_windings_transformers",
    "get_boundary_lines",
)
"""Tables of branches with names; the legs of a transformer of three windings have its own."""

_NO_LIMIT = 9998.0  # mvar and MW by which exports say that there is no limit
_ONE_LEVEL = 1.05  # nominal voltages with a larger ratio are two levels of voltage
# MVA; an unknown rating is 9999 in exports, and pypowsybl's is the largest number there is
_MOST_RATING = 9998.0


@dataclass(frozen=True)
class CgmesNetwork:
    """A model's tables, what was taken over in another form, and known ratings [MVA] by the bus' label."""

    tables: SourceTables
    changes: tuple[Problem, ...]
    ratings: dict[str, float]


def read_cgmes(path: Path, leaving_out: Sequence[str] = ()) -> CgmesNetwork:
    unknown = [kind for kind in leaving_out if kind not in LEFT_OUT]
    if unknown:
        raise InputError(
            f"leave_out: {unknown[0]!r} is unknown for CGMES; choose from {', '.join(LEFT_OUT)}"
        )
    files = [path] if path.exists() else []
    files = sorted(path.iterdir()) if path.is_dir() else files
    return _read(
        path, tuple((str(f.resolve()), f.stat().st_mtime_ns) for f in files), tuple(leaving_out)
    )


@lru_cache(maxsize=4)
def _read(
    path: Path, versions: tuple[tuple[str, int], ...], leaving_out: tuple[str, ...]
) -> CgmesNetwork:
    """The network; ``versions`` keep newer contents apart. Every scenario of a case asks."""
    profiles = profiles_of(path)
    found = convert(
        str(path), load_cgmes(path, profiles), leaving_out, reference=reference_of(profiles)
    )
    dynamics = dynamics_of(profiles)
    if not dynamics:
        return found
    listed = ", ".join(f"{count} {name}" for name, count in sorted(dynamics.items()))
    text = f"the profile DY has {listed}: not read; what the machines are stands in [units] and [components]"
    return replace(found, changes=(*found.changes, Problem(str(path), text)))


def convert(
    place: str,
    source: Any,
    leaving_out: Sequence[str] = (),
    *,
    reference: Reference = Reference(),  # noqa: B008 - frozen
) -> CgmesNetwork:
    return _Reading(place, source, reference).network(leaving_out)


class _Reading:
    def __init__(self, place: str, source: Any, reference: Reference) -> None:
        self._place, self._source, self._reference = place, source, reference
        self._changes = Changes(place, "element")
        self._nominal: dict[str, float] = {}
        self._numbers: dict[str, int] = {}
        self._labels: dict[str, str] = {}
        self._titles: dict[str, str] = {}
        self._regions: dict[str, Region] = {}
        self._tables_of_names: dict[str, dict[str, str]] = {}
        self._volts: dict[str, float] = {}
        self._rows: list[list[float]] = []
        self._branches: list[Branch] = []
        self._loads: dict[int, BusLoads] = {}

    def network(self, leaving_out: Sequence[str]) -> CgmesNetwork:
        self._refuse(leaving_out)
        self._buses(leaving_out)
        self._injections()
        self._lines()
        self._branches += transformers(self._source, self._nominal)
        for star, legs in stars(self._source, self._nominal):
            self._inner(star)
            self._branches += legs
        self._boundaries()
        self._taps()
        gen = self._generators()
        tables = self._tables(gen)
        ratings: dict[str, float] = {}
        for row in gen:
            label = tables.labels[int(row[0])]
            ratings[label] = ratings.get(label, 0.0) + row[6]
        return CgmesNetwork(
            tables,
            tuple(self._changes.as_problems()),
            {n: r for n, r in ratings.items() if r < _MOST_RATING},
        )

    def _tables(self, generators: Matrix) -> SourceTables:
        """Everything read so far, as tables of buses by their numbers."""
        numbers = self._numbers
        branches = [
            [numbers[b.start], numbers[b.end], b.z.real, b.z.imag, 0, 0, 0, 0, b.tap, b.shift, 1]
            for b in self._branches
        ]
        to_earth = np.array([b.to_earth for b in self._branches], dtype=complex)
        labels = {number: self._labels[bus] for bus, number in numbers.items()}
        titles = {numbers[bus]: title for bus, title in self._titles.items() if bus in numbers}
        regions = {numbers[bus]: x for bus, x in self._regions.items() if bus in numbers}
        feeding = {number: loads.apart().feeding for number, loads in self._loads.items()}
        return SourceTables(
            name=self._place,
            base_mva=BASE_MVA,
            bus=np.array(self._rows),
            branch=np.array(branches, dtype=float).reshape(-1, 11),
            gen=generators,
            branch_to_earth=to_earth.reshape(-1, 2),
            labels=labels,
            titles=titles,
            branch_names=tuple(BranchName(self._title_of(b.name)) for b in self._branches),
            regions=regions,
            feeding={number: fed for number, fed in feeding.items() if fed.power},
        )

    def _refuse(self, leaving_out: Sequence[str]) -> None:
        refused = {}
        for kind, getter in _TABLES.items():
            names = [str(name) for name in getattr(self._source, getter)().index]
            for name in names if kind in leaving_out else ():
                self._changes.note(name, f"{kind}: left out, as leave_out says")
            if names and kind not in leaving_out:
                refused[kind] = names
        if refused:
            listed = "; ".join(f"{kind} ({few(names, 8)})" for kind, names in refused.items())
            raise InputError.at(
                self._place,
                f"the network has no such elements: {listed}; to go on without them, write "
                f"{without_kinds([*refused])}, and put what they feed or draw into loads",
            )

    def _buses(self, leaving_out: Sequence[str]) -> None:
        buses = self._source.get_buses(all_attributes=True)
        levels = self._source.get_voltage_levels()["nominal_v"]
        self._regions = self._regions_of(buses)
        generators = self._source.get_generators(all_attributes=True)
        fed = set(generators[generators.connected].bus_id)
        islands: dict[int, list[str]] = {}
        for row in buses.itertuples():
            islands.setdefault(int(row.synchronous_component), []).append(row.Index)
        live = [members for members in islands.values() if fed & {*members}]
        if not live:
            raise InputError.at(
                self._place, "no generator in service feeds a bus; export the solved model"
            )
        live.sort(key=len, reverse=True)
        if len(live) > 1 and "island" not in leaving_out:
            sizes = ", ".join(str(len(members)) for members in live)
            raise InputError.at(
                self._place,
                f"{len(live)} parts of the network with generators are not joined by lines "
                f"(buses: {sizes}); study each on its own: to keep the largest, write "
                f"{without_kinds(['island'])}",
            )
        kept = {*live[0]}
        named = self._bus_names(buses)
        for row in buses.itertuples():
            if row.Index not in kept:
                text = (
                    "bus: left out, as leave_out says"
                    if any(row.Index in x for x in live[1:])
                    else ("bus without a generator on its part of the network: left out")
                )
                self._changes.note(named[row.Index], text)
                continue
            nominal = float(levels[row.voltage_level_id])
            if not nominal > 0:
                raise InputError.at(
                    self._place,
                    f"bus {named[row.Index]} has the nominal voltage {nominal:g} kV; it must "
                    "exceed 0",
                )
            self._nominal[row.Index] = nominal
            self._volts[row.Index] = float(row.v_mag) / nominal
            self._add_bus(row.Index, named[row.Index])
            if math.isfinite(row.v_mag) and math.isfinite(row.v_angle):
                self._rows[-1][7:] = self._volts[row.Index], float(row.v_angle)
        for bus in self._slack(generators, kept):
            self._rows[self._numbers[bus]][1] = 3

    def _slack(self, generators: Any, kept: set[str]) -> set[str]:
        """The bus of the slack: pypowsybl's, else by SSH's priorities, else SV's angle reference with a unit."""
        found = {*self._source.get_extensions("slackTerminal").bus_id} & kept
        units = generators[generators.connected & generators.bus_id.isin(kept)]
        for name in (name for name in self._reference.units if name in units.index):
            return found or {units.bus_id[name]}
        nodes = self._source.get_bus_breaker_view_buses()
        for node in (node for node in self._reference.nodes if node in nodes.index):
            bus = nodes.bus_id[node]
            if bus in {*units.bus_id}:
                return found or {bus}
        return found

    def _regions_of(self, buses: Any) -> dict[str, Region]:
        """Return the substation of each bus, and its SubGeographicalRegion as the area."""
        station_of = self._source.get_voltage_levels().substation_id
        stations = self._source.get_substations(all_attributes=True)
        areas = stations.geo_tags if "geo_tags" in stations else {}
        found = {}
        for bus, level in buses.voltage_level_id.items():
            station = station_of.get(level, "")
            if station in stations.index:
                area, name = str(areas.get(station, "")), str(stations.name[station])
                found[str(bus)] = Region(one_line(area), station=one_line(name))
        return found

    def _bus_names(self, buses: Any) -> dict[str, str]:
        """The topological node's name where a bus is one and every name stands once, else the bus' own name or id."""
        nodes = self._source.get_bus_breaker_view_buses()
        of_bus: dict[str, list[str]] = {}
        for row in nodes.itertuples():
            of_bus.setdefault(row.bus_id, []).append(row.name or row.Index)
        found = {}
        names = dict(buses.name)
        only = {bus: own[0] for bus, own in of_bus.items() if len(own) == 1}
        by_node = {bus: only.get(bus, names[bus]) for bus in buses.index}
        for candidates in (by_node, names, dict(zip(buses.index, buses.index, strict=True))):
            found = {
                bus: re.sub(r"\W+", "_", str(name)).strip("_") for bus, name in candidates.items()
            }
            if all(found.values()) and max(Counter(found.values()).values(), default=0) <= 1:
                break
        self._titles = {
            bus: str(of_bus[bus][0] if len(of_bus.get(bus, ())) == 1 else buses.name[bus]).strip()
            for bus in buses.index
        }
        return {
            bus: re.sub(r"^bus_+(?=\w)", "", name, flags=re.IGNORECASE)
            for bus, name in found.items()
        }

    def _title_of(self, branch: str) -> str:
        """Return the name (IdentifiedObject.name) of a line or transformer; "" if the model has none."""
        for getter in _NAMED:
            table = self._tables_of_names.setdefault(
                getter, dict(getattr(self._source, getter)()["name"])
            )
            if branch in table:
                return str(table[branch] or "").strip()
        return ""

    def _add_bus(self, bus: str, label: str) -> None:
        self._numbers[bus] = number = len(self._numbers)
        self._labels[bus] = label
        self._rows.append([number, 1, *[0.0] * 7])

    def _inner(self, bus: str) -> None:
        """Add a bus that the model itself does not have."""
        self._add_bus(bus, re.sub(r"\W+", "_", bus))

    def _add(self, bus: str, column: int, value: complex) -> None:
        self._rows[self._numbers[bus]][column] += value.real
        self._rows[self._numbers[bus]][column + 1] += value.imag

    def _lines(self) -> None:
        for line in lines(self._source, self._nominal):
            self._branches.append(line)
            one, two = sorted((self._nominal[line.start], self._nominal[line.end]))
            if two > _ONE_LEVEL * one and any(line.to_earth):
                self._changes.note(
                    line.name,
                    "line between two nominal voltages: taken as it is; CGMES has one charging for both of "
                    "its ends, so an export that wrote a transformer as a line has lost a part of it",
                )

    def _injections(self) -> None:
        for row in self._source.get_loads(all_attributes=True).itertuples():
            if row.connected and row.bus_id in self._numbers:
                drawn = complex(row.p0, row.q0)
                self._add(row.bus_id, 2, drawn)
                at_bus = self._loads.setdefault(self._numbers[row.bus_id], BusLoads())
                at_bus.add(drawn)
        for row in self._source.get_shunt_compensators(all_attributes=True).itertuples():
            if row.connected and row.bus_id in self._numbers:
                if row.voltage_regulation_on:
                    self._changes.note(row.Index, "switched shunt: held at its number of sections")
                self._add(row.bus_id, 4, complex(row.g, row.b) * self._nominal[row.bus_id] ** 2)

    def _boundaries(self) -> None:
        """Lines to a boundary: a pair meets at one bus; at the open end of another its exchange is a load."""
        table = self._source.get_boundary_lines(all_attributes=True)
        ties = self._source.get_tie_lines()
        meeting = {
            half: tie
            for tie, row in ties.iterrows()
            for half in (row.boundary_line1_id, row.boundary_line2_id)
        }
        made: set[str] = set()
        for row in table.itertuples():
            if not row.connected or row.bus_id not in self._nominal:
                continue
            bus = f"{meeting.get(row.Index, row.Index)}_boundary"
            if bus not in made:
                made.add(bus)
                self._inner(bus)
            nominal = self._nominal[row.bus_id]
            ends = row.bus_id, bus
            # the admittance stands at the model's side
            self._branches.append(
                branch(
                    row.Index,
                    ends,
                    (nominal, nominal),
                    complex(row.r, row.x),
                    (complex(row.g, row.b), 0j),
                )
            )
            if row.Index not in meeting:
                fed = complex(
                    getattr(row, "target_p", 0.0) or 0.0, getattr(row, "target_q", 0.0) or 0.0
                )
                self._changes.note(
                    row.Index, "line to a boundary: what it exchanges there is a load"
                )
                self._add(bus, 2, complex(row.p0, row.q0) - fed)

    def _taps(self) -> None:
        for kind, table in (
            ("ratio", self._source.get_ratio_tap_changers(all_attributes=True)),
            ("phase", self._source.get_phase_tap_changers(all_attributes=True)),
        ):
            for row in table.itertuples():
                name = row.Index[0] if isinstance(row.Index, tuple) else row.Index
                if row.regulating:
                    self._changes.note(
                        name, f"control of a {kind} tap changer: held at its position"
                    )
                if math.isfinite(row.solved_tap_position) and row.solved_tap_position != row.tap:
                    self._changes.note(
                        name,
                        f"{kind} tap changer: at SSH's position, which is not that of SV's solution",
                    )

    def _generators(self) -> Any:
        rows = []
        for row in self._source.get_generators(all_attributes=True).itertuples():
            if not row.connected or row.bus_id not in self._numbers:
                continue
            held = self._held_voltage(row)
            least, most = (
                finite(float(q), _NO_LIMIT) for q in (row.min_q_at_target_p, row.max_q_at_target_p)
            )
            # unknown
            rating = float(row.rated_s) if 0 < row.rated_s < _MOST_RATING else _MOST_RATING
            largest = float(row.max_p) if 0 < row.max_p < _NO_LIMIT else 0.0
            rows.append(
                [
                    self._numbers[row.bus_id],
                    row.target_p,
                    0,
                    most,
                    least,
                    held,
                    rating,
                    1,
                    largest,
                    0,
                ]
            )
        return np.array(rows, dtype=float).reshape(-1, 10)

    def _held_voltage(self, row: Any) -> float:
        """Voltage that a generator holds at its bus [pu]."""
        bus = row.bus_id
        if row.voltage_regulator_on and row.regulated_bus_id == bus and row.target_v > 0:
            return float(row.target_v) / self._nominal[bus]
        remote = row.voltage_regulator_on and row.regulated_bus_id != bus
        text = (
            "voltage control of another bus: its own is held at SV's voltage"
            if remote
            else "generator without voltage control: it holds SV's voltage"
        )
        self._changes.note(row.Index, text)
        if not math.isfinite(self._volts[bus]):
            raise InputError.at(
                self._place,
                f"the generator {row.Index} holds no voltage of its own, and SV has none of "
                "its bus; export the solved model",
            )
        return self._volts[bus]
