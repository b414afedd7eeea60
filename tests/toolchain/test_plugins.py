"""What other distributions declare under our entry-point groups, found, loaded and refused."""

import json
import os
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint

import pytest

from fmus.toolchain import plugins
from fmus.toolchain.extras import SetupError
from fmus.toolchain.plugins import Collections, PlugInError, PlugIns, entries_of, entry_of, is_own
from orchestrator.studies.certification.codes.row import DeclaredCode, GridCode
from orchestrator.studies.points.code import needed_modules, numbers_hash
from tests.pages.markdown import ROOT, blocks

PAGE = ROOT / ".docs" / "how-to" / "ship-plug-ins.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


TYPED = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
from orchestrator.face.cli import main
found = []
for command in json.loads(sys.argv[1]):
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        try:
            code = main(command)
        except SystemExit as stop:
            code = stop.code
    found.append([code, out.getvalue(), err.getvalue()])
print(json.dumps(found))
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Lay distributions out as an installer does; returns what runs Python where they are installed."""
    site = tmp_path / "site"

    def install(name, files, groups):
        for path, text in files.items():
            (site / path).parent.mkdir(parents=True, exist_ok=True)
            (site / path).write_text(text, encoding="utf-8")
        folder = site / f"{name.replace('-', '_')}-1.0.dist-info"
        folder.mkdir(parents=True)
        metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n"
        (folder / "METADATA").write_text(metadata, encoding="utf-8")
        text = "".join(
            f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in entries.items())
            for group, entries in groups.items()
        )
        (folder / "entry_points.txt").write_text(text, encoding="utf-8")

    def run(*arguments):
        path = os.pathsep.join([str(site), str(ROOT)])
        return subprocess.run(
            [sys.executable, *arguments],
            env=os.environ | {"PYTHONPATH": path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )

    def typed(*commands):
        """Exit code, standard output and standard error of each command, all in one process."""
        done = run("-c", TYPED, json.dumps(commands))
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    run.install, run.site, run.typed = install, site, typed
    return run


@pytest.fixture
def colleague(installed):
    """Install the distribution of the guide."""
    files = {
        block.path.removeprefix("grid-checks/"): block.text
        for block in blocks(PAGE)
        if block.kind == "file"
    }
    groups = tomllib.loads(files.pop("pyproject.toml"))["project"]["entry-points"]
    installed.install("grid-checks", files, groups)
    return installed


GFOR = ("-m", "orchestrator.face.cli")


def test_a_study_of_a_colleague_is_a_command_and_a_method(colleague):
    typed = ("least-damped", "infinite_bus", "--scenario", "dip", "--below", "50", "--json")
    done = colleague(*GFOR, *typed)
    assert done.returncode == 0, done.stderr
    assert '"damping_percent"' in done.stdout
    script = (
        "import orchestrator as gfor; from orchestrator.face.cli import main\n"
        "case = gfor.load('infinite_bus')\n"
        "print(case.least_damped('dip').as_json(), 'least_damped' in dir(case), 'and')\n"
        "main(['--help'])"
    )
    again = colleague("-c", script)
    found, _, listed = again.stdout.partition(" True and\n")
    assert "damping_percent" in found, again.stderr
    assert "the least damped mode of each scenario (of grid-checks" in " ".join(listed.split())


def test_a_code_and_a_check_of_a_colleague_are_known(colleague):
    script = (
        "from orchestrator.devices.acceptance.checks.all import ORDER\n"
        "from orchestrator.studies.certification.codes.known import KNOWN, code_for\n"
        "from orchestrator.face.cli.certificate import LISTED\n"
        "print(ORDER[-1], code_for('harbour', {}).title, KNOWN.module_of('harbour'), LISTED)"
    )
    done = colleague("-c", script)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("suggested_step Harbour: jumps of 10° grid_checks.codes")
    assert "harbour (the harbour, 50 Hz)" in done.stdout


def test_the_key_of_a_kept_point_follows_the_code_of_a_plug_in(colleague, monkeypatch):
    monkeypatch.syspath_prepend(str(colleague.site))
    needed = needed_modules("grid_checks.codes")
    assert {"grid_checks.codes", "orchestrator.studies.certification.codes.criteria"} <= needed
    before = numbers_hash("grid_checks.codes")
    source = colleague.site / "grid_checks" / "codes.py"
    source.write_text(source.read_text(encoding="utf-8").replace("0.2", "0.3"), encoding="utf-8")
    later = source.stat().st_mtime + 2  # Python compares times in whole seconds, and sizes
    os.utime(source, (later, later))
    for cached in (numbers_hash, sys.modules["orchestrator.studies.points.code"]._code):
        cached.cache_clear()
    assert numbers_hash("grid_checks.codes") != before


BROKEN = {
    # study: what declares it, and what is said
    "absent": (
        "absent.module:STUDY",
        "absent.module:STUDY, which cannot be imported (ModuleNotF",
    ),
    "number": ("number:STUDY", "is of the type int; it has to be a PointStudy or"),
    "raises": ("raises:STUDY", "cannot be imported (ZeroDivisionError"),
}


def test_a_broken_study_is_one_error_and_help_lives(installed):
    files = {"number.py": "STUDY = 3", "raises.py": "1 / 0"}
    declared = {name: value for name, (value, _) in BROKEN.items()}
    installed.install("vendor", files, {"gfor_cosim.studies": declared})
    (code, listed, _), *found = installed.typed(
        ["--help"], *([name, "two_area"] for name in BROKEN)
    )
    assert code == 0
    assert listed.count("a study (of vendor 1.0)") == len(BROKEN)
    for (name, (value, says)), (code, _, said) in zip(BROKEN.items(), found, strict=True):
        assert code == 2, name
        assert f"vendor 1.0 declares gfor_cosim.studies {name!r} as {value}" in said
        assert says in said
        assert "Traceback" not in said


def test_studies_of_others_stand_behind_our_commands_with_their_first_sentence(installed):
    text = '"""The first sentence\nof a study. The second one."""\nSTUDY = 3'
    installed.install("vendor", {"own.py": text}, {"gfor_cosim.studies": {"count": "own:STUDY"}})
    listed = " ".join(installed(*GFOR, "--help").stdout.split())
    assert " count the first sentence of a study (of vendor 1.0)" in listed
    assert listed.index(" run steady state") < listed.index(" count the first")
    assert "second one" not in listed


def test_a_study_that_is_called_as_a_command_of_ours_is_told(installed):
    installed.install(
        "vendor", {"own.py": "STUDY = 3"}, {"gfor_cosim.studies": {"run": "own:STUDY"}}
    )
    done = installed(*GFOR, "--help")
    assert done.returncode == 0
    assert "note: the study 'run' is not used" in done.stderr


@pytest.fixture
def declared(monkeypatch):
    """Declare entries beside those of this distribution."""

    def declare(*entries):
        own = [entry for group in PROJECT["entry-points"] for entry in _own(group)]

        class Entries:
            def select(self, group):
                return [entry for entry in (*entries, *own) if entry.group == group]

        monkeypatch.setattr(plugins, "_all_entries", Entries)
        entries_of.cache_clear()

    yield declare
    entries_of.cache_clear()


def _own(group):
    return [entry for entries in entries_of(group).values() for entry in entries if is_own(entry)]


def test_metadata_that_are_older_than_the_code_are_told(declared, monkeypatch):
    declared()
    with pytest.raises(SetupError, match=r"declare no 'gfor_cosim.kites'.*`pip install -e .`"):
        entries_of("gfor_cosim.kites")


def test_what_pyproject_declares_is_installed():
    declares = {
        group: entries
        for group, entries in PROJECT["entry-points"].items()
        if group.startswith("gfor_cosim.")
    }
    assert len(declares) > 4
    for group, entries in declares.items():
        assert {entry.name: entry.value for entry in _own(group)} == entries, group


def test_one_name_of_two_distributions_is_refused_where_it_is_used(declared):
    declared(EntryPoint("sweep", "vendor:STUDY", "gfor_cosim.studies"))
    studies = PlugIns("gfor_cosim.studies", lambda: (object,))
    assert len(studies) == len(PROJECT["entry-points"]["gfor_cosim.studies"])
    assert studies["site"] is not None
    with pytest.raises(
        PlugInError, match=r"declare the same gfor_cosim.studies 'sweep'; uninstall"
    ):
        entry_of("gfor_cosim.studies", "sweep")


@pytest.mark.parametrize(
    ("held", "kind", "says"),
    [
        ({"harbour": 3}, str, r"has 'harbour' of the type int; .* has to be a str"),
        ({"miso": 3}, object, r"have the same gfor_cosim.codes 'miso'"),
    ],
)
def test_a_collection_holds_objects_of_one_kind_under_one_name(
    declared, monkeypatch, held, kind, says
):
    monkeypatch.setattr(sys.modules[__name__], "HELD", held, raising=False)
    declared(EntryPoint("vendor", f"{__name__}:HELD", "gfor_cosim.codes"))
    codes = Collections("gfor_cosim.codes", (kind, GridCode, DeclaredCode))
    with pytest.raises(PlugInError, match=says):
        dict(codes)


def test_a_reader_an_engine_and_a_master_of_a_colleague_are_used(installed):
    code = (
        "import numpy as np, xarray as xr\n"
        "from orchestrator.simulation.interop.rules import MasterRules\n"
        "from orchestrator.systems.coupling.observers import Observer\n"
        "def read(path):\n"
        "    times = np.arange(0, 10, 0.01)\n"
        "    wave = 60 + np.exp(-0.5 * times) * np.sin(2 * np.pi * times)\n"
        "    return xr.Dataset({'f': ('time', wave, {'units': 'Hz'})},\n"
        "                      {'time': times, 'line_frequency_hz': 60.0})\n"
        "class Told:\n"
        "    def __init__(self, prepared, federates):\n"
        "        self.prepared, self.open = prepared, None\n"
        "    def __enter__(self):\n"
        "        print('engine begins')\n"
        "        from orchestrator.systems.coupling.coupled import open_plan\n"
        "        self.open = open_plan\n"
        "        return self\n"
        "    def __exit__(self, *error): print('engine ends')\n"
        "    def observers(self): return []\n"
        "    def obstacle(self, component): return None\n"
        "    def begin(self, master): print('run begins', sorted(master.components))\n"
        "OURS = {'house': MasterRules('house', 'House 1', 'in turn', source='its manual')}\n"
    )
    groups = {
        "gfor_cosim.readers": {"rec": "vendor_files:read"},
        "gfor_cosim.engines": {"told": "vendor_files:Told"},
        "gfor_cosim.masters": {"vendor": "vendor_files:OURS"},
    }
    installed.install("vendor", {"vendor_files.py": code}, groups)
    (installed.site.parent / "a.rec").write_bytes(b"")
    short = ("run", "infinite_bus", "--scenario", "dip", "--stop", "0.01")
    heard, ran, like = installed.typed(
        ("signal", "identify", "a.rec", "f", "--json"),
        (*short, "--engine", "told"),
        (*short, "--like", "house", "--out", "like"),
    )
    assert [code for code, *_ in (heard, ran, like)] == [0, 0, 0], (heard, ran, like)
    assert '"frequency_hz": 1.0' in heard[1] or '"frequency_hz": 0.99' in heard[1]
    for line in ("engine begins", "run begins ['gfor', 'grid']", "engine ends"):
        assert line in ran[1]
    assert "like House 1" in like[1]
