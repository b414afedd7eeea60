"""No command writes over a file that it reads."""

from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import inputs, spare_input
from orchestrator.face.cli.design import _writable
from orchestrator.output.results.manifest import MANIFEST, read_manifest
from orchestrator.output.results.staging import staged

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = '[network]\nraw = "net.raw"\n'
DESIGN = ("design", "case.toml", "--controller", "pod_p")


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    texts = {
        "case.toml": CASE,
        "net.raw": "0, 100 /",
        "own.toml": "[set]\n",
        "points.csv": "name\na\n",
        "rec.csv": "t",
    }
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
)
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
    assert _writable(Path("own.toml"), "usual.toml") == Path("own.toml")
    with pytest.raises(InputError, match="another file is there, not a parameter file"):
        _writable(Path("net.raw"), "usual.toml")


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A case of one's own in a folder with other files."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text(load_case("infinite_bus").text)
    return "run", "own.toml", "--scenario", "dip", "--stop", "0.02"


@pytest.mark.parametrize("place", ["dip", "dip/notes.txt", "case.toml", "modes.csv"])
def test_what_no_run_has_made_is_not_replaced_by_one(gfor, study, tmp_path, place):
    """A folder or a file with a scenario's name, and another case beside which results are put."""
    path = tmp_path / place
    path.parent.mkdir(exist_ok=True)
    path.write_text("mine")
    code, _, err = gfor(*study, "--out", ".")
    assert code == 2
    assert str(Path(place).parts[0]) in err
    assert path.read_text() == "mine"
    assert not (tmp_path / "summary.json").exists()


def test_a_run_that_is_repeated_leaves_the_files_of_others(gfor, study, tmp_path):
    for _ in range(2):
        code, _, err = gfor(*study, "--out", ".")
        assert code == 0, err
        (tmp_path / "dip/notes").mkdir(exist_ok=True)
        for name in ("dip/notes/mine.txt", "dip/manifest.csv", "dip/plan.part-2"):
            (tmp_path / name).write_text("mine")
    assert (tmp_path / "dip/notes/mine.txt").read_text() == "mine"
    assert "notes/mine.txt" not in read_manifest(tmp_path / "dip").files


def test_a_case_with_other_line_ends_is_run_where_it_lies(gfor, study, tmp_path):
    (tmp_path / "own.toml").rename("case.toml")
    content = (tmp_path / "case.toml").read_bytes().replace(b"\n", b"\r\n")
    (tmp_path / "case.toml").write_bytes(content)
    code, _, err = gfor("run", "case.toml", *study[2:], "--out", ".")
    assert code == 0, err
    assert (tmp_path / "case.toml").read_bytes() == content


def test_a_result_is_no_place_for_a_page(gfor, study, tmp_path):
    gfor(*study, "--out", ".")
    for name in ("dip/trajectory.nc", "summary.json", "dip/manifest.json"):
        before = (tmp_path / name).read_bytes()
        code, _, err = gfor("report", ".", "--out", name)
        assert (code, f"{name}: it is one of the results" in err) == (2, True), err
        assert (tmp_path / name).read_bytes() == before
    assert gfor("report", ".", "--out", "page.html")[0] == 0
    assert gfor("report", ".", "--out", "page.html")[0] == 0


def put(folder, run, **files):
    with staged(folder, run) as staging:
        for name, text in files.items():
            (staging / f"{name}.csv").write_text(text)


def test_what_was_computed_stays_beside_a_file_that_is_in_its_way(tmp_path):
    (tmp_path / "modes.csv").write_text("mine")
    with pytest.raises(
        InputError, match=r"modes\.csv: .*no command has written it; the results are in .*one"
    ):
        put(tmp_path, "one", modes="new", other="new")
    assert (tmp_path / "modes.csv").read_text() == "mine"
    assert {path.name for path in (tmp_path / "one").iterdir()} == {
        "modes.csv",
        "other.csv",
        MANIFEST,
    }
    # as if it had been killed while it put its files there
    (tmp_path / "one").rename(tmp_path / ".part-one")
    for text in ("new", "newer"):
        put(tmp_path, text, modes=text)
    assert (tmp_path / "modes.csv").read_text() == "newer"


def test_a_page_goes_where_pages_go(gfor, study, tmp_path):
    gfor(*study, "--out", "r")
    before = (tmp_path / "own.toml").read_text()
    code, _, err = gfor("report", "r", "--out", "own.toml")
    assert (code, "give a name that ends in .html" in err) == (2, True), err
    assert (tmp_path / "own.toml").read_text() == before


def test_a_case_that_was_edited_since_is_told_in_a_report(gfor, study, tmp_path):
    gfor(*study, "--out", "r")
    assert "not as they were" not in gfor("report", "r")[2]
    with (tmp_path / "own.toml").open("a") as file:
        file.write("# another one\n")
    assert (
        "not as they were when results were made of them: own.toml (of r)" in gfor("report", "r")[2]
    )
    assert "make the results again" in (tmp_path / "r/report.html").read_text()


def test_another_file_of_that_name_where_a_report_is_made_is_no_input(
    gfor, study, tmp_path, monkeypatch
):
    gfor(*study, "--out", "r")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "elsewhere/own.toml").write_text("another")
    assert "not as they were" not in gfor("report", "../r")[2]
    (tmp_path / "own.toml").write_text("edited")
    assert "own.toml (of ../r)" in gfor("report", "../r")[2]
