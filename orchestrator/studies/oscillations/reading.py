"""Records as `Measurements`: runs of ours, tables of phasors with named columns, folders of the contest."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import check_regular
from orchestrator.core.options import Option
from orchestrator.core.units import to_unit
from orchestrator.studies.oscillations.measurements import Kind, Measurements, Site, made_ready
from orchestrator.studies.oscillations.unused_columns import COLUMN, remarks_on_unused
from orchestrator.studies.signals.angle_units import doubtful_angles

if TYPE_CHECKING:
    import xarray as xr

_BASES = {
    "p": ("MW", "pu"),
    "q": ("Mvar", "pu"),
    "va": ("rad",),
    "ia": ("rad",),
    "vm": ("kV", "pu"),
    "im": ("pu",),
}
_FORM = (
    "it needs columns such as 'NORTH.vm [pu]', 'NORTH.va [deg]', 'NORTH.p [MW]', 'NORTH.q [Mvar]' (or 'NORTH.im', "
    "'NORTH.ia' of the current in pu): voltage of a bus and what a unit feeds into it; 'NORTH->SOUTH.p' is what leaves "
    "NORTH towards SOUTH"
)
CONTEST_FILES = ("BusVolMag.txt", "BusVolAng.txt", "LinCurMag.txt", "LinCurAng.txt")


def measurements_of(dataset: xr.Dataset, label: str) -> Measurements:
    times = np.asarray(dataset["time"].values, dtype=np.float64)
    unused: list[str] = []
    if "places" in dataset.attrs:
        places, base = _of_run(dataset), 1.0
    else:
        places, base, unused = _of_columns(dataset, label)
    if not places:
        more = (
            "run again with 'record = [\"*\"]' in [solver], or with "
            + Option.FORCE
            + ", which records what is needed"
        )
        raise InputError(
            f"{label}: no place has voltage, P and Q; {more if 'places' in dataset.attrs else _FORM}"
            + "".join(f"; {remark}" for remark in unused)
        )
    said = [*unused, *([] if "places" in dataset.attrs else doubtful_angles(dataset))]
    return replace(made_ready(label, times, places, said), base=base)


def _of_run(dataset: xr.Dataset) -> list[Site]:
    def known(*names: str) -> bool:
        return all(name in dataset for name in names)

    def values(name: str) -> Numbers:
        return np.asarray(dataset[name].values, dtype=np.float64)

    found = []
    for name, where in json.loads(dataset.attrs["places"]).items():
        bus, _, beyond = where.partition(" ")
        if not known(f"{bus}.v_re", f"{bus}.v_im"):
            continue
        voltage = values(f"{bus}.v_re") + 1j * values(f"{bus}.v_im")
        if beyond and known(f"{name}.p", f"{name}.q"):
            power = -(values(f"{name}.p") + 1j * values(f"{name}.q"))
        elif not beyond and known(f"{name}.i_re", f"{name}.i_im"):
            power = voltage * np.conj(values(f"{name}.i_re") + 1j * values(f"{name}.i_im"))
        else:
            continue
        kind: Kind = "branch" if beyond else "unit"
        found.append(
            Site(
                name,
                kind,
                bus=bus,
                v=np.abs(voltage),
                angle=np.angle(voltage),
                p=power.real,
                q=power.imag,
                beyond=beyond,
            )
        )
    return found


def _of_columns(dataset: xr.Dataset, label: str) -> tuple[list[Site], float, list[str]]:
    """Places, what 100 MVA are in the unit of their powers, and remarks on what is not used."""
    columns: dict[str, dict[str, Numbers]] = {}
    bases: dict[str, set[str]] = {}
    for name in map(str, dataset.data_vars):
        parts = COLUMN.fullmatch(name)
        if parts:
            what = parts["what"].lower()
            values, base = _in_base(dataset[name], what, f"{label}: {name!r}")
            columns.setdefault(parts["place"], {})[what] = values
            bases.setdefault("power" if what in "pq" else what, set()).add(base)
    per_unit = {base == "pu" for base in bases.get("power", {"pu"})}
    if len(per_unit) > 1:
        raise InputError(
            f"{label}: some powers are in pu and some in MW or Mvar; give all in one of both"
        )
    found = []
    for place, own in columns.items():
        bus, arrow, beyond = (part.strip() for part in place.partition("->"))
        seen = {**columns.get(bus, {}), **own}
        if "vm" not in seen or "va" not in seen:
            continue
        if "im" in seen and "ia" in seen and "p" not in seen:
            power = seen["vm"] * seen["im"] * np.exp(1j * (seen["va"] - seen["ia"]))
            seen |= {"p": power.real, "q": power.imag}
        if "p" in seen and "q" in seen and not (arrow and not own.keys() & {"p", "im"}):
            sign = -1.0 if arrow else 1.0
            kind: Kind = "branch" if arrow else "unit"
            found.append(
                Site(
                    place,
                    kind,
                    bus=bus,
                    v=seen["vm"],
                    angle=seen["va"],
                    p=sign * seen["p"],
                    q=sign * seen["q"],
                    beyond=beyond,
                )
            )
    used = {site.name for site in found} | {site.bus for site in found}
    unused = remarks_on_unused(list(map(str, dataset.data_vars)), columns, used)
    return found, 1.0 if True in per_unit else 100.0, unused


def _in_base(curve: xr.DataArray, what: str, where: str) -> tuple[Numbers, str]:
    unit = str(curve.attrs.get("units", "")).strip()
    values = np.asarray(curve.values, dtype=np.float64)
    if not unit and what not in ("va", "ia"):
        return values, "pu"
    for base in _BASES[what] if unit else ():
        try:
            return values * to_unit(f"1 {unit}", base), base
        except ValueError:
            continue
    raise InputError(
        f"{where}: the unit {unit or 'is missing and'!r} is not {' or '.join(_BASES[what])}"
        f"{' or deg' if what in ('va', 'ia') else ''}; write it in brackets behind the name"
    )


def contest_cases(folder: Path) -> list[Path]:
    folders = (p for p in folder.glob("*") if p.is_dir())
    inside = sorted(folders, key=lambda p: [int(n) for n in re.findall(r"\d+", p.name)])
    found = [
        path for path in (folder, *inside) if all((path / name).is_file() for name in CONTEST_FILES)
    ]
    if not found:
        raise InputError(
            Option.CONTEST
            + f" {folder}: neither it nor a folder in it holds {', '.join(CONTEST_FILES)}"
        )
    return found


def read_contest(folder: Path) -> Measurements:
    """A case of the 2021 IEEE-NASPI contest: voltages of buses [pu, deg] and currents of lines at their first bus.

    A bus with one measured line is what stands behind it, such as a generator; elsewhere lines to buses that are not
    measured count."""
    times, vm = _table(folder / CONTEST_FILES[0])
    rest = [_table(folder / name) for name in CONTEST_FILES[1:]]
    for name, (other, _) in zip(CONTEST_FILES[1:], rest, strict=True):
        if not np.array_equal(other, times):
            raise InputError(f"{folder / name}: its times are not those of {CONTEST_FILES[0]}")
    va, im, ia = (table for _, table in rest)
    lines = {name: [part.strip() for part in name.split("|")] for name in im if name in ia}
    buses = {name.split("|")[0].strip(): name for name in vm if name in va}
    ends = [parts[0] for parts in lines.values() if len(parts) > 2]
    places = []
    for name, parts in lines.items():
        if len(parts) < 3 or parts[0] not in buses:
            continue
        bus = buses[parts[0]]
        angle = np.deg2rad(va[bus])
        power = vm[bus] * im[name] * np.exp(1j * (angle - np.deg2rad(ia[name])))
        alone = ends.count(parts[0]) == 1
        power = power if alone else -power
        place = " ".join((bus if alone else name).split())
        places.append(
            Site(
                place,
                "unit" if alone else "branch",
                bus=parts[0],
                v=vm[bus],
                angle=angle,
                p=power.real,
                q=power.imag,
                beyond="" if alone else parts[2],
            )
        )
    if not places:
        raise InputError(
            f"{folder}: no line of {CONTEST_FILES[2]} begins at a bus of {CONTEST_FILES[0]}"
        )
    return made_ready(folder.name, times, places)


def _table(path: Path) -> tuple[Numbers, dict[str, Numbers]]:
    """Times and columns of a text file whose first line has the names in single quotes."""
    try:
        check_regular(path)
        with path.open(encoding="utf-8", errors="replace") as file:
            names = re.findall(r"'([^']*)'", file.readline())
            values = np.atleast_2d(np.loadtxt(file, dtype=np.float64))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: it cannot be read as a table of the contest: {error}") from error
    if len(names) < 2 or values.shape[1] != len(names):
        raise InputError(
            f"{path}: {len(names)} names in quotes stand above {values.shape[-1]} columns of numbers"
        )
    return values[:, 0], {name: values[:, k] for k, name in enumerate(names) if k}
