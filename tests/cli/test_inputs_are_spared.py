"""No command writes over a file that it reads."""

from pathlib import Path

import pytest

from orchestrator.cli.design import _writable
from orchestrator.errors import InputError
from orchestrator.safe_files import inputs, spare_input

CASE = '[network]\nraw = "net.raw"\n'
DESIGN = ("design", "case.toml", "--controller", "pod_p")


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    texts = {"case.toml": CASE, "net.raw": "0, 100 /", "own.toml": "[set]\n", "points.csv": "name\na\n", "rec.csv": "t"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    yield
    assert {name: (tmp_path / name).read_text() for name in texts} == texts


@pytest.mark.parametrize(
    ("arguments", "spared"),
    [
        ([*DESIGN, "--out", "net.raw"], "net.raw"),
        ([*DESIGN, "--out=./case.toml"], "case.toml"),
        ([*DESIGN, "--parameters", "own.toml", "--out", "link.toml"], "link.toml"),
        ([*DESIGN, "--points", "points.csv", "--out", "points.toml"], "points.csv"),
        (["new", "net.raw", "own.toml", "--out", "own.toml", "--force"], "own.toml"),
        (["signal", "source", "rec.csv", "--html", "rec.csv"], "rec.csv"),
        (["certify", "rec.csv", "--code", "miso", "--into", "rec.csv"], "rec.csv"),
    ],
)  # fmt: skip
def test_a_file_that_is_read_is_not_written_over(gfor, files, tmp_path, arguments, spared):
    (tmp_path / "link.toml").symlink_to("own.toml")
    code, out, err = gfor(*arguments)
    assert (code, out) == (2, "")
    assert f"{spared}: the command reads this file" in err


def test_what_lies_beside_may_be_written(gfor, files, tmp_path):
    code, _, err = gfor("signal", "source", "rec.csv", "--html", "rec.html")
    assert code == 2
    assert "the command reads this file" not in err
    assert not inputs
    spare_input(tmp_path / "rec.csv")


def test_a_design_replaces_a_parameter_file_and_no_other(files):
    assert _writable(Path("own.toml")) == Path("own.toml")
    with pytest.raises(InputError, match="another file is there, not a parameter file"):
        _writable(Path("net.raw"))
