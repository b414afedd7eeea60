"""Files of every kind that a user gives, changed at random: each is read, or refused with an error of ours.

python -m tests.benchmarks.reader_fuzz [--seed N] [--count N] [--only KIND]

The functions that read run in this process, one file after another. An exception that is no `CosimError` is a defect:
it is printed with its seed, and the file is kept with ``--keep FOLDER``.
"""

import argparse
import random
import re
import sys
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.python_fmu import PythonFmu
from fmus.vendor_dll.device import DeviceFileError, device_of, read_device_file
from fmus.vendor_dll.interface import DllInterface, DllParameter, Signal
from orchestrator.cases.case import BUILT_IN, load_case
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.core.errors import CosimError
from orchestrator.devices.binding.binding import bind
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.fmi.archive import read_model_description_text
from orchestrator.devices.fmi.description import parse_description, read_description
from orchestrator.output.results.comtrade.reading import read_comtrade
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.operating_points.points_file import read_points
from orchestrator.systems.ssp.names import STUDY_TYPE, SYSTEM_FILE
from tests.cases.networks.psse import raw
from tests.cases.networks.psse.test_dyr import CASE as DYR_CASE
from tests.cases.networks.psse.test_dyr import DYR
from tests.devices.fmi.fuzz import text_changed as xml_changed
from tests.output.results.test_comtrade import CFG, DAT
from tests.support.vendor_dlls import DEVICE
from tests.systems.coupling.small_fmus import small_fmu
from tests.systems.ssp.packages import (
    OSP_STEP,
    bindings,
    component,
    experiment,
    system,
    values,
    wire,
    write,
)

NUMBERS = (
    *(
        "0",
        "-1",
        "1e308",
        "-1e999",
        "1e-320",
        "nan",
        "inf",
        "9" * 30,
        "9" * 400,
        "1" + "0" * 5000,
        "0x10",
        "1_0",
        "",
    ),
    *("4294967296", "0.5", "1.5.2", "١", "1e", "+", "1,5", "1/0", "true", "1979-05-27", "07:32:00"),
)
VALUES = (
    *(
        "[]",
        "[[]]",
        "{}",
        "{ a = 1 }",
        '""',
        '"x"',
        "true",
        "-0",
        "nan",
        "inf",
        "1e400",
        "9" * 400,
        '["a", 1]',
    ),
    *(
        "[{ a = 1 }]",
        "1979-05-27T07:32:00Z",
        "07:32:00",
        '"1 V"',
        '"\\u0000"',
        '"../x"',
        '"é\\n"',
        '"' + "x" * 5000 + '"',
    ),
)
MARKS = (
    "\0",
    "\ud7ff",
    "\u202e",
    '"',
    "'",
    ",",
    ",,,,",
    "\n",
    "\r",
    "[",
    "]",
    "{",
    "=",
    "/",
    "#",
    ";",
    "\ufeff",
    "%s",
    "*",
    "[0",
)


def bytes_changed(chance: random.Random, content: bytes) -> bytes:
    """Bytes set, taken out, or put in."""
    found = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 5, 30))):
        place = chance.randrange(len(found) + 1)
        gap = chance.choice((0, 1, 1, chance.randrange(80)))
        found[place : place + gap] = chance.randbytes(chance.choice((0, 1, 1, 4)))
    return bytes(found)


def text_changed(chance: random.Random, content: bytes) -> bytes:
    """Numbers, texts, values and whole lines of other kinds."""
    text = content.decode("latin-1")
    for _ in range(chance.choice((1, 1, 2, 3, 10))):
        text = chance.choice((_number, _number, _value, _value, _mark, _lines, _word))(chance, text)
    return text.encode("utf-8", "surrogatepass")


def _spot(chance: random.Random, text: str, pattern: str, new: str) -> str:
    found = list(re.finditer(pattern, text, re.MULTILINE))
    if not found:
        return text
    match = chance.choice(found)
    return text[: match.start(1)] + new + text[match.end(1) :]


def _markup_changed(chance: random.Random, content: bytes) -> bytes:
    return chance.choice((xml_changed, text_changed))(chance, content)


def _number(chance: random.Random, text: str) -> str:
    return _spot(chance, text, r"(?<![\w.])(-?\d[\d.eE+-]*)", chance.choice(NUMBERS))


def _value(chance: random.Random, text: str) -> str:
    return _spot(chance, text, r"= *(.+?) *(?:[#,}]|$)", chance.choice(VALUES))


def _word(chance: random.Random, text: str) -> str:
    words = re.findall(r"[A-Za-z_]\w*", text)
    return _spot(chance, text, r"\b([A-Za-z_]\w*)", chance.choice([*words, "", "x", "a.b"]))


def _mark(chance: random.Random, text: str) -> str:
    place = chance.randrange(len(text) + 1)
    return text[:place] + chance.choice(MARKS) + text[place:]


def _lines(chance: random.Random, text: str) -> str:
    lines = text.splitlines(keepends=True) or [""]
    first, second = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[first:first] = chance.choice(([], lines[second : second + 5], [lines[second]] * 40))
    del lines[second : second + chance.choice((0, 1, 1, 5))]
    return "".join(lines)


@dataclass(frozen=True)
class Kind:
    """Files of one kind: good ones by name, which of them is changed, how, and what reads them."""

    files: Mapping[str, bytes]
    changed: str
    read: Callable[[Path], object]
    change: Callable[[random.Random, bytes], bytes] = text_changed

    def one(self, chance: random.Random, folder: Path) -> Path:
        """A changed file in a folder, with the good ones beside it."""
        for name, content in self.files.items():
            change = chance.choice((bytes_changed, self.change, self.change))
            (folder / name).write_bytes(
                change(chance, content) if name == self.changed else content
            )
        return folder / self.changed


EVENTS = """
[[events]]
type = "bus_fault"
time = "1 s"
bus = "bus_C"
duration = "100 ms"
[[events]]
type = "line_trip"
time = 1.1
line = "line_AC_1"
[[events]]
type = "reference_change"
time = "2 s"
component = "wp1"
reference = "P"
delta = 0.05
"""
FILES = """
name = "files"
[solver]
step_size = "100 us"
stop_time = "1 s"
[power_flow]
grid = "grid"
[components.grid]
model = "grid"
[components.theirs]
fmu = "theirs.fmu"
[components.gfor]
model = "gfor"
bus = "a"
[components.source]
model = "external_grid"
bus = "b"
parameters = { S_n = "2000 MVA" }
[network]
buses = ["a", "b", "c"]
lines_file = "lines.csv"
loads_file = "loads.csv"
[scenarios.base]
parameters = ["p.toml"]
"""
LINES = "name,from,to,R,X,B\nl1,a,b,0.001,0.01,0.1\nl2,b,c,0.001,0.01,0.1\n"
LOADS = "bus,p_mw,q_mvar\na,10,1\nb,20,2\n"
PARAMETERS = (
    '# by hand\n[set]\n"gfor.P_0" = 0.5\n"gfor.S_n" = "100 MVA"\ngfor.pod_p.enabled = true\n'
)
POINTS = "time,hours,grid.X_L,load,gfor.P_mw,gfor.in_service\na,2,0.1,1,10,1\nb,1,0.12,0.99,,1\nc,1,0.15,1.01,,0\n"
STUDY = (
    f'<ssd:Annotations><ssc:Annotation type="{STUDY_TYPE}"><gfor:Study scenario="base" title="Ring">'
    '<gfor:CommunicationStep seconds="0.001"/><gfor:Schedule name="gauss-seidel"><gfor:Group><gfor:Component name="a"/>'
    '<gfor:Component name="b"/></gfor:Group></gfor:Schedule><gfor:Events><gfor:Set time="0.05" component="a" '
    'variable="u" value="1.0"/></gfor:Events><gfor:CaseTables>[analysis]\nmodes = []\n</gfor:CaseTables></gfor:Study>'
    "</ssc:Annotation></ssd:Annotations>"
)
INTERFACE = DllInterface(
    {"ModelName": "droop", "ModelVersion": "1.0"},
    (1, 1, 0, 0),
    1e-4,
    1,
    (Signal("i", "", "kA", 9, 3), Signal("p_ref", "", "pu", 9, 1), Signal("v_ref", "", "pu", 9, 1)),
    (Signal("e", "", "kV", 9, 3), Signal("p", "", "pu", 9, 1)),
    (
        DllParameter("mp", "", "Droop", "pu", 9, False, 0.02, 0.0, 1.0),
        DllParameter("file", "", "Table", "", 10, False, "", None, None),
    ),
    (0, 0, 3),
    ("Initialize", "Outputs"),
)
FULL_DEVICE = DEVICE.format(delay=0) + (
    '[parameters]\nmp = 0.03\n[texts]\nfile = "t.csv"\n[start]\ntrims = ["P"]\nlongest = "5 s"\ntrim_after = 1\n'
)


def _ssd() -> bytes:
    """The structure of two FMUs in a ring, with our annotation."""
    ring = (
        component("a", "integrator", bindings(values(gain=30.0, x_0=(1.0, "1")))),
        component("b", "integrator", bindings(values(gain=-20.0, on=True, text="x"))),
    )
    top = system("top", ring, (wire("a.y", "b.u"), wire("b.y", "a.u")))
    with TemporaryDirectory() as folder:
        path = write(
            Path(folder) / "ring.ssp", top, experiment("0.1", OSP_STEP) + STUDY, valid=False
        )
        with zipfile.ZipFile(path) as archive:
            return archive.read(SYSTEM_FILE)


@cache
def _two_area() -> tuple[object, Elements]:
    (prepared,) = load_case("two_area").prepare(["gfor"])
    return prepared, Elements.of(prepared)


def _read_case(path: Path) -> None:
    case = load_case(path)
    case.tables_and_plans(next(iter(case.scenarios)))


def _read_ssd(path: Path) -> None:
    packed = path.with_suffix(".ssp")
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr(SYSTEM_FILE, path.read_bytes())
        archive.write(small_fmu("integrator").path, "resources/integrator.fmu")
    with patch("orchestrator.cases.case.cache_directory", lambda _: path.parent / "cache"):
        _read_case(packed)


def _read_description(path: Path) -> None:
    description = parse_description(path, path.read_bytes(), ["binaries/linux64/gfor.so"])
    draft_binding(description)


def _read_device(path: Path) -> None:
    try:
        _, table = read_device_file(path)
        device = device_of(path, table, INTERFACE)
        INTERFACE.with_defaults(device.parameters)
        device.around("device")
    except DeviceFileError as error:  # those who call make it an InputError
        raise CosimError(str(error)) from error


def kinds() -> dict[str, Kind]:
    """All kinds of files by name."""
    fmu, prepared = cached(PythonFmu(build_model("gfor"))), _two_area()
    binding = draft_binding(read_description(fmu))
    recording = {"rec.cfg": CFG.encode(), "rec.dat": DAT.encode()}
    words = b"".join(
        n.to_bytes(4, "little") + (20000 * n).to_bytes(4, "little") + b"\1\0\2\0\3\0\1\0"
        for n in (1, 2, 3)
    )
    binary = {"rec.cfg": CFG.replace("ASCII", "BINARY").encode(), "rec.dat": words}
    planned = {
        "grid.raw": raw(33).encode(),
        "grid.dyr": DYR.encode(),
        "case.toml": DYR_CASE.encode(),
    }
    built_in = (BUILT_IN / "four_vsc" / "case.toml").read_bytes()
    with_files = {
        "case.toml": FILES.encode(),
        "lines.csv": LINES.encode(),
        "loads.csv": LOADS.encode(),
        "p.toml": PARAMETERS.encode(),
        "theirs.fmu": small_fmu("gain").path.read_bytes(),
    }
    return {
        "case": Kind({"case.toml": built_in + EVENTS.encode()}, "case.toml", _read_case),
        "case with files": Kind(with_files, "case.toml", _read_case),
        "lines": Kind(
            with_files, "lines.csv", lambda path: _read_case(path.with_name("case.toml"))
        ),
        "case of a planner": Kind(planned, "case.toml", _read_case),
        "parameters": Kind({"p.toml": PARAMETERS.encode()}, "p.toml", read_parameter_file),
        "raw 33": Kind({"grid.raw": raw(33).encode()}, "grid.raw", read_raw),
        "raw 35": Kind({"grid.raw": raw(35).encode()}, "grid.raw", read_raw),
        "dyr": Kind(planned, "grid.dyr", lambda path: _read_case(path.with_name("case.toml"))),
        "cfg": Kind(recording, "rec.cfg", read_comtrade),
        "dat": Kind(recording, "rec.dat", read_comtrade),
        "binary cfg": Kind(binary, "rec.cfg", read_comtrade),
        "binary dat": Kind(binary, "rec.dat", read_comtrade),
        "ssd": Kind({"s.ssd": _ssd()}, "s.ssd", _read_ssd, _markup_changed),
        "description": Kind(
            {"modelDescription.xml": read_model_description_text(fmu)},
            "modelDescription.xml",
            _read_description,
            _markup_changed,
        ),
        "binding": Kind(
            {"binding.toml": binding.encode()},
            "binding.toml",
            lambda path: bind(read_description(fmu), path),
        ),
        "points": Kind(
            {"points.csv": POINTS.encode()}, "points.csv", lambda path: read_points(path, *prepared)
        ),
        "device": Kind({"device.toml": FULL_DEVICE.encode()}, "device.toml", _read_device),
    }


@dataclass(frozen=True)
class Defect:
    """A file at which something else was raised than an error of ours."""

    kind: str
    seed: int
    error: str
    where: str


def fuzzed(kind: str, one: Kind, seeds: Sequence[int], folder: Path) -> Iterator[str | Defect]:
    """What became of each file: read, refused, or a defect."""
    for seed in seeds:
        place = folder / f"{kind.replace(' ', '_')}-{seed}"
        place.mkdir()
        path = one.one(random.Random(f"{kind} {seed}"), place)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                one.read(path)
            yield "read"
        except CosimError:
            yield "refused"
        except Exception as error:
            frames = [
                f
                for f in traceback.extract_tb(error.__traceback__)
                if "site-packages" not in f.filename
            ]
            yield Defect(
                kind,
                seed,
                repr(error)[:200],
                f"{Path(frames[-1].filename).name}:{frames[-1].lineno}",
            )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.reader_fuzz", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200, help="files of each kind (200)")
    parser.add_argument(
        "--only", action="append", metavar="KIND", help="this kind alone (repeatable)"
    )
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the files in this folder")
    options = parser.parse_args(arguments)
    defects: list[Defect] = []
    with TemporaryDirectory(prefix="reader-fuzz") as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name, kind in kinds().items():
            if options.only and name not in options.only:
                continue
            seeds = range(options.seed, options.seed + options.count)
            found = list(fuzzed(name, kind, seeds, folder))
            wrong = [one for one in found if isinstance(one, Defect)]
            count = Counter(one for one in found if not isinstance(one, Defect))
            print(
                f"{name}: {count['read']} read, {count['refused']} refused, {len(wrong)} defects",
                flush=True,
            )
            for one in wrong:
                print(f"    {one.seed}: {one.error} at {one.where}", flush=True)
            defects += wrong
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
