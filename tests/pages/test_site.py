"""The site builds without a warning."""

import re

import pytest

from orchestrator.core.uncollected import uncollected
from tests.pages.markdown import ROOT, name_of, pages
from tests.pages.notebooks import NOTEBOOKS
from tests.support.once import made_once

pytestmark = pytest.mark.slow  # all of them, or the site would be built for the quick ones as well
pytest.importorskip("mkdocs")


@pytest.fixture(scope="module")
def site():
    """The folder of the site as ``mkdocs build --strict`` builds it, but for the index of its search.

    In this process, which has imported all commands: for the page of their options that is a fifth of the time."""
    from mkdocs.commands.build import build  # noqa: PLC0415 - where MkDocs is installed
    from mkdocs.config import load_config  # noqa: PLC0415

    def make(folder):
        file = str(ROOT / ".docs" / "mkdocs.yml")
        config = load_config(file, strict=True, site_dir=str(folder))
        config.plugins["material/search"].config.enabled = False
        config.plugins.on_startup(command="build", dirty=False)
        try:
            with uncollected():
                build(config)  # a warning is an exception
        finally:
            config.plugins.on_shutdown()

    return made_once("site", make)


def test_every_page_is_there(site):
    for page in pages():
        name = name_of(page).removeprefix(".docs/")
        if name == "CHANGELOG.md":
            continue
        folder = site / (
            "" if name == "README.md" else name.removesuffix(".md").removesuffix(".ipynb")
        )
        if page.stem in ("README", "index"):
            folder = site if name == "README.md" else folder.parent
        assert (folder / "index.html").is_file(), name


def test_commands_are_filled_in(site):
    text = (site / "reference" / "commands" / "index.html").read_text(encoding="utf-8")
    for option in ("--critical", "--fail-unstable", "--with-linear-model"):
        assert option in text


def test_no_comment_for_tests_stands_where_the_file_is_named(site):
    text = (site / "how-to" / "add-an-exciter" / "index.html").read_text(encoding="utf-8")
    assert "fmus/synchronous_generator/excitation/without_ceilings.py" in text
    assert "title=&quot;" not in text


def test_every_page_is_an_entry_of_the_navigation(site):
    """Also the leaflets, which are called README: such a page hides behind the title of its section."""
    text = (site / "reference" / "commands" / "index.html").read_text(encoding="utf-8")
    entries = set(re.findall(r'<a href="([^"]+)" class="md-nav__link', text))
    for page in (
        "orchestrator/cases",
        "gfor_fmu",
        "fmus/grid",
        "validation/two-area",
        "tutorials/paper",
    ):
        assert f"../../{page}/" in entries
    headings = re.findall(
        r'<label class="md-nav__link"[^>]*>\s*<span class="md-ellipsis">\s*(\w+)', text
    )
    assert "Reference" in headings


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_a_notebook_is_shown_with_figures_and_tables_and_can_be_downloaded(site, path):
    page = (site / "tutorials" / path.stem / "index.html").read_text(encoding="utf-8")
    pictures = re.findall(r'<img alt="[^"]+" src="\.\./([^"]+\.png)"', page)
    assert pictures
    assert all(
        (site / "tutorials" / picture).read_bytes().startswith(b"\x89PNG") for picture in pictures
    )
    assert '<table border="1" class="dataframe">' in page
    assert f'<a download="{path.name}" href="../{path.name}">' in page
    assert (site / "tutorials" / path.name).read_bytes() == path.read_bytes()
    for written in re.findall(r'"%%writefile (\S+)\\n', path.read_text(encoding="utf-8")):
        assert f'<span class="filename">{written}</span>' in page
    others = page.replace(f'href="../{path.name}"', "")
    assert not re.search(r'href="[^":]*\.(md|ipynb)[#"]', others), (
        "a link to a file of the repository"
    )
