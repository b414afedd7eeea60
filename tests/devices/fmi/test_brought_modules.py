"""What an FMU brings is found by its own code, and shadows nothing that is installed; each in a fresh process."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

_SLAVE = """
import colorsys, helper
from pythonfmu import Fmi2Causality, Fmi2Slave, Real, brought

class Foreign(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        import colorsys as late, quopri, helper as again, tabnanny
        from pythonfmu import brought as package
        from pythonfmu.enums import Fmi2Causality as kinds
        assert late is colorsys and again is helper and package == brought and kinds is Fmi2Causality
        self.y = helper.number + 10 * colorsys.brought + 100 * brought + 1000 * quopri.brought
        self.y += 10000 * hasattr(tabnanny, "brought")
        return True
"""
_OWN = {
    "helper.py": "import colorsys, tabnanny\nfrom pydoc import Helper\nnumber = {}\nassert colorsys.brought == 1\n",
    "colorsys.py": "brought = 1\n",  # installed ones of these names belong to Python's library
    "quopri.py": "brought = 1\n",
    "pydoc.py": "import quopri\nassert quopri.brought\nfrom tabnanny import brought\nHelper = 1\n",
    "tabnanny.py": "import mailcap\nbrought = not hasattr(mailcap.re, 'brought')\n",
}

_LOAD = """
import builtins, json, sys
from pathlib import Path
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

path, hook = list(sys.path), builtins.__import__
values, parts = [], [LoadedComponent("a", read_description(Path(p))) for p in sys.argv[1:]]
for part in parts:
    part.setup(0.0, None); part.enter_initialization_mode(); part.exit_initialization_mode()
def shadowed():
    import colorsys, quopri, tabnanny, pydoc, pythonfmu, pythonfmu.builder
    return [m.__name__ for m in (colorsys, quopri, tabnanny, pydoc, pythonfmu) if hasattr(m, "brought")]
first = shadowed()
for part in parts:
    assert part.do_step(part.pointer, 0.0, 0.1, 1) == 0
    values.append(part.values(["y"])["y"])
front = sys.path[: len(path)] == path
left = [name for name in sys.modules if name.startswith(("helper", "foreign"))]
for part in parts:
    part.close()
print(json.dumps({"values": values, "shadowed": first + shadowed(), "front": front, "left": left,
    "after": sys.path == path and builtins.__import__ is hook}))
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """Two FMUs of others, whose modules are named as each other's and as installed ones."""
    builder = pytest.importorskip("pythonfmu.builder")
    files = []
    for number in (1, 2):
        folder = tmp_path_factory.mktemp(f"foreign{number}")
        script = folder / "foreign.py"
        script.write_text(
            "from pythonfmu import Fmi2Causality, Fmi2Slave, Real\n"
            + _SLAVE[_SLAVE.index("class") :]
        )
        path, known = list(sys.path), set(sys.modules)
        fmu = Path(builder.FmuBuilder.build_FMU(script, dest=folder))
        sys.path[:] = path
        for name in set(sys.modules) - known:
            del sys.modules[name]
        changed = folder / "changed.fmu"
        with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(changed, "w") as new:
            for name in old.namelist():
                text = old.read(name)
                text = _SLAVE.encode() if name == "resources/foreign.py" else text
                text += b"\nbrought = 1\n" if name == "resources/pythonfmu/__init__.py" else b""
                new.writestr(name, text)
            for name, text in _OWN.items():
                new.writestr(f"resources/{name}", text.replace("{}", str(number)))
        files.append(changed)
    return files


def test_modules_of_an_fmu_are_its_own_alone(foreign):
    done = subprocess.run(
        [sys.executable, "-c", _LOAD, *map(str, foreign)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == {
        "values": [11111.0, 11112.0],
        "shadowed": [],
        "front": True,
        "left": [],
        "after": True,
    }


def test_a_package_is_installed_after_an_fmu_that_brings_a_part_of_it(tmp_path):
    """A case's Python-backed FMUs are loaded before the wrapper's binaries are looked for."""
    words = ["fmu", "build", "gfor", "--with-linear-model", "two_area", "--scenario", "pod_p"]
    done = subprocess.run(
        [sys.executable, "-m", "orchestrator.face.cli", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stdout) == (0, "gfor.fmu\n"), done.stderr
