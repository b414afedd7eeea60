"""What names a point's file."""

import shutil
import sys

import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.points import code
from orchestrator.studies.points.code import (
    LIBRARIES,
    code_hash,
    library_versions,
    needed_modules,
    numbers_hash,
)
from orchestrator.studies.points.key import fingerprint, key_of
from orchestrator.studies.points.task import Task

SWEEP, ROW = (
    "orchestrator.studies.sweep.point",
    "orchestrator.studies.certification.codes.bench_point",
)


@pytest.fixture
def fresh():
    yield
    for one in (code_hash, numbers_hash):
        one.cache_clear()


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_of_a_library_gives_other_names(fresh, monkeypatch, library):
    case = load_case("two_area")
    before = key_of({"a": 1}, SWEEP), fingerprint(case)
    versions = library_versions()
    assert versions[library]
    monkeypatch.setattr(code, "library_versions", lambda: versions | {library: "0.0.1"})
    code_hash.cache_clear()
    numbers_hash.cache_clear()
    assert key_of({"a": 1}, SWEEP) != before[0]
    assert fingerprint(case) != before[1]


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of the code, with what Python compiled of it."""
    files = shutil.ignore_patterns("*.toml", "*.raw", "*.dyr")
    return shutil.copytree(
        code._ROOT, tmp_path_factory.mktemp("code") / "orchestrator", ignore=files
    )


@pytest.fixture(scope="module")
def compiled():
    """Module, file → its code, compiled once for each text: most files never change here."""
    compile_anew = code._code.__wrapped__
    found = {}

    def find(name, file):
        key = name, file.read_bytes()
        if key not in found:
            found[key] = compile_anew(name, file)
        return found[key]

    return find


@pytest.fixture
def named(fresh, monkeypatch, tree, compiled):
    """Module → the name of a point of its, as a new process finds it."""
    monkeypatch.setattr(code, "_ROOT", tree)
    monkeypatch.setattr(code, "_code", compiled)
    # Python would take what it compiled of another text of that size in the same second
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def find(module):
        for one in (code_hash, numbers_hash):
            one.cache_clear()
        return key_of({"a": 1}, module)

    return find


@pytest.fixture(scope="module")
def usual():
    """Module → the name of a point of its in the tree as it is."""
    return {}


@pytest.fixture
def changed(named, tree, usual):
    """Whether points of a module have other names once a file has another text."""

    def find(module, file, old, new):
        text = (tree / file).read_text(encoding="utf-8")
        if module not in usual:
            usual[module] = named(module)
        assert text.count(old) == 1
        (tree / file).write_text(text.replace(old, new), encoding="utf-8")
        try:
            return named(module) != usual[module]
        finally:
            (tree / file).write_text(text, encoding="utf-8")

    return find


def test_the_same_files_give_the_same_name(named):
    assert named(SWEEP) == named(SWEEP)


@pytest.mark.parametrize(
    ("module", "file", "old", "new"),
    [
        (
            SWEEP,
            "linear/spectra/modes.py",
            "return self.eigenvalue.imag / (2 * np.pi)",
            "return self.eigenvalue.imag / 6",
        ),
        (
            SWEEP,
            "linear/spectra/modes.py",
            "ELECTROMECHANICAL_HZ = (0.1, 2.0)",
            "ELECTROMECHANICAL_HZ = (0.1, 2.1)",
        ),
        (SWEEP, "cases/flow/power_flow.py", "complex(p, q)", "complex(q, p)"),
        (SWEEP, "devices/binding/tables.py", '"50 Hz"', '"60 Hz"'),
        (  # words with a meaning: they turn a vendor's current
            SWEEP,
            "devices/binding/tables.py",
            '] = "into the grid"',
            '] = "into the converter"',
        ),
        (SWEEP, "linear/models/steady_state.py", "{changes};", "{changes},"),  # may be one as well
        (
            ROW,
            "simulation/watch/synchronism.py",
            "import numpy as np\n",
            "import numpy as np\nimport math\n",
        ),
        (
            SWEEP,
            "systems/coupling/imperfect_wires.c",
            "#include <math.h>",
            "#include <math.h>\n#define HALF 0.5",
        ),
    ],
)
def test_another_figure_is_computed_anew(changed, module, file, old, new):
    assert changed(module, file, old, new)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("studies/sweep/point.py", "its task and its result.", "task and result."),
        ("studies/sweep/tables.py", "import", "import sys\nimport"),
        ("studies/sweep/trajectories.py", "\n\n\n", "\n\n\nMOST = 3\n\n\n"),
        ("cases/flow/power_flow.py", '"""Power flow of a case:', '"""The power flow of a case:'),
        (
            "linear/spectra/modes.py",
            'class Mode(OfEigenvalue):\n    """',
            'class Mode(OfEigenvalue):\n    """Again: ',
        ),
        ("cases/flow/power_flow.py", "complex(p, q)", "complex(p, q)  # in pu\n"),
        ("face/cli/check.py", "import argparse\n", "import argparse\nimport sys\n"),
    ],
)
def test_comments_docstrings_and_what_is_not_imported_keep_what_is_kept(changed, file, old, new):
    text = (code._ROOT / file).read_text(encoding="utf-8")
    if text.count(old) > 1:  # the first of them
        old, new = text[: text.index(old) + len(old)], text[: text.index(old)] + new
    assert not changed(SWEEP, file, old, new)


def test_code_that_changes_under_a_running_program_gives_other_names(fresh, monkeypatch):
    before = key_of({"a": 1}, SWEEP)
    numbers_hash.cache_clear()
    monkeypatch.setattr(code, "_hash_of_files", lambda: "another")
    assert key_of({"a": 1}, SWEEP) != before


def test_no_point_is_computed_by_what_only_shows_it():
    showing = ("tables", "words", "report", "files", "view", "plots", "sheet", "summary", "html")
    for task in _tasks(Task):
        needed = needed_modules(task.__module__)
        assert len(needed) > 100
        assert not [
            name for name in needed if name.rpartition(".")[2] in showing and name not in _READ
        ], task


_READ = {"orchestrator.devices.binding.tables", "orchestrator.cases.networks.cgmes.files"}
"""What is read from a binding's file, and files that are read."""


def _tasks(kind):
    return [kind, *(one for own in kind.__subclasses__() for one in _tasks(own))]
