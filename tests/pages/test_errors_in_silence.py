"""The page on errors that other tools make in silence: each command is typed, and says what the page says."""

import csv
import json
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest

from tests.pages.markdown import ROOT, blocks

PAGE = ROOT / ".docs" / "validation" / "errors-in-silence.md"
pytestmark = pytest.mark.usefixtures("undrawn")  # what a command says is looked at
TITLES = re.findall(r"^## (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def section(title):
    """The commands under a heading, as words, and the sentences that they are to say."""
    text = PAGE.read_text(encoding="utf-8").partition(f"## {title}\n")[2].partition("\n## ")[0]
    typed, said = (
        re.search(rf"```{language}\n(.*?)```", text, re.DOTALL)[1].splitlines()
        for language in ("sh", "text")
    )
    return [shlex.split(line) for line in typed], said


@pytest.mark.parametrize("title", TITLES)
def test_a_command_says_what_the_page_says(title, gfor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    typed, said = section(title)
    for block in blocks(PAGE):
        if block.path:
            (tmp_path / block.path).write_text(block.text, encoding="utf-8")
    for _, *words in (line for line in typed if line[0] == "python"):
        subprocess.run([sys.executable, *words], check=True)
    own = [words for program, *words in typed if program == "gfor"]
    text = "\n".join(out + err for _, out, err in (gfor(*words) for words in own))
    one_line = " ".join(text.split())
    assert [line for line in said if line not in one_line] == []


def table(path):
    with path.open(newline="") as file:
        return list(csv.reader(file))


def matrix(path):
    """The figures of a matrix that was written with the names of its rows and columns."""
    return np.array([[float(cell) for cell in row[1:]] for row in table(path)[1:]])


def test_the_written_matrix_is_none_of_zeros(gfor, tmp_path):
    typed = ("two_area_rms", "--scenario", "gfor", "--continuous", "--out", tmp_path)
    code, _, err = gfor("export", "linear", *typed)
    assert code == 0, err
    A, B = (matrix(tmp_path / "gfor" / f"{name}.csv") for name in "AB")
    turned, largest, *_ = sorted(np.linalg.eigvals(A).real, reverse=True)
    assert turned == pytest.approx(0, abs=1e-8), "all angles turned together: nothing changes"
    assert largest == pytest.approx(-0.1412, abs=5e-5)
    assert np.abs(B).max() > 0


def test_each_mode_has_the_participations_of_its_own_eigenvectors(gfor, tmp_path):
    code, out, err = gfor("modes", "kundur", "--json")
    assert code == 0, err
    first = json.loads(out)["scenarios"][0]
    code, _, err = gfor("export", "linear", "kundur", "--continuous", "--out", tmp_path)
    assert code == 0, err
    file = tmp_path / first["name"] / "A.csv"
    names = table(file)[0][1:]
    values, right = np.linalg.eig(matrix(file))
    left = np.linalg.inv(right)
    assert first["modes"]
    for mode in first["modes"]:
        k = int(np.argmin(np.abs(values - complex(mode["real"], mode["imag"]))))
        own = np.abs(left[k] * right[:, k])
        own /= own.sum()
        for one in mode["participation"][:4]:
            assert own[names.index(one["state"])] == pytest.approx(one["factor"], rel=1e-3)
