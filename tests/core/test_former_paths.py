"""Names of modules of older versions: they are found, once, with a notice, and cost nothing otherwise."""

import importlib
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import orchestrator
from orchestrator.core.errors import InputError
from orchestrator.former_paths import present_name

ROOT = Path(__file__).parents[2]
FORMER = {
    "orchestrator.errors": "orchestrator.core.errors",
    "orchestrator.fmi.component": "orchestrator.devices.fmi.component",
    "orchestrator.study.modes": "orchestrator.studies.modes.modes",
    "orchestrator.study.run": "orchestrator.studies.runs.run",
    "orchestrator.analysis.modes": "orchestrator.linear.spectra.modes",
    "orchestrator.analysis.threads": "orchestrator.core.threads",
    "orchestrator.report.html.page": "orchestrator.output.report.html.page",
    "orchestrator.federation.choice": "orchestrator.simulation.federation.choice",
    "orchestrator.cases.short_circuit": "orchestrator.cases.scenario.short_circuit",
    "orchestrator.cases.network_data": "orchestrator.cases.networks.data",
    "orchestrator.cases.psse.raw": "orchestrator.cases.networks.psse.raw",
    "orchestrator.output.report.table": "orchestrator.output.report.column_table",
    "orchestrator.coupling.wires": "orchestrator.systems.coupling.imperfect_wires",
    "orchestrator.report.table": "orchestrator.output.report.column_table",
    "orchestrator.output.results.recorded": "orchestrator.output.results.recording_reader",
    "orchestrator.output.results.recording": "orchestrator.output.results.recording_writer",
    "orchestrator.results.storage": "orchestrator.output.results.file_writers",
    "orchestrator.cases.psse.known_records": "orchestrator.cases.networks.psse.dyr_model_list",
    "orchestrator.cases.networks.psse.records": "orchestrator.cases.networks.psse.raw_records",
    "orchestrator.fmi.isolation": "orchestrator.devices.fmi.isolated_component",
    "orchestrator.devices.fmi.limits": "orchestrator.devices.sandbox.resource_limits",
    "orchestrator.devices.fmi.mailbox": "orchestrator.devices.sandbox.mailbox",
    "orchestrator.devices.fmi.interrupts": "orchestrator.core.interrupts",
    "orchestrator.explore.between": "orchestrator.face.explore.interpolation",
}


@pytest.fixture(autouse=True)
def forgotten():
    """No former name is known from another test."""
    before = {*sys.modules}
    yield
    for name in {*sys.modules} - before:
        if present_name(name) is not None:
            del sys.modules[name]
            parent, _, last = name.rpartition(".")
            vars(sys.modules.get(parent, orchestrator)).pop(last, None)


@pytest.mark.parametrize(("former", "present"), FORMER.items())
def test_a_former_name_gives_the_present_module_with_a_notice(former, present):
    with pytest.warns(DeprecationWarning, match=f"^{former} is now {present}; import it there$"):
        module = importlib.import_module(former)
    assert module is importlib.import_module(present)
    assert module.__name__ == module.__spec__.name == present


def test_the_notice_names_the_line_that_imports():
    with pytest.warns(DeprecationWarning, match="is now") as notices:
        from orchestrator.errors import InputError as Former  # noqa: PLC0415
    assert Former is InputError
    assert [notice.filename for notice in notices] == [__file__]


def test_names_of_a_former_room_are_found():
    with pytest.warns(DeprecationWarning, match=r"orchestrator\.cli\.main is now"):
        from orchestrator.cli import main  # noqa: PLC0415 - the command of an older installation
    assert main is importlib.import_module("orchestrator.face.cli").main
    with pytest.warns(DeprecationWarning, match="is now"):
        from orchestrator.analysis import modes  # noqa: PLC0415
    assert modes is importlib.import_module("orchestrator.linear.spectra.modes")


@pytest.mark.parametrize(
    "name", ["orchestrator.study.none", "orchestrator.none", "orchestrator.fmi.none"]
)
def test_what_never_was_is_not_found(name):
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(name)


def test_every_present_module_has_at_most_one_former_name_and_is_there():
    """Each module of the tree that stood elsewhere is found by the name that it had."""
    assert present_name("orchestrator.cases.case") is None
    assert present_name("orchestrator.studies.modes.modes") is None
    assert present_name("fmus.grid") is None
    for present in FORMER.values():
        assert present_name(present) is None


def test_present_names_do_not_pass_here():
    """The finder is the last of all, and is asked for nothing that a command imports."""
    program = (
        "import sys, orchestrator\nfrom orchestrator.former_paths import FormerPaths\n"
        "asked = []\nFormerPaths.find_spec = lambda self, name, *_: asked.append(name)\n"
        "orchestrator.load('two_area')\n"
        "found = [n for n in asked if n.startswith('orchestrator')]\n"
        "sys.exit(str(found) if found else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr


def test_the_former_command_runs():
    former = ".".join(("orchestrator", "cli"))
    done = subprocess.run(
        [sys.executable, "-m", former, "--version"],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("gfor-cosim ")


def test_an_import_of_a_present_name_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        importlib.import_module("orchestrator.devices.fmi.component")
