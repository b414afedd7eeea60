"""Tables of pandapower's networks, kept between runs: pandapower takes seconds to import and to solve a network.

The name of a kept file is a hash of the network, of the versions of what made the tables, and of the code that did."""

import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.cache import CacheError, cache_directory, intact, keep, key_of
from fmus.toolchain.extras import installed_version
from orchestrator.cases.networks.branch_keys import BranchKey
from orchestrator.cases.networks.bus_loads import LoadSum
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.regions import Region
from orchestrator.core.arrays import Matrix


@dataclass(frozen=True)
class SourceTables:
    """MATPOWER's tables of a network, its columns in MATPOWER's order."""

    name: str
    base_mva: float
    bus: Matrix
    branch: Matrix
    gen: Matrix
    # conductance and susceptance to earth at both ends of every branch [pu]: g + jb behind the ratio at the from side,
    # and at the to side
    branch_to_earth: NDArray[np.complex128]
    labels: dict[int, str]  # number of a bus → what people call it
    frequency: float | None = None  # rated frequency [Hz], where the source knows it
    # number of a bus → what its loads draw as constant impedance and as constant current [MW, Mvar], where the source
    # tells them apart; the rest of the bus' load is as the case says
    load_parts: dict[int, tuple[complex, complex]] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)  # number of a bus → its name in the file
    # number of a bus whose loads have both signs → those below zero, which the bus' row and its parts hold as well
    feeding: dict[int, LoadSum] = field(default_factory=dict)
    branch_names: tuple[BranchName, ...] = ()  # one for each branch, where the file names them
    # one for each branch, where another file of the source's program may name it
    branch_keys: tuple[BranchKey | None, ...] = ()
    unit_names: dict[int, str] = field(
        default_factory=dict
    )  # of the generators at a bus, by its number
    regions: dict[int, Region] = field(default_factory=dict)  # area, zone, … by a bus' number


LIBRARIES = ("pandapower", "numpy", "scipy", "pandas", "lightsim2grid")
"""What the tables depend on beside our code; pandapower takes the last where it is installed."""

_NAMES = ("kept_tables.py", "sources.py", "pandapower_json.py")
_FILES = [Path(__file__).with_name(name) for name in _NAMES]
_CODE = "".join(file.read_text(encoding="utf-8") for file in _FILES)
"""What is loaded, if it is the same when tables are kept."""


def kept_tables(name: str, content: bytes, make: Callable[[], SourceTables]) -> SourceTables:
    """The tables of a network as they are kept, or else as they are made, and kept for the next time."""
    versions = {library: installed_version(library) for library in LIBRARIES}
    if not versions["pandapower"]:
        return make()
    parts = [name, hashlib.sha256(content).hexdigest(), versions, sys.platform, sys.version, _CODE]
    path = cache_directory("networks") / f"{key_of(json.dumps(parts))}.json"
    if intact(path):
        return _from_json(json.loads(path.read_bytes()))
    tables = make()
    with suppress(CacheError):  # as slow as before, but right
        if (
            not (tables.load_parts or tables.feeding)
            and "".join(file.read_text(encoding="utf-8") for file in _FILES) == _CODE
        ):
            keep(path, json.dumps(_as_json(tables)).encode())
    return tables


def tables_beside(path: Path) -> SourceTables | None:
    """The tables that lie beside a case for the network of its name: built-in cases need no pandapower."""
    file = path.with_name(f"{path.name}.tables.json")
    return _from_json(json.loads(file.read_bytes())) if file.is_file() else None


def _as_json(tables: SourceTables) -> dict[str, Any]:
    """Every number as the shortest text that gives it back to the last bit."""
    arrays = {name: getattr(tables, name) for name in ("bus", "branch", "gen")}
    arrays |= {"real": tables.branch_to_earth.real, "imag": tables.branch_to_earth.imag}
    names = [[one.name, one.circuit] for one in tables.branch_names]
    given = {"titles": list(tables.titles.items()), "branch_names": names}
    return {key: value for key, value in given.items() if value} | {
        "name": tables.name,
        "base_mva": tables.base_mva,
        "labels": list(tables.labels.items()),
        "frequency": tables.frequency,
        "arrays": {name: [list(a.shape), a.ravel().tolist()] for name, a in arrays.items()},
    }


def _from_json(kept: Mapping[str, Any]) -> SourceTables:
    arrays = {
        name: np.array(values, dtype=float).reshape(shape)
        for name, (shape, values) in kept["arrays"].items()
    }
    to_earth = np.empty(arrays["real"].shape, dtype=np.complex128)
    to_earth.real, to_earth.imag = arrays["real"], arrays["imag"]
    labels = {int(number): str(label) for number, label in kept["labels"]}
    return SourceTables(
        kept["name"],
        kept["base_mva"],
        bus=arrays["bus"],
        branch=arrays["branch"],
        gen=arrays["gen"],
        branch_to_earth=to_earth,
        labels=labels,
        frequency=kept["frequency"],
        titles={int(number): str(title) for number, title in kept.get("titles", ())},
        branch_names=tuple(BranchName(*names) for names in kept.get("branch_names", ())),
    )
