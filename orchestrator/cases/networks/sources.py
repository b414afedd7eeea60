"""Networks of other programs: MATPOWER's case files, and pandapower's networks, both as MATPOWER's tables.

pandapower makes these tables itself for its power flow: switches, three-winding transformers and
everything out of service are dealt with there."""

import logging
import re
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.extras import require
from orchestrator.cases.form.csv_rows import seen_from_here
from orchestrator.cases.form.names import close_names
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.kept_tables import SourceTables, kept_tables, tables_beside
from orchestrator.cases.networks.matpower.program import NAMES, CaseProgram, case_tables
from orchestrator.cases.networks.pandapower_json import network_text
from orchestrator.cases.networks.regions import Region
from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes

__all__ = ["SourceTables", "read_matpower", "read_pandapower"]

_COLUMNS = {"bus": 9, "branch": 11, "gen": 10}
_LIMITS = {"bus": [], "branch": [5, 6, 7], "gen": [3, 4, 8, 9]}
"""Columns of limits, which MATPOWER lets be ``Inf``."""

_PMAX = 8
_AREA = 6  # column of a bus
_ZONE = 10  # the same


def read_matpower(path: Path) -> SourceTables:
    if not path.is_file():
        raise InputError.at(
            f"{path}", "there is no such file; give the path of a MATPOWER case (.m or .mat)"
        )
    if path.suffix not in (".m", ".mat"):
        raise InputError.at(
            f"{path}", f"a MATPOWER case ends in .m or .mat, and this file in {path.suffix!r}"
        )
    try:
        program = case_tables(path) if path.suffix == ".m" else _mat_file(path)
    except InputError:
        raise
    except Exception as error:  # scipy lets all kinds of errors through
        raise InputError.at(
            f"{path}", f"it cannot be read as a MATPOWER case: {error or type(error).__name__}"
        ) from error
    tables = program.tables
    missing = [name for name in ("baseMVA", *_COLUMNS) if tables.get(name) is None]
    if missing:
        raise InputError.at(
            f"{path}", f"it is not a MATPOWER case, because mpc.{', mpc.'.join(missing)} is missing"
        )
    for name, columns in _COLUMNS.items():
        table = tables[name]
        if not isinstance(table, np.ndarray) or table.ndim != 2 or table.shape[1] < columns:
            raise InputError.at(
                f"{path}", f"mpc.{name} must be a table of numbers with {columns} columns or more"
            )
        used = np.delete(table[:, :columns], _LIMITS[name], axis=1)
        for row in np.flatnonzero(
            ~np.isfinite(used).all(axis=1) | np.isnan(table[:, :columns]).any(axis=1)
        ):
            raise InputError.at(
                f"{path}",
                f"row {row + 1} of mpc.{name} holds Inf or NaN where only a limit may be Inf, "
                "which means none",
            )
    base = np.asarray(tables["baseMVA"], dtype=float)
    if base.size != 1 or not 0 < base.item() < np.inf:
        raise InputError.at(f"{path}", "mpc.baseMVA must be one number above 0")
    gen = tables["gen"].astype(float)
    gen[np.isinf(gen[:, _PMAX]), _PMAX] = 0.0  # no limit; what follows takes 0 for not known
    branch = tables["branch"]
    numbers = tables["bus"][:, 0].astype(int)
    names = {
        field: own
        for field, own in program.names.items()
        if len(own) == len(tables[field.removesuffix("_name")])
    }
    return SourceTables(
        path.name,
        base.item(),
        bus=tables["bus"],
        branch=branch,
        gen=gen,
        branch_to_earth=np.repeat(0.5j * branch[:, [4]], 2, axis=1),
        labels={int(n): str(n) for n in numbers},
        titles=dict(zip(numbers.tolist(), names.get("bus_name", ()), strict=False)),
        branch_names=tuple(map(BranchName, names.get("branch_name", ()))),
        unit_names=_names_by_bus(gen[:, 0].astype(int).tolist(), names.get("gen_name", ())),
        regions=_regions(tables["bus"]),
    )


def _regions(bus: Matrix) -> dict[int, Region]:
    """Return the areas and loss zones of MATPOWER's table of buses, which have no names there."""
    columns = [column for column in (_AREA, _ZONE) if column < bus.shape[1]]
    whole = np.nan_to_num(bus[:, [0, *columns]]).astype(int).tolist()
    return {number: Region(*map(str, own)) for number, *own in whole}


def _names_by_bus(buses: Sequence[int], names: Sequence[str]) -> dict[int, str]:
    """Names of the generators at each bus, which are one unit."""
    found: dict[int, list[str]] = {}
    for bus, name in zip(buses, names, strict=False):
        if name and name not in found.setdefault(bus, []):
            found[bus].append(name)
    return {bus: ", ".join(own) for bus, own in found.items() if own}


def read_pandapower(name: str, directory: Path) -> SourceTables:
    path = seen_from_here(directory / name)
    changed = path.stat().st_mtime_ns if name.endswith(".json") and path.is_file() else 0
    return _solved_pandapower(name, path, changed)


@cache
def _solved_pandapower(name: str, path: Path, changed: int) -> SourceTables:
    """The tables of a network; ``changed`` keeps a file's newer contents apart. Every scenario of a case asks."""
    content = read_bytes(path) if changed else b""
    return tables_beside(path) or kept_tables(
        name, content, lambda: _made_by_pandapower(name, path)
    )


def _made_by_pandapower(name: str, path: Path) -> SourceTables:
    require(f"the pandapower network {name!r}", "pandapower")
    import pandapower as pp  # noqa: PLC0415 - seconds to import, and needed only here

    logging.getLogger("pandapower").setLevel(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        net = _pandapower_file(pp, path) if name.endswith(".json") else _pandapower_named(name)
        try:
            pp.runpp(
                net,
                calculate_voltage_angles=True,
                numba=False,
                init="auto",
                voltage_depend_loads=False,
            )
        except Exception as error:  # pandapower's checks raise whatever fits
            raise InputError(
                f"pandapower network {name!r}: its power flow has no solution: {error}"
            ) from error
    return _pandapower_tables(name, net)


def _mat_file(path: Path) -> CaseProgram:
    from scipy.io import loadmat  # noqa: PLC0415

    mpc = loadmat(str(path), squeeze_me=False, struct_as_record=True).get("mpc")
    if mpc is None:
        return CaseProgram({}, {})
    found = {
        name: mpc[0, 0][name] for name in ("baseMVA", *_COLUMNS) if name in (mpc.dtype.names or ())
    }
    tables = {
        n: t.item() if n == "baseMVA" else np.asarray(t, dtype=float) for n, t in found.items()
    }
    names = {
        name: tuple("".join(map(str, np.ravel(cell))).strip() for cell in np.ravel(mpc[0, 0][name]))
        for name in NAMES
        if name in (mpc.dtype.names or ())
    }
    return CaseProgram(tables, names)


def _pandapower_named(name: str) -> Any:
    from pandapower import networks  # noqa: PLC0415

    known = [n for n in dir(networks) if not n.startswith("_") and callable(getattr(networks, n))]
    if name not in known:
        hint = close_names(
            name, known, "give one of pandapower.networks, or the path of a .json file"
        )
        raise InputError(f"there is no pandapower network {name!r}; {hint}")
    try:
        net = getattr(networks, name)()
    except TypeError as error:
        raise InputError(
            f"pandapower.networks.{name} needs arguments; save it with pandapower.to_json"
        ) from error
    if not hasattr(net, "bus"):
        raise InputError(
            f"pandapower.networks.{name} is no network; save one with pandapower.to_json"
        )
    return net


def _pandapower_file(pp: Any, path: Path) -> Any:
    if not path.is_file():
        raise InputError.at(
            f"{path}",
            f"there is no such file; save a network with pandapower.to_json(net, {path.name!r})",
        )
    try:
        net = pp.from_json_string(network_text(path, read_bytes(path)), convert=True)
        if not hasattr(net, "bus"):
            raise ValueError("it holds no network")
    except InputError:
        raise
    except Exception as error:  # whatever the decoder raises
        raise InputError.at(
            f"{path}", f"it is no network saved with pandapower.to_json: {error}"
        ) from error
    return net


def _pandapower_tables(name: str, net: Any) -> SourceTables:
    from pandapower.pypower import idx_brch  # noqa: PLC0415

    ppc = net._ppc
    branch, columns = ppc["branch"].real, idx_brch
    unequal = (branch[:, columns.BR_R_ASYM] != 0) | (branch[:, columns.BR_X_ASYM] != 0)
    numbers = dict(zip(net.bus.index, net._pd2ppc_lookups["bus"][net.bus.index], strict=True))
    labels = _labels(net, numbers, len(ppc["bus"]))
    if unequal.any():
        ends = [" and ".join(labels[int(n)] for n in row) for row in branch[unequal][:, :2]]
        raise InputError(
            f"pandapower network {name!r}: an impedance differs by direction between buses {', '.join(ends[:5])}; "
            "the grid model has the same impedance both ways"
        )
    start = branch[:, columns.BR_G] + 1j * branch[:, columns.BR_B]
    end = start + branch[:, columns.BR_G_ASYM] + 1j * branch[:, columns.BR_B_ASYM]
    gen = ppc["gen"].real.copy()
    gen[:, 8] = np.where(gen[:, 8] < 1e6, gen[:, 8], 0.0)  # pandapower's "no limit"
    for table in (net.ext_grid, net.gen):
        for bus, most in zip(table.bus, table.get("max_p_mw", [0.0] * len(table)), strict=True):
            if np.isfinite(most):
                gen[(gen[:, 0] == numbers[bus]) & (gen[:, 8] == 0), 8] = most
    to_earth: NDArray[np.complex128] = np.stack([start, end], axis=1).astype(np.complex128) / 2
    base, frequency = float(ppc["baseMVA"]), float(net.f_hz)
    return SourceTables(
        name,
        base,
        bus=ppc["bus"].real,
        branch=branch,
        gen=gen,
        branch_to_earth=to_earth,
        labels=labels,
        frequency=frequency,
        titles=_titles(net, numbers),
        branch_names=_branch_names(net, len(branch)),
    )


def _titles(net: Any, numbers: Mapping[Any, int]) -> dict[int, str]:
    """Names of the buses by number; of several that a closed switch joins the first counts."""
    found: dict[int, str] = {}
    for index, name in net.bus.name.items():
        found.setdefault(int(numbers[index]), _text(name))
    return {number: name for number, name in found.items() if name}


def _branch_names(net: Any, count: int) -> tuple[BranchName, ...]:
    """Names of lines and transformers in the order of pandapower's table of branches; none if no element has one.

    A transformer of three windings has three rows, which stand in three blocks."""
    found = [""] * count
    for element, (start, end) in net._pd2ppc_lookups["branch"].items():
        table = getattr(net, element, None)
        if table is None or "name" not in table:
            continue
        names = [_text(name) for name in table.name]
        if names and (end - start) % len(names) == 0:
            found[start:end] = names * ((end - start) // len(names))
    return tuple(map(BranchName, found)) if any(found) else ()


def _text(name: Any) -> str:
    return name.strip() if isinstance(name, str) else ""


def _labels(net: Any, numbers: dict[Any, int], count: int) -> dict[int, str]:
    """The buses' names where each has one of its own (``Bus 7``: 7), else their indices; inner buses have neither."""
    named = {
        index: re.sub(r"\W+", "_", str(name)).strip("_") for index, name in net.bus.name.items()
    }
    short = {
        index: re.sub(r"^bus_*(?=\w)", "", name, flags=re.IGNORECASE)
        for index, name in named.items()
    }
    named = short if len(set(short.values())) == len(set(named.values())) else named
    if (
        len(set(named.values())) < len(named)
        or not all(named.values())
        or net.bus.name.isna().any()
    ):
        named = {index: str(index) for index in net.bus.index}
    labels: dict[int, str] = {}
    for (
        index,
        number,
    ) in numbers.items():  # several for one where a closed switch joins them: the first counts
        labels.setdefault(int(number), named[index])
    return {number: labels.get(number, f"inner_{number}") for number in range(count)}
