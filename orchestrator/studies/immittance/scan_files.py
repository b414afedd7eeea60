"""Files of scans, of two forms.

Z-tool's text has one line of names, then a frequency and its matrix in each row [S]; its q axis lags the d axis. Beside
a scan may stand the angles of its ports and the power flow, in files that begin with the same name.

Energinet's IMTB has CSV with impedances [Ω] in dq, or in αβ at the frequency of the network. One file may hold a device
(Zdut) and a network (Znet). The αβ form has the sequences as rows and columns: the second is the mirrored one, two
rated frequencies lower.

Rows of direct current and of negative dq frequencies are left out: those mirror the others."""

import csv
import math
import re
from io import StringIO
from pathlib import Path

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_text, visible
from orchestrator.core.safe_files import write_text
from orchestrator.studies.immittance.forms import from_sequences
from orchestrator.studies.immittance.scan import (
    SIEMENS,
    PortPoint,
    Scan,
    checked,
    in_own_form,
    other_q_axis,
)

_COLUMNS = ("[kV]", "[MW]", "[MVAr]", "[rad]")
_ELEMENTS = ("11", "12", "21", "22")


def read_ztool(path: Path, text: str, rated_hz: float) -> Scan:
    first, _, rest = text.partition("\n")
    ports = _ports(path, first.split()[1:])
    frequencies, values = _rows(path, rest, 2 * len(ports))
    kept = ~(frequencies <= 0)  # as of IMTB's form; what is no number is told
    frequencies, values = frequencies[kept], values[kept]
    questions = checked(path.name, frequencies, values)
    own, asked = in_own_form(path.name, frequencies, values, rated_hz, q_leads=False)
    return Scan(
        path.name, frequencies, own, ports, points=_points(path, ports), questions=questions + asked
    )


def _ports(path: Path, names: list[str]) -> tuple[str, ...]:
    direct = [name for name in names if name.endswith("_dc")]
    if direct:
        raise InputError(
            f"{path.name}: the ports {', '.join(direct)} are DC; only AC ports can be judged"
        )
    ports = [name.removesuffix("_d") for name in names[::2]]
    if names != [f"{port}_{axis}" for port in ports for axis in "dq"]:
        raise InputError(
            f"{path.name}, line 1: {' '.join(names)}: d and q of one port after the other are needed"
        )
    return tuple(ports)


def _rows(path: Path, text: str, size: int) -> tuple[Numbers, Complex]:
    rows = []
    for number, line in enumerate(text.splitlines(), start=2):
        if not line.strip():
            continue
        cells = line.split("\t") if "\t" in line else line.split()
        if len(cells) != 1 + size**2:
            raise InputError(
                f"{path.name}, line {number}: there are {len(cells)} numbers, and {size} names ask for {1 + size**2}: "
                "a frequency and the matrix row by row; was the file cut off?"
            )
        try:
            rows.append([complex(re.sub(r"[()\s]", "", cell).replace("+-", "-")) for cell in cells])
        except ValueError as error:
            raise InputError(
                f"{path.name}, line {number}: {error}; write numbers as (1.5e-3-2e-4j)"
            ) from error
    table = np.array(rows, dtype=complex).reshape(-1, 1 + size**2)
    return table[:, 0].real, table[:, 1:].reshape(-1, size, size)


def _points(path: Path, ports: tuple[str, ...]) -> dict[str, PortPoint]:
    """By port; a block's name stands for both of its sides."""
    root = path.name.partition("#")[0] if "#" in path.name else path.stem
    found: dict[str, dict[str, float]] = {}
    for ending, columns in (
        ("_angles.txt", {"Angle": "[rad]"}),
        ("_power_flow.txt", {c: c for c in _COLUMNS}),
    ):
        beside = path.with_name(root + ending)
        if not beside.is_file():
            continue
        head, *rows = read_text(beside, _LARGEST, encoding="utf-8-sig").splitlines()
        names = [name.strip().split(" ")[0] for name in head.split("\t")]
        for number, row in enumerate(rows, start=2):
            cells = row.split("\t")
            try:
                figures = {
                    columns[n]: float(c) for n, c in zip(names, cells, strict=True) if n in columns
                }
            except ValueError as error:
                raise InputError(
                    f"{beside.name}, line {number}: {error}; its columns are {', '.join(names)}"
                ) from error
            other, angle = (
                found.setdefault(cells[0].strip(), {}).get("[rad]"),
                figures.get("[rad]", 0.0),
            )
            if abs(angle) > 2 * math.pi or (
                other is not None and "[rad]" in figures and abs(angle - other) > 1e-3
            ):
                rule = (
                    "an angle in rad is at most 2π"
                    if other is None
                    else f"{root}_angles.txt has {other:g} rad"
                )
                raise InputError(
                    f"{beside.name}, line {number}: {angle:g} rad, and {rule}; mend the wrong one"
                )
            found[cells[0].strip()].update(figures)
    points = {}
    for port in ports:
        figures = found.get(port, found.get(re.sub(r"-[12]$", "", port), {}))
        if figures:
            points[port] = PortPoint(*(figures.get(column) for column in _COLUMNS))
    return points


def write_ztool(scan: Scan, path: Path) -> None:
    """Write a scan in siemens, and beside it the angles and power flow that are known."""
    if scan.unit != SIEMENS:
        raise InputError(
            f"{scan.source}: Z-tool's form is in siemens; give the base of this scan in per unit"
        )
    values = other_q_axis(scan.values)
    lines = ["\t".join(["f", *(f"{port}_{axis}" for port in scan.ports for axis in "dq")])]
    for f, matrix in zip(
        scan.frequencies.tolist(), values.reshape(len(values), -1).tolist(), strict=True
    ):
        lines.append("\t".join(f" ({z.real:.18e}{z.imag:+.18e}j)" for z in (complex(f), *matrix)))
    write_text(path, "\n".join(lines) + "\n")
    blocks = {re.sub(r"-[12]$", "", port): point for port, point in scan.points.items()}
    root = path.name.partition("#")[0] if "#" in path.name else path.stem
    if any(point.angle is not None for point in blocks.values()):
        rows = [f"{name}\t0\t{point.angle:.14f}" for name, point in blocks.items()]
        write_text(
            path.with_name(f"{root}_angles.txt"),
            "\n".join(["Bus\tArea\tAngle [rad]", *rows]) + "\n",
        )
    if all(None not in (p.kilovolt, p.megawatt, p.megavar) for p in blocks.values()) and blocks:
        heads = "Block \t [kV] \t [MW] \t [kA] \t [MVAr] \t [rad] \t Area"
        rows = [
            f"{n}\t{p.kilovolt or 0:.8e}\t{p.megawatt or 0:.8e}\t"
            f"{abs(complex(p.megawatt or 0, p.megavar or 0)) / (3**0.5 * (p.kilovolt or 1)):.8e}\t"
            f"{p.megavar or 0:.8e}\t{p.angle or 0:.8e}\t0"
            for n, p in blocks.items()
        ]
        write_text(path.with_name(f"{root}_power_flow.txt"), "\n".join([heads, *rows]) + "\n")


def write_imtb(scan: Scan, path: Path) -> None:
    """Write the impedances of one port in dq [Ω]; the form has no place for an operating point."""
    if scan.unit != SIEMENS or len(scan.ports) > 1:
        raise InputError(
            f"{scan.source}: IMTB's form is of one port in ohms; give one port, in siemens"
        )
    columns = {"f": scan.frequencies}
    for name, z in zip(_ELEMENTS, scan.impedance.reshape(-1, 4).T, strict=True):
        columns |= {f"Zdut_dq_{name}_re": z.real, f"Zdut_dq_{name}_im": z.imag}
    rows = np.array(list(columns.values())).T.tolist()
    write_text(
        path, "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"
    )


def read_imtb(path: Path, text: str, rated_hz: float, *, network: bool) -> Scan:
    """The device of a file, or its network."""
    rows = list(csv.DictReader(StringIO(text)))
    frame = "dq" if "_dq_11_re" in text.partition("\n")[0] else "ab"
    quantities = (
        list(dict.fromkeys(n.partition(f"_{frame}_")[0] for n in rows[0] if f"_{frame}_" in n))
        if rows
        else []
    )
    wanted = [q for q in quantities if ("net" in q) == network] or quantities
    if len(wanted) != 1:
        raise InputError(
            f"{path.name}: it holds {', '.join(quantities) or 'no rows'}; one of Zdut and Znet is needed"
        )
    frequencies, Z = _numbers(path, rows, f"{wanted[0]}_{frame}")
    if frame == "ab":
        frequencies = frequencies - rated_hz
        Z = from_sequences(Z)
    kept = ~(frequencies <= 0)
    frequencies, Z = frequencies[kept], Z[kept]
    questions = checked(path.name, frequencies, Z)
    own, asked = in_own_form(path.name, frequencies, np.linalg.inv(Z), rated_hz, q_leads=True)
    return Scan(path.name, frequencies, own, (wanted[0],), questions=questions + asked)


def _numbers(path: Path, rows: list[dict[str, str]], name: str) -> tuple[Numbers, Complex]:
    found = []
    for number, row in enumerate(rows, start=2):
        try:
            values = [
                complex(float(row[f"{name}_{e}_re"]), float(row[f"{name}_{e}_im"]))
                for e in _ELEMENTS
            ]
            found.append((float(row["f"]), values))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path.name}, line {number}: {name} is no row of numbers ({error})"
            ) from error
    return np.array([f for f, _ in found]), np.array([v for _, v in found]).reshape(-1, 2, 2)


ENDINGS = (".txt", ".csv")
_LARGEST = 200_000_000  # bytes of a scan


def read_scan(path: Path, rated_hz: float, *, network: bool = False) -> Scan:
    """A scan from a file of Z-tool's or IMTB's form.

    ``network``: Which part of a file is meant that holds a device and a network."""
    try:
        text = visible(read_text(path, _LARGEST, encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}; give the path of a scan") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: it is not a text file; a scan is one of Z-tool's or IMTB's"
        ) from error
    first = text.partition("\n")[0].strip()
    names = first.split()
    if names[:1] == ["f"] and any(name.endswith(("_d", "_dc")) for name in names):
        return read_ztool(path, text, rated_hz)
    if first.startswith("f,") and ("_dq_11_re" in first or "_ab_11_re" in first):
        return read_imtb(path, text, rated_hz, network=network)
    raise InputError(
        f"{path}: its first line {first[:60]!r} is of no known form of scans; Z-tool's begins 'f<tab>BUS-1_d<tab>"
        "BUS-1_q', IMTB's 'f,Zdut_dq_11_re,Zdut_dq_11_im'"
    )
