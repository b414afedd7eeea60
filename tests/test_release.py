"""The version stands in one place, and what is published beside the code agrees with it and with the code."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fmus.toolchain.catalogue import model_names
from orchestrator.cases.case import BUILT_IN
from orchestrator.devices.acceptance.checks.all import CHECKS
from orchestrator.devices.acceptance.runner import FILE_CHECKS
from orchestrator.face.cli import COMMANDS, OLD
from orchestrator.simulation.interop.rules import MASTERS

ROOT = Path(__file__).parents[1]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
NEWEST = re.search(r"^## \[([\d.]+)\] - (\d{4}-\d\d-\d\d)$", CHANGELOG, re.MULTILINE)
NUMBERS = {11: "eleven"}


def test_changelog_and_citation_have_the_version_of_the_distribution():
    assert NEWEST is not None
    assert NEWEST[1] == VERSION
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {VERSION}\n" in citation
    assert f"\ndate-released: {NEWEST[2]}\n" in citation


def test_gfor_tells_its_version_without_a_heavy_library():
    script = (
        "import sys\nfrom orchestrator.face.cli import main\n"
        "try:\n main(['--version'])\nexcept SystemExit as end:\n assert not end.code\n"
        "heavy = {'numpy', 'scipy', 'xarray', 'rich', 'fmpy', 'pint'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"gfor-cosim \d+\.\d+\.\d+\n", done.stdout)


def test_the_changelog_counts_what_there_is():
    assert f"{len(CHECKS) + len(FILE_CHECKS)} acceptance tests" in CHANGELOG
    assert f"{NUMBERS[len(MASTERS)]} configurations" in CHANGELOG
    mutations = tomllib.loads(
        (ROOT / "tests/benchmarks/mutations.toml").read_text(encoding="utf-8")
    )["mutation"]
    assert f"{len(mutations)} plausible mistakes" in CHANGELOG


def test_the_changelog_names_commands_models_and_cases_that_exist():
    text = CHANGELOG[NEWEST.start() :]
    named = {OLD.get(one, one).split()[0] for one in re.findall(r"`gfor ([a-z][\w-]*)", text)}
    assert named <= {name.split()[0] for name in COMMANDS}
    everywhere = {OLD.get(one, one) for one in re.findall(r"`gfor ([a-z][\w-]*)", CHANGELOG)}
    assert set(COMMANDS) - {"fmu info"} <= everywhere | set(
        re.findall(r"`gfor ([a-z]+ [a-z]+)", CHANGELOG)
    )
    assert {"gfor", "gfor_abc", "gfor_phasor", "infinite_bus"} <= set(model_names())
    for case in (path.parent.name for path in BUILT_IN.glob("*/case.toml")):
        assert f"`{case}`" in CHANGELOG


def test_nothing_lies_at_the_top_that_has_no_place_there():
    """A test, a command or another program that writes into the working directory leaves its files here, and they are
    soon committed.
    """
    files = {"CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "pyproject.toml"}
    folders = {"fmus/", "gfor_fmu/", "orchestrator/", "tests/"}
    done = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    tops = {
        "".join(name.partition("/")[:2])
        for name in done.stdout.splitlines()
        if not name.startswith(".")
    }
    assert tops <= files | folders


@pytest.mark.parametrize("command", ["compare", "verify"])
def test_commands_that_read_results_start_without_what_computes_them(command):
    """Each of these takes half a second or more, and reading and judging kept results needs none."""
    code = (
        f"import sys, orchestrator.face.cli.{command}\n"
        "heavy = {'scipy.optimize', 'scipy.signal', 'scipy.stats', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
