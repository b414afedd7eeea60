"""Tables as a reader meets them, on a terminal, on a page and in Markdown: title → rows, each by its column's heading.

A heading that stands twice has a number behind it the second time: "Damping [%]" and "Damping [%] 2".
"""

import re
from html.parser import HTMLParser

Rows = list[dict[str, str]]


def on_terminal(text: str) -> dict[str, Rows]:
    """Tables between lines of box drawing; the title is the line before the box."""
    found: dict[str, Rows] = {}
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if not line.startswith("┏"):
            continue
        title, headings, rows = lines[k - 1].strip(), [], []
        for inside in lines[k + 1 :]:
            if inside.startswith("└"):
                break
            if inside.startswith("┃"):
                headings.append(_cells(inside, "┃"))
            elif inside.startswith("│"):
                rows.append(_cells(inside, "│"))
        columns = [" ".join(filter(None, parts)) for parts in zip(*headings, strict=True)]
        found[title] = _by_heading(columns, rows)
    return found


def on_page(text: str) -> dict[str, Rows]:
    """Tables of HTML by their captions; one caption's tables follow each other."""
    reader = _TableReader()
    reader.feed(text)
    found: dict[str, Rows] = {}
    for title, (columns, *rows) in reader.tables:
        found.setdefault(title, []).extend(_by_heading(columns, rows))
    return found


def in_markdown(text: str) -> list[list[list[str]]]:
    """Tables of a Markdown page, each as its rows of cells; the ruler is left out."""
    tables: list[list[list[str]]] = [[]]
    for line in text.splitlines():
        if not line.startswith("|"):
            tables += [[]] if tables[-1] else []
        elif not re.fullmatch(r"[|\s:-]+", line):
            tables[-1].append([cell.strip() for cell in line.strip("|").split("|")])
    return [t for t in tables if t]


def value(cell: str) -> float:
    """The number in a cell, written with either minus sign."""
    return float(cell.replace("−", "-").replace(",", "").rstrip("%s "))


def eigenvalue(cell: str) -> complex:
    """``+0.0322 ± j3.5949``."""
    real, imaginary = cell.replace("−", "-").split(" ± j")
    return complex(float(real), float(imaginary))


def _cells(line: str, edge: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip(edge).split(edge)]


def _by_heading(columns: list[str], rows: list[list[str]]) -> Rows:
    names = [
        name if name not in columns[:k] else f"{name} {columns[:k].count(name) + 1}"
        for k, name in enumerate(columns)
    ]
    return [dict(zip(names, row, strict=True)) for row in rows]


class _TableReader(HTMLParser):
    """Collects captions and cells."""

    def __init__(self) -> None:
        super().__init__()
        self.tables: list[tuple[str, list[list[str]]]] = []
        self._text: list[str] | None = None

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "table":
            self.tables.append(("", []))
        elif tag == "tr" and self.tables:
            self.tables[-1][1].append([])
        elif tag in ("td", "th", "caption"):
            self._text = []

    def handle_data(self, data: str) -> None:
        if self._text is not None:
            self._text.append(data)

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th", "caption") and self._text is not None:
            text, self._text = "".join(self._text).strip(), None
            if tag == "caption":
                self.tables[-1] = (text, self.tables[-1][1])
            else:
                self.tables[-1][1][-1].append(text)
