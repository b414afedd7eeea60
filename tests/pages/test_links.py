"""Every link of README, pages and leaflets leads to a file, and to a heading where it names one."""

import pytest

from tests.pages.markdown import ROOT, anchors, links, name_of, pages


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_links_lead_somewhere(page):
    wrong = []
    for line, target in links(page):
        if target.partition(":")[0] in ("https", "http", "mailto"):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.is_relative_to(ROOT) or not file.exists():
            wrong.append(f"{name_of(page)}:{line}: {target}: no such file")
        elif anchor and file.suffix in (".md", ".ipynb") and anchor not in anchors(file):
            wrong.append(
                f"{name_of(page)}:{line}: {target}: no such heading; there are {sorted(anchors(file))}"
            )
    assert not wrong, "\n".join(wrong)


def test_links_and_headings_are_read():
    """The tools of these tests see what is known to be there."""
    readme = ROOT / "README.md"
    assert "LICENSE" in {target for _, target in links(readme)}
    assert "limits" in anchors(readme)
    assert len(pages()) > 40


def test_a_link_over_two_lines_is_read(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One\n\nSee [a title\nof two lines](other.md) and [two](b.md).\n", encoding="utf-8"
    )
    assert links(page) == [(3, "other.md"), (4, "b.md")]
