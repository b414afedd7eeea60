"""A page is printed by the browser that is installed, and what hinders it is said."""

import sys

import pytest

from orchestrator.core.errors import InputError
from orchestrator.output.report import pdf


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "a page.html"
    path.write_text("<p>one</p>", encoding="utf-8")
    return path


@pytest.fixture
def browser(tmp_path, monkeypatch):
    """Put a program of that name on the path, alone; its text is Python."""

    def install(text, name="google-chrome"):
        folder = tmp_path / "bin"
        folder.mkdir()
        program = folder / name
        program.write_text(f"#!{sys.executable}\nimport sys\n{text}\n", encoding="utf-8")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(folder))

    return install


PRINTS = """
target = next(a.partition("=")[2] for a in sys.argv if a.startswith("--print-to-pdf="))
open(target, "w").write("printed " + sys.argv[-1])
"""


def test_the_browser_gets_page_and_target(page, browser, tmp_path):
    browser(PRINTS)
    target = tmp_path / "page.pdf"
    assert pdf.print_pdf(page, target) == target
    assert target.read_text(encoding="utf-8") == f"printed {page.as_uri()}"


def test_without_a_browser_the_page_to_print_is_named(page, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(
        InputError, match=r"--pdf: none of chromium, .* is installed; open .*a page\.html"
    ):
        pdf.print_pdf(page, tmp_path / "page.pdf")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "sys.exit('first\\nno display')",
            r"printed nothing \(no display\); print .*a page\.html by hand",
        ),
        ("pass", r"printed nothing \(it said nothing\)"),
        ("import time\ntime.sleep(60)", r"does not print: .*timed out"),
    ],
)
def test_a_browser_that_does_not_print(page, browser, tmp_path, monkeypatch, text, words):
    browser(text)
    if "sleep" in text:
        monkeypatch.setattr(pdf, "_PATIENCE", 2)
    with pytest.raises(InputError, match=words):
        pdf.print_pdf(page, tmp_path / "page.pdf")
