"""What an installation without extras can do, and what it says where it cannot."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fmus.toolchain import compiler, native_fmu, python_fmu
from fmus.toolchain.extras import EXTRAS, MissingLibraryError, require
from tests.support.scenarios import prepare_one

ROOT = Path(__file__).parents[2]
DISTRIBUTIONS = {"skrf": "scikit-rf"}
"""Name in an import → name on PyPI, where they differ."""


LARGE = {"cgmes"}
"""Extras that `all` leaves out: pypowsybl alone has 250 MB."""


def test_the_table_of_extras_is_that_of_the_distribution():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    for library, extra in EXTRAS.items():
        names = [re.split(r"[^\w.-]", text)[0] for text in extras[extra]]
        assert DISTRIBUTIONS.get(library, library) in names
    always = [re.split(r"[^\w.-]", text)[0] for text in project["dependencies"]]
    assert not {DISTRIBUTIONS.get(library, library) for library in EXTRAS} & set(always)
    (everything,) = extras["all"]
    assert set(EXTRAS.values()) - LARGE == set(re.findall(r"\[(.*)\]", everything)[0].split(","))


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ziglang", None)
    monkeypatch.setitem(sys.modules, "pandapower", None)
    with pytest.raises(
        MissingLibraryError,
        match=r"trial needs ziglang, which is not installed.*gfor-cosim\[build\]",
    ):
        require("a trial", "ziglang", "skrf")
    with pytest.raises(
        MissingLibraryError, match=r"ziglang, pandapower, which are .*gfor-cosim\[build,networks\]"
    ):
        require("a trial", "ziglang", "pandapower")


WITHOUT_EXTRAS = """
import sys
for library in {libraries}:
    sys.modules[library] = None
from pathlib import Path
from orchestrator.face.cli import COMMANDS, main, module_of
for name in COMMANDS:
    module_of(name)
assert main(["fmu", "info", "no_such.fmu"]) == 2
sys.exit(main(["fmu", "build", "gfor", "--native", "--dest", {folder!r}]))
"""
"""Imports every command, types one that needs no extra and one that does."""


def test_every_command_can_be_imported_without_extras_and_one_that_needs_one_says_so(tmp_path):
    script = WITHOUT_EXTRAS.format(libraries=list(EXTRAS), folder=str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 2, done.stderr
    needs_none, needs_one = done.stderr.split("error: compiling C")
    assert "no_such.fmu" in needs_none
    assert "pip install 'gfor-cosim[build]'" in needs_one


def test_a_table_that_wants_native_fmus_has_them_without_a_compiler(monkeypatch):
    """`gfor certify` writes such tables, which must be the same on every machine to verify."""
    for module in (native_fmu, python_fmu):
        monkeypatch.setattr(module, "installed_version", lambda library: "")
    prepared = prepare_one("norm631", "with")
    tools = {plan.description.generation_tool for plan in prepared.system.components.values()}
    assert not all("PythonFMU" in tool for tool in tools), tools


def test_a_library_that_the_wheel_brought_is_taken_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_PREBUILT", tmp_path)
    host = compiler.host_platform()
    monkeypatch.setattr(compiler, "TARGETS", {host: compiler.TARGETS[host]})
    source = tmp_path / "source.c"
    text = '__attribute__((visibility("default"))) int number(void) { return 7; }\n'
    source.write_text(text, encoding="utf-8")
    compiled = compiler.compile_here(source)
    assert compiled.parent != tmp_path
    compiler.prebuild(source)
    assert len(list(tmp_path.glob("*.*"))) == 1 + len(compiler.TARGETS)
    brought = compiler.compile_here(source)
    assert brought.parent == tmp_path
    assert brought.read_bytes() == compiled.read_bytes()
    source.write_text(text.replace("7", "8"), encoding="utf-8")
    assert compiler.compile_here(source).parent != tmp_path
