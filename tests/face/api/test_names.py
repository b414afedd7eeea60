"""``import orchestrator as gfor``: which names there are, and that they cost nothing until they are used."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import orchestrator
from orchestrator.face.cli import COMMANDS

ROOT = Path(__file__).parents[3]
NAMES = {
    *(
        "Case",
        "CosimError",
        "Modes",
        "Run",
        "Scenario",
        "build",
        "built_in_cases",
        "check",
        "compare",
        "load",
    ),
    *("admittance", "bind", "certify", "export", "verify"),
    *("LinearSystem", "ParameterSweep", "Screening", "open"),
    *(
        "Acceptance",
        "Admittance",
        "ControllerDesign",
        "CoordinatedDesign",
        "Exploration",
        "Fmu",
        "FmuInfo",
        "Interactions",
    ),
    *(
        "IssuedCertificate",
        "Nyquist",
        "RunComparison",
        "Saved",
        "Sensitivities",
        "SignalModes",
        "Siting",
        "Sources",
    ),
    *("StepChoice", "Validation", "Verification", "validate"),
    *("BusStrength", "Mode", "Stability"),
    *("VoltageSource", "voltage_source"),
    *("CheckpointWarning", "RunEndedWarning", "UnusualDataWarning"),
    *(
        "ambient",
        "export_comtrade",
        "identify",
        "info",
        "nyquist",
        "open_fmu",
        "read_linear_model",
        "source",
    ),
}


def test_the_names_are_those():
    assert set(orchestrator.__all__) == NAMES
    assert set(dir(orchestrator)) >= NAMES
    assert all(callable(getattr(orchestrator, name)) for name in NAMES)


def test_no_name_is_that_of_a_module():
    """A module would take the name's place as soon as it is imported."""
    folder = ROOT / "orchestrator"
    assert not {path.stem for path in folder.iterdir()} & NAMES


def test_a_name_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(AttributeError, match=r"no attribute 'laod'; it has: .*load"):
        _ = orchestrator.laod


@pytest.mark.parametrize(
    ("name", "ways"),
    [
        ("sweep", r"use gfor.load\('two_area'\).sweep\(…\), or `gfor sweep` at the terminal"),
        ("report", "use `gfor report` at the terminal"),
    ],
)
def test_a_study_that_is_called_without_a_case_is_told_where_it_is(name, ways):
    with pytest.raises(AttributeError, match=rf"{ways}; functions: .*load"):
        getattr(orchestrator, name)("two_area")


def test_a_case_lists_its_studies():
    assert {"sweep", "screen"} <= {*dir(orchestrator.load("two_area"))}


def test_every_line_of_the_stub_is_a_name():
    tree = ast.parse((ROOT / "orchestrator" / "__init__.pyi").read_text(encoding="utf-8"))
    homes = {alias.asname: node.module for node in tree.body for alias in node.names}
    assert homes == {name: f"orchestrator.{home}" for name, home in orchestrator._HOMES.items()}


def test_importing_takes_no_time_and_no_library():
    script = (
        "import sys, time\nbegin = time.perf_counter()\nimport orchestrator as gfor\n"
        "print(time.perf_counter() - begin)\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'xarray', 'matplotlib', 'rich', 'fmpy', 'pint', 'pydantic'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
        "assert 'load' in dir(gfor)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 0.3


def test_modes_need_no_plots():
    """Matplotlib takes a second, which `gfor modes` does without; nor does it import the studies of points."""
    script = (
        "import sys\nimport orchestrator as gfor\n"
        "gfor.load('infinite_bus').scenario('dip').modes().table()\n"
        "late = {'matplotlib', 'orchestrator.face.api.studies', 'orchestrator.studies.points.study'}\n"
        "assert not late & set(sys.modules), late & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr


def test_the_reference_page_lists_every_name():
    page = (ROOT / ".docs" / "reference" / "python.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^::: (orchestrator\.\S+)$", page, re.MULTILINE))
    made = {
        name
        for name in orchestrator._HOMES
        if hasattr(getattr(orchestrator, name), "__signature__")
    }
    assert made == {"certify"}  # from a request: a hook lists it
    homes = {
        f"orchestrator.{home}.{name}"
        for name, home in orchestrator._HOMES.items()
        if name not in made
    }
    assert homes <= listed


def test_each_command_has_its_twin_or_the_page_says_why_not():
    page = (ROOT / ".docs" / "reference" / "python.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `gfor ([a-z ]+)` \| (.+) \|$", page, re.MULTILINE)
    assert [command for command, _ in rows] == list(COMMANDS)
    for command, twin in rows:
        named = re.findall(r"`([\w.]+)`", twin)
        assert named or (twin.startswith("none: ") and len(twin.split()) > 5), command
        for name in named:
            first, *rest = name.split(".")
            found = getattr(orchestrator, first)
            for part in rest:
                found = getattr(found, part)
            assert callable(found), name


@pytest.mark.slow
def test_type_checkers_see_types(tmp_path):
    (tmp_path / "use.py").write_text(
        "import orchestrator as gfor\n"
        "modes = gfor.load('two_area').scenario('gfor').modes()\n"
        "reveal_type(modes)\n"
        "reveal_type(gfor.compare)\n",
        encoding="utf-8",
    )
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file",
        str(ROOT / "pyproject.toml"),
    ]
    done = subprocess.run(
        # with mypy's cache of the checkout, which .ci/run has just filled
        [*command, str(tmp_path / "use.py")],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert "orchestrator.face.api.results.Modes" in done.stdout, done.stdout
    assert "RunComparison" in done.stdout
