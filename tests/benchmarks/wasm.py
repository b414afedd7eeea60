"""Our native converter as WebAssembly: compiled by ziglang, stepped beside the native FMU by node, and a page of it.

    python -m tests.benchmarks.wasm                   # largest difference, and how long a second takes
    python -m tests.benchmarks.wasm --html page.html  # a page that steps it in the browser

The first compilation takes minutes: ziglang builds the C library for WebAssembly.
"""

import argparse
import base64
import ctypes
import json
import math
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from orchestrator.face.cli import main as gfor

HERE = Path(__file__).parent
CALLS = "Instantiate SetupExperiment EnterInitializationMode ExitInitializationMode SetReal GetReal DoStep FreeInstance"
STEP = 1e-4  # communication step [s]
JUMP_AT, STEPS, EVERY = 1000, 10_000, 10  # step of the jump, all steps, steps of a recorded point
JUMP = math.radians(-10.0)  # of the infinite bus
TARGET = "wasm32-wasi"


def compiled(folder):
    """The C source of the native FMU in a folder, and the WebAssembly that comes of it."""
    assert gfor(["fmu", "build", "gfor", "--native", "--sources", "--dest", str(folder)]) == 0
    with zipfile.ZipFile(folder / "gfor.fmu") as archive:
        archive.extractall(folder)
    exports = [f"-Wl,--export=fmi2{name}" for name in CALLS.split()] + ["-Wl,--export=malloc"]
    source, made = folder / "sources" / "gfor.c", folder / "gfor.wasm"
    flags = ["-target", TARGET, "-mexec-model=reactor", "-O2", "-ffp-contract=off", "-s"]
    words = [sys.executable, "-m", "ziglang", "cc", *flags, *exports, str(source), "-o", str(made)]
    subprocess.run(words, check=True)
    return source, made


def references(folder):
    """Value reference of each variable."""
    text = (folder / "modelDescription.xml").read_text(encoding="utf-8")
    return {
        n: int(r)
        for n, r in re.findall(r'<ScalarVariable name="(.*?)" valueReference="(\d+)"', text)
    }


def native(folder, guid, known):
    """Active and reactive power and frequency of the native FMU, as rows."""
    library = ctypes.CDLL(str(folder / "binaries" / "linux64" / "gfor.so"))
    place, real = ctypes.c_void_p, ctypes.c_double
    library.fmi2Instantiate.restype = place
    name, none = ctypes.c_char_p, None
    library.fmi2Instantiate.argtypes = [
        name,
        ctypes.c_int,
        name,
        name,
        place,
        ctypes.c_int,
        ctypes.c_int,
    ]
    instance = place(library.fmi2Instantiate(b"converter", 1, guid.encode(), none, none, 0, 0))

    def put(**values):
        for key, value in values.items():
            assert not library.fmi2SetReal(
                instance, (ctypes.c_uint * 1)(known[key]), 1, (real * 1)(value)
            )

    def get(key):
        found = (real * 1)()
        library.fmi2GetReal(instance, (ctypes.c_uint * 1)(known[key]), 1, found)
        return found[0]

    library.fmi2SetupExperiment(instance, 0, real(0), real(0), 0, real(0))
    library.fmi2EnterInitializationMode(instance)
    put(v_re=1.0, v_im=0.0)
    assert not library.fmi2ExitInitializationMode(instance)
    rows = []
    for k in range(STEPS):
        if k == JUMP_AT:
            put(v_re=math.cos(JUMP), v_im=math.sin(JUMP))
        assert not library.fmi2DoStep(instance, real(k * STEP), real(STEP), 1)
        if k % EVERY == EVERY - 1:
            rows.append([get("p"), get("q"), get("omega")])
    return rows


def by_node(folder, settings):
    """The same rows by WebAssembly in node, and how long it took [ms]."""
    (folder / "settings.json").write_text(json.dumps(settings), encoding="utf-8")
    program = (HERE / "wasm.js").read_text(encoding="utf-8")
    end = (
        "const fs = require('fs'), given = JSON.parse(fs.readFileSync('settings.json'));"
        "opened(fs.readFileSync('gfor.wasm'), given).then(run => { run(given.jump, {}); const t = performance.now(),"
        "rows = run(given.jump, {}); console.log(JSON.stringify({ rows, ms: performance.now() - t })); });"
    )
    (folder / "run.js").write_text(program + end, encoding="utf-8")
    done = subprocess.run(
        ["node", "run.js"], cwd=folder, check=True, capture_output=True, text=True
    )
    found = json.loads(done.stdout)
    return found["rows"], found["ms"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--html", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        source, made = compiled(folder)
        guid = re.search(r'GUID\[\] = "([^"]+)"', source.read_text(encoding="utf-8"))[1]
        settings = {
            "guid": guid,
            "references": references(folder),
            "step": STEP,
            "steps": STEPS,
            "every": EVERY,
            "at": JUMP_AT,
            "jump": JUMP,
        }
        rows, ms = by_node(folder, settings)
        right = native(folder, guid, settings["references"])
        pairs = [
            (x, y) for a, b in zip(rows, right, strict=True) for x, y in zip(a, b, strict=True)
        ]
        off = max(abs(x - y) for x, y in pairs)
        print(
            f"{made.stat().st_size / 1000:.0f} kB; a second in {ms:.0f} ms; off by {off:.1e} at most"
        )
        if options.html:
            kept = ("p", "q", "omega", "v_re", "v_im", "droop.R_f", "pod_p.K", "droop.R_V")
            settings["references"] = {key: settings["references"][key] for key in kept}
            settings |= {"off": off, "code": base64.b64encode(made.read_bytes()).decode()}
            page = (HERE / "wasm.html").read_text(encoding="utf-8")
            page = page.replace("/* wasm.js */", (HERE / "wasm.js").read_text(encoding="utf-8"))
            options.html.write_text(
                page.replace("{settings}", json.dumps(settings)), encoding="utf-8"
            )


if __name__ == "__main__":
    main()
