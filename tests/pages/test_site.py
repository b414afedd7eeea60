"""The site builds without a warning."""

import subprocess
import sys

import pytest

from tests.pages.markdown import ROOT, name_of, pages

pytest.importorskip("mkdocs")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(ROOT / ".docs" / "mkdocs.yml")]
    done = subprocess.run([*command, "--site-dir", str(folder)], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_page_is_there(site):
    for page in pages():
        name = name_of(page).removeprefix(".docs/")
        if name == "CHANGELOG.md":
            continue
        folder = site / ("" if name == "README.md" else name.removesuffix(".md"))
        if page.stem in ("README", "index"):
            folder = site if name == "README.md" else folder.parent
        assert (folder / "index.html").is_file(), name


def test_commands_are_filled_in(site):
    text = (site / "reference" / "commands" / "index.html").read_text(encoding="utf-8")
    for option in ("--critical", "--fail-unstable", "--with-linear-model"):
        assert option in text


def test_no_comment_for_tests_stands_where_the_file_is_named(site):
    text = (site / "how-to" / "add-an-exciter" / "index.html").read_text(encoding="utf-8")
    assert "fmus/synchronous_generator/exciters.py" in text
    assert "title=&quot;" not in text
